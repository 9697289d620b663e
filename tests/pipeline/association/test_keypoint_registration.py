"""What the keypoints of two objects agree on: made-up keypoints under known motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.association.keypoint_registration import (
    KeypointRegistration,
    print_places,
    register_by_keypoints,
)
from pipeline.association.object_keypoints import ObjectKeypoints, no_keypoints

SPACING_M = 0.01


def printed(seed: int, count: int = 20, size_m: float = 0.4) -> ObjectKeypoints:
    """Keypoints all over a cube, each with a descriptor of its own."""
    rng = np.random.default_rng(seed)
    descriptors = rng.normal(size=(count, 128))
    descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
    return ObjectKeypoints(
        rng.uniform(0, size_m, (count, 3)),
        Rotation.random(count, rng=rng).as_matrix(),
        np.full(count, 0.03),
        descriptors.astype(np.float32),
    )


def motion(turn_rad: tuple[float, float, float], shift_m: tuple[float, float, float]) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_rotvec(turn_rad).as_matrix(), shift_m
    return T


def moved(keypoints: ObjectKeypoints, T: np.ndarray) -> ObjectKeypoints:
    return replace(
        keypoints,
        points_world=keypoints.points_world @ T[:3, :3].T + T[:3, 3],
        R_world_keypoint=T[:3, :3] @ keypoints.R_world_keypoint,
    )


def part(keypoints: ObjectKeypoints, rows: np.ndarray | slice) -> ObjectKeypoints:
    return ObjectKeypoints(
        keypoints.points_world[rows],
        keypoints.R_world_keypoint[rows],
        keypoints.sizes_m[rows],
        keypoints.descriptors[rows],
    )


def joined(*parts: ObjectKeypoints) -> ObjectKeypoints:
    return ObjectKeypoints(
        np.concatenate([p.points_world for p in parts]),
        np.concatenate([p.R_world_keypoint for p in parts]),
        np.concatenate([p.sizes_m for p in parts]),
        np.concatenate([p.descriptors for p in parts]),
    )


@given(
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.tuples(*[st.floats(-5, 5)] * 3),
    st.integers(0, 5),
)
def test_any_motion_is_found_with_every_place_in_agreement(turn, shift, seed) -> None:
    T, before = motion(turn, shift), printed(seed)

    found = register_by_keypoints([before], [moved(before, T)], SPACING_M)[0, 0]

    assert found.T_world_motion == pytest.approx(T, abs=1e-6)
    # Twenty places, each alike to the last bit: the weight of each is 1.
    assert found.support == pytest.approx(20, abs=0.05)
    points = before.points_world
    mean_shift = (points @ T[:3, :3].T + T[:3, 3] - points).mean(axis=0)
    assert found.displacement_m == pytest.approx(np.linalg.norm(mean_shift), abs=1e-6)


def test_each_object_is_found_among_many_and_only_it() -> None:
    before = [printed(seed) for seed in range(4)]
    T = motion((0, 0, 1.0), (2, 0, 0))
    after = [moved(before[2], T), printed(9), before[0]]

    found = register_by_keypoints(before, after, SPACING_M)

    assert set(found) == {(2, 0), (0, 2)}
    assert found[2, 0].T_world_motion == pytest.approx(T, abs=1e-6)
    assert found[0, 2].is_still(0.1, 10.0)
    assert not found[2, 0].is_still(0.1, 10.0)


def test_noise_and_wrong_pairs_do_not_carry_the_motion_away() -> None:
    rng = np.random.default_rng(3)
    T, before = motion((0.2, 0.1, 1.0), (1, 2, 0)), printed(0, 40)
    after = moved(before, T)
    noisy = after.points_world + rng.normal(0, 0.003, (40, 3))
    noisy[:16] = rng.uniform([0, 1, -1], [2, 3, 1], (16, 3))  # where nothing of it is
    descriptors = after.descriptors + rng.normal(0, 0.03, (40, 128))
    descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
    after = replace(after, points_world=noisy, descriptors=descriptors.astype(np.float32))

    found = register_by_keypoints([before], [after], SPACING_M)[0, 0]

    carried = before.points_world[16:] @ found.T_world_motion[:3, :3].T + found.T_world_motion[:3, 3]
    assert np.linalg.norm(carried - noisy[16:], axis=1).mean() < 0.008
    assert 5 < found.support < 24


def test_what_several_objects_of_a_visit_show_tells_none_of_them_apart() -> None:
    barcode = printed(0, 12)
    own = [printed(seed, 12) for seed in (1, 2)]
    before = [joined(barcode, own[0]), joined(barcode, own[1])]
    T = motion((0, 0, 0.5), (3, 0, 0))

    found = register_by_keypoints(before, [moved(before[0], T)], SPACING_M)

    assert set(found) == {(0, 0)}
    assert found[0, 0].support == pytest.approx(12, abs=0.05)  # its own print, not the barcode


def test_keypoints_of_other_sizes_are_not_of_one_thing() -> None:
    before = printed(0)
    larger = replace(before, sizes_m=before.sizes_m * 2)

    assert register_by_keypoints([before], [larger], SPACING_M) == {}


def test_a_place_counts_once_however_many_views_saw_it() -> None:
    before = printed(0, 10)
    after = moved(before, motion((0, 0, 1), (1, 0, 0)))

    once = register_by_keypoints([before], [after], SPACING_M)[0, 0]
    often = register_by_keypoints([joined(*[before] * 4)], [joined(*[after] * 3)], SPACING_M)[0, 0]

    assert often.support == pytest.approx(once.support, abs=0.05)


def test_two_pairs_are_a_coincidence() -> None:
    before = printed(0, 10)

    assert register_by_keypoints([part(before, slice(2))], [before], SPACING_M) == {}


def test_objects_without_keypoints_agree_with_nothing() -> None:
    one = printed(0)

    assert register_by_keypoints([], [], SPACING_M) == {}
    assert register_by_keypoints([no_keypoints(), no_keypoints()], [one], SPACING_M) == {}
    assert set(register_by_keypoints([no_keypoints(), one], [one, no_keypoints()], SPACING_M)) == {(1, 0)}


@pytest.mark.parametrize(
    ("displacement_m", "turn_deg", "expected"),
    [(0.1, 0.0, True), (0.11, 0.0, False), (0.0, 9.9, True), (0.0, 10.1, False)],
)
def test_an_object_is_still_within_both_limits(displacement_m, turn_deg, expected) -> None:
    T = motion((0, 0, np.deg2rad(turn_deg)), (0, 0, 0))

    assert KeypointRegistration(T, displacement_m, 5.0).is_still(0.1, 10.0) is expected


def test_print_places_are_the_means_of_keypoints_close_together() -> None:
    keypoints = part(printed(0), slice(3))
    points = np.array([[0.001, 0.001, 0.001], [0.003, 0.003, 0.003], [1.001, 1.001, 1.001]])

    places = print_places(replace(keypoints, points_world=points), SPACING_M)

    assert places == pytest.approx(np.array([[0.002] * 3, [1.001] * 3]))
    assert print_places(no_keypoints(), SPACING_M).shape == (0, 3)
