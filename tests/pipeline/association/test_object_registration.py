"""Finding how an object was turned and shifted, and whether it is the same, by shape and print."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from pipeline.association.cloud_agreement import ObjectCloud, ObjectRegistration
from pipeline.association.object_registration import register_objects, rotation_about
from pipeline.camera import is_rigid, rotation_angle_rad

UP = np.array([0.0, 0.0, 1.0])
SPACING_M = 0.02
SIZE_M = np.array([0.6, 0.4, 0.5])
# Cameras all around, and above: every side but the bottom is seen.
AROUND = np.array([[3, 0, 2], [-3, 0, 2], [0, 3, 2], [0, -3, 2]], float)


def printed(seed: int, points: np.ndarray) -> np.ndarray:
    """(n, 3) log colours of a print in space: blotches of about 8 cm."""
    rng = np.random.default_rng(seed)
    blotches = gaussian_filter(rng.normal(size=(40, 40, 40, 3)), (2.0, 2.0, 2.0, 0))
    blotches *= 0.35 / blotches.std()
    cells = np.round(points / 0.03).astype(int) + 20
    return 4.5 + blotches[cells[:, 0], cells[:, 1], cells[:, 2]]


def box(seed: int | None = 0, size_m: np.ndarray = SIZE_M, viewpoints: np.ndarray = AROUND) -> ObjectCloud:
    """A box at the origin, its bottom unseen; with the print of ``seed``, or plain."""
    points, normals = [], []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        grid = np.meshgrid(
            *(np.arange(SPACING_M / 2, size_m[other], SPACING_M) for other in others), indexing="ij"
        )
        for side in (0, 1) if axis < 2 else (1,):
            face = np.zeros((grid[0].size, 3))
            face[:, others] = np.stack([g.ravel() for g in grid], axis=1)
            face[:, axis] = side * size_m[axis]
            points.append(face)
            normals.append(np.tile((2 * side - 1) * np.eye(3)[axis], (len(face), 1)))
    placed = np.concatenate(points) - size_m * [0.5, 0.5, 0]
    colours = np.full(placed.shape, 4.5) if seed is None else printed(seed, placed)
    return ObjectCloud(placed, np.concatenate(normals), colours, viewpoints)


def moved(cloud: ObjectCloud, yaw_rad: float, shift_m: np.ndarray, viewpoints=None) -> ObjectCloud:
    """Turned about the vertical through the origin, then shifted, seen by cameras around its new place."""
    R = rotation_about(UP, yaw_rad)
    return ObjectCloud(
        cloud.points_world @ R.T + shift_m,
        cloud.normals_world @ R.T,
        cloud.log_colours,
        (AROUND if viewpoints is None else viewpoints) + shift_m,
    )


def seen_from(cloud: ObjectCloud, viewpoints: np.ndarray) -> ObjectCloud:
    """Only what faces one of the viewpoints (a box hides none of its own faces that face a camera)."""
    ray = viewpoints[:, None] - cloud.points_world[None]
    cosine = np.einsum("vnd,nd->vn", ray, cloud.normals_world) / np.linalg.norm(ray, axis=2)
    rows = (cosine > 0.2).any(axis=0)
    return ObjectCloud(
        cloud.points_world[rows], cloud.normals_world[rows], cloud.log_colours[rows], viewpoints
    )


def noisy(cloud: ObjectCloud, seed: int = 1) -> ObjectCloud:
    rng = np.random.default_rng(seed)
    return ObjectCloud(
        cloud.points_world + rng.normal(0, 0.003, cloud.points_world.shape),
        cloud.normals_world,
        cloud.log_colours + rng.normal(0, 0.05, cloud.log_colours.shape),
        cloud.viewpoints_world,
    )


def error(found: ObjectRegistration, yaw_rad: float, shift_m: np.ndarray) -> tuple[float, float]:
    """Wrong angle in degrees, and how far the middle of the box was put wrong, metres."""
    R = rotation_about(UP, yaw_rad)
    middle = np.array([0, 0, SIZE_M[2] / 2])
    T = found.T_world_motion
    return (
        float(np.degrees(rotation_angle_rad(np.eye(3), R.T @ T[:3, :3]))),
        float(np.linalg.norm(T[:3, :3] @ middle + T[:3, 3] - (R @ middle + shift_m))),
    )


@settings(max_examples=12)
@given(st.floats(-np.pi, np.pi), st.tuples(st.floats(-4, 4), st.floats(-4, 4), st.floats(-0.5, 0.5)))
@example(np.pi, (2.0, 0.0, 0.0))  # a box fits itself at the half turn too; its print does not
@example(0.0, (0.0, 0.0, 0.0))
def test_printed_box_is_found_however_it_was_turned_and_shifted(yaw: float, shift: tuple) -> None:
    shift_m = np.array(shift)

    found = register_objects(noisy(box()), noisy(moved(box(), yaw, shift_m), 2), UP, SPACING_M)

    angle_deg, distance_m = error(found, yaw, shift_m)
    assert angle_deg < 3
    assert distance_m < SPACING_M
    assert found.overlap > 0.9
    assert found.shared > 0.9
    assert found.texture_correlation > 0.7
    assert is_rigid(found.T_world_motion)


def test_a_look_alike_of_another_print_agrees_less() -> None:
    shift = np.array([1.0, 2.0, 0.0])
    same = register_objects(box(), noisy(moved(box(), 1.0, shift)), UP, SPACING_M)

    for seed in (1, 2, 3):
        other = register_objects(box(), noisy(moved(box(seed), 1.0, shift)), UP, SPACING_M)
        assert other.overlap > 0.8  # the shapes are one
        assert other.agreement < same.agreement - 0.3
        assert other.likelihood < same.likelihood
        assert other.texture_correlation < 0.6 < same.texture_correlation


def test_the_gain_of_brightness_is_told_and_does_not_count_as_another_colour() -> None:
    brighter = moved(box(), 0.5, np.array([1.0, 0, 0]))
    brighter = ObjectCloud(
        brighter.points_world, brighter.normals_world, brighter.log_colours + 0.4, brighter.viewpoints_world
    )

    found = register_objects(box(), brighter, UP, SPACING_M)

    assert found.gain == pytest.approx(0.4, abs=0.03)
    assert found.colour_residual < 0.1
    assert found.chroma_residual < 0.1
    assert error(found, 0.5, np.array([1.0, 0, 0]))[0] < 3


def ball() -> ObjectCloud:
    index = np.arange(2000) + 0.5
    polar, turn = np.arccos(1 - 2 * index / 2000), np.pi * (1 + 5**0.5) * index
    normals = np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1)
    return ObjectCloud(0.25 * normals + [0, 0, 0.25], normals, np.full((2000, 3), 4.0), AROUND)


def test_plain_ball_is_placed_though_no_turn_of_it_can_be_told() -> None:
    shift = np.array([1.5, -0.5, 0.0])

    found = register_objects(ball(), moved(ball(), 1.0, shift), UP, SPACING_M)

    T = found.T_world_motion
    middle = np.array([0, 0, 0.25])
    assert np.linalg.norm(T[:3, :3] @ middle + T[:3, 3] - middle - shift) < SPACING_M
    assert np.isfinite([found.likelihood, found.texture_correlation, found.gain, found.agreement]).all()
    # One colour says nothing: neither for nor against.
    assert found.likelihood == pytest.approx(0, abs=0.01)
    assert found.texture < 1e-6
    assert found.overlap > 0.95


@pytest.mark.parametrize("count", [1, 2, 5])
def test_clouds_of_a_few_points_are_compared_without_a_crash(count: int) -> None:
    whole = box()
    few = ObjectCloud(
        whole.points_world[:count], whole.normals_world[:count], whole.log_colours[:count], AROUND
    )

    for found in (register_objects(few, whole, UP, SPACING_M), register_objects(whole, few, UP, SPACING_M)):
        assert np.isfinite(found.T_world_motion).all()
        assert np.isfinite(found.agreement)
        assert found.likelihood == -1.0  # too little in common to say anything


def test_sides_that_were_not_seen_do_not_count_against_it() -> None:
    # Before seen from +x and +y, now (unturned) from +y and -x: the side towards +y and the top are common.
    before_from = np.array([[3.0, 0, 1.5], [0, 3.0, 1.5]])
    now_from = np.array([[-3.0, 0, 1.5], [0, 3.0, 1.5]])
    shift = np.array([2.0, 1.0, 0.0])
    before, now = seen_from(box(), before_from), moved(seen_from(box(), now_from), 0.0, shift, now_from)
    assert len(before) < 0.7 * len(box())

    found = register_objects(before, now, UP, SPACING_M)

    angle_deg, distance_m = error(found, 0.0, shift)
    assert angle_deg < 5  # sides without a counterpart pull a little
    assert distance_m < SPACING_M
    assert found.overlap > 0.9
    assert found.shared < 0.85  # as a share of all points it would look like two things


def test_a_part_in_plain_view_that_is_missing_does_count() -> None:
    # Half as tall: the upper half would have been seen.
    low = box(size_m=SIZE_M * [1, 1, 0.5])

    found = register_objects(box(), moved(low, 0.0, np.array([1.0, 0, 0])), UP, SPACING_M)

    assert min(found.overlap_previous, found.overlap_current) < 0.7


def test_sampling_keeps_at_most_as_many_points_spread_over_the_cloud() -> None:
    cloud = box()
    sampled = cloud.sampled(100)

    assert len(sampled) == 100
    assert sampled.points_world[[0, -1]].tolist() == cloud.points_world[[0, -1]].tolist()
    assert cloud.sampled(len(cloud)) is cloud


@given(st.floats(-3.1, 3.1), st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1))
def test_rotation_about_an_axis_turns_by_its_angle_and_leaves_the_axis(angle: float, axis: tuple) -> None:
    unit = np.array(axis) / np.linalg.norm(axis)
    R = rotation_about(unit, angle)

    assert rotation_angle_rad(np.eye(3), R) == pytest.approx(abs(angle), abs=1e-6)
    assert R @ unit == pytest.approx(unit)
    assert np.linalg.det(R) == pytest.approx(1)
