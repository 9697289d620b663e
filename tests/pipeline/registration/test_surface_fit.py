from __future__ import annotations

import numpy as np
import pytest
from fixture_shapes import VOXEL_M, Surface, ball, corridor, hollow, motion, noisy, rectangle, together
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.camera import is_rigid, rotate_points, rotation_angle_rad, transform_points
from pipeline.registration.sampling import sample_normal_space
from pipeline.registration.surface_fit import SurfaceFit, SurfaceTarget

LOOSE_BELOW = 0.01
REACH_M = 0.12

shifts = st.tuples(*[st.floats(-0.03, 0.03)] * 3)
turns_deg = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


def fit(target: Surface, source: Surface, T_wrong_right: np.ndarray, samples: int = 2500) -> SurfaceFit:
    points, normals = source
    chosen = sample_normal_space(normals, samples, np.random.default_rng(0))
    moved = transform_points(T_wrong_right, points[chosen])
    turned = rotate_points(T_wrong_right[:3, :3], normals[chosen])
    found = SurfaceTarget(*target, VOXEL_M).fit(moved, turned, REACH_M, 2 * VOXEL_M, loose_below=LOOSE_BELOW)
    assert found is not None
    return found


def left_over(found: SurfaceFit, T_wrong_right: np.ndarray) -> tuple[np.ndarray, float]:
    """Shift (3,) in metres and angle in degrees that the fit does not undo."""
    left = found.T_target_source @ T_wrong_right
    return left[:3, 3], np.degrees(rotation_angle_rad(np.eye(3), left[:3, :3]))


@settings(max_examples=12)
@given(shifts, turns_deg)
def test_small_motions_are_undone_without_flat_ground_or_walls(shift: tuple, turn_deg: tuple) -> None:
    T = motion(shift, turn_deg)

    found = fit(noisy(hollow(1), 1), noisy(hollow(2), 2), T)

    assert is_rigid(found.T_target_source, 1e-9)
    moved_m, turned_deg = left_over(found, T)
    assert np.linalg.norm(moved_m) < 0.002
    assert turned_deg < 0.05
    assert found.loose_directions == 0


@settings(max_examples=8)
@given(shifts, turns_deg)
def test_what_changed_does_not_pull(shift: tuple, turn_deg: tuple) -> None:
    before, after = hollow(1), hollow(2)
    changed = after[0][:, 0] > np.percentile(after[0][:, 0], 80)
    moved = after[0] + np.where(changed[:, None], np.float32([0.05, 0.04, -0.05]), np.float32(0))
    T = motion(shift, turn_deg)

    found = fit(noisy(before, 1), noisy((moved, after[1]), 2), T)

    moved_m, turned_deg = left_over(found, T)
    # One point of five was moved by 81 mm.
    assert np.linalg.norm(moved_m) < 0.010
    assert turned_deg < 0.25
    assert found.cost_after < found.cost_before


def test_what_is_in_one_visit_only_does_not_pull() -> None:
    T = motion((0.02, -0.02, 0.01), (0.5, -0.5, 0.6))
    extra = [rectangle((1.5, 0, 0), (0, 1.5, 0), (-1, -1, 3 + 0.2 * k), k) for k in range(8)]

    found = fit(noisy(hollow(1), 1), noisy(together(hollow(2), *extra), 2), T)

    moved_m, turned_deg = left_over(found, T)
    assert np.linalg.norm(moved_m) < 0.004
    assert turned_deg < 0.1


def test_corridor_leaves_its_direction_as_it_is_and_gets_the_others_right() -> None:
    T = motion((0.05, 0.02, -0.02), (0.4, 0.5, -0.4))

    found = fit(noisy(corridor(1), 1), noisy(corridor(2), 2), T)

    assert found.loose_directions == 1
    moved_m, turned_deg = left_over(found, T)
    assert moved_m[0] == pytest.approx(0.05, abs=0.01)
    assert np.abs(moved_m[1:]).max() < 0.002
    assert turned_deg < 0.05


def test_objects_in_a_corridor_hold_its_direction() -> None:
    def furnished(seed: int) -> Surface:
        return together(corridor(seed), *(ball((x, 0.6, 0.4), 0.3, seed + 2 + x) for x in (-2, 0, 1)))

    T = motion((0.03, 0.02, -0.02), (0.4, 0.5, -0.4))

    found = fit(noisy(furnished(1), 1), noisy(furnished(20), 2), T)

    assert found.loose_directions == 0
    moved_m, _ = left_over(found, T)
    assert np.abs(moved_m).max() < 0.003


def test_plane_is_only_lifted_and_tilted() -> None:
    plane = [rectangle((4, 0, 0), (0, 4, 0), (-2, -2, 0), seed) for seed in (1, 2)]
    T = motion((0.03, -0.02, 0.04), (0.6, -0.6, 0.8))

    found = fit(noisy(plane[0], 1), noisy(plane[1], 2), T)

    assert found.loose_directions == 3
    left = found.T_target_source @ T
    assert abs(left[2, 3]) < 0.002
    assert np.degrees(np.arccos(left[2, 2])) < 0.05  # the tilt is gone
    turn_about_normal = np.degrees(np.arctan2(left[1, 0], left[0, 0]))
    assert turn_about_normal == pytest.approx(0.8, abs=0.1)
    np.testing.assert_allclose(left[:2, 3], [0.03, -0.02], atol=0.005)


def test_ball_is_shifted_but_not_turned() -> None:
    T = motion((0.03, -0.02, 0.02), (0, 0, 2))

    found = fit(noisy(ball((0, 0, 0), 1, 1), 1), noisy(ball((0, 0, 0), 1, 2), 2), T)

    assert found.loose_directions == 3
    moved_m, turned_deg = left_over(found, T)
    assert np.linalg.norm(moved_m) < 0.002
    assert turned_deg == pytest.approx(2, abs=0.15)


def test_surfaces_that_do_not_meet_are_not_fitted() -> None:
    points, normals = ball((0, 0, 0), 1, 1)
    target = SurfaceTarget(points, normals, VOXEL_M)

    assert target.fit(points + np.float32(50), normals, REACH_M, 0.06, loose_below=0.01) is None
    assert target.fit(points[:10], normals[:10], REACH_M, 0.06, loose_below=0.01) is None


@given(st.integers(0, 5), st.integers(100, 3000))
def test_rare_directions_are_drawn_as_often_as_common_ones(seed: int, count: int) -> None:
    normals = np.repeat(np.eye(3), [9000, 900, 90], axis=0)

    chosen = sample_normal_space(normals, count, np.random.default_rng(seed))

    assert len(np.unique(chosen)) == count
    per_direction = normals[chosen].sum(axis=0)
    assert per_direction[2] == min(90, per_direction[2])
    if count >= 270:
        assert per_direction[2] == 90
    assert abs(per_direction[0] - min(per_direction[1], 900)) <= max(1, per_direction[0] - 900)
    np.testing.assert_array_equal(chosen, sample_normal_space(normals, count, np.random.default_rng(seed)))
