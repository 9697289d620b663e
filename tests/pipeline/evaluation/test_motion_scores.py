from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera import rotation_angle_rad
from pipeline.evaluation import GroundTruth, Motion, evaluate_result
from pipeline.evaluation.motion_error import (
    angle_only_error_rad,
    rotation_about,
    rotation_error_rad,
    transform_error_m,
)
from pipeline.result import ChangeLabel

UP = np.array([0.0, 0.0, 1.0])
STATIC, MOVED = ChangeLabel.STATIC, ChangeLabel.MOVED
ANGLES = st.floats(-3.1, 3.1)
AXES = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1)


def deg(value: float) -> float:
    return float(np.radians(value))


def motion(turn_deg: float, shift: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = rotation_about(UP, deg(turn_deg))
    T[:3, 3] = shift
    return T


def test_rotation_errors_by_hand() -> None:
    true = rotation_about(UP, deg(100))
    for order, expected in ((1, 90), (2, 90), (3, 30), (4, 0), (0, 0)):
        error = rotation_error_rad(rotation_about(UP, deg(10)), true, UP, order)
        assert np.degrees(error) == pytest.approx(expected, abs=1e-4)
    tilted = rotation_about(np.array([1.0, 0, 0]), deg(40))
    assert np.degrees(rotation_error_rad(np.eye(3), tilted, UP, 0)) == pytest.approx(40)  # not about up


def test_an_angle_alone_gives_a_lower_bound() -> None:
    true = rotation_about(UP, deg(100))
    for order, expected in ((1, 90), (2, 70), (4, 0), (0, 0)):  # half a turn less, 100 looks like 80
        assert np.degrees(angle_only_error_rad(deg(10), true, UP, order)) == pytest.approx(expected)


@given(axis=AXES, turn=ANGLES, predicted_axis=AXES, predicted=ANGLES, order=st.integers(0, 6))
def test_symmetry_never_makes_an_error_larger(axis, turn, predicted_axis, predicted, order: int) -> None:
    true = rotation_about(np.array(axis) / np.linalg.norm(axis), turn)
    guess = rotation_about(np.array(predicted_axis) / np.linalg.norm(predicted_axis), predicted)
    error = rotation_error_rad(guess, true, UP, order)
    plain = rotation_angle_rad(guess, true)
    assert -1e-9 <= error <= plain + 1e-6
    if order == 1:
        assert error == pytest.approx(plain, abs=1e-6)
    # Whoever knows the axis too can do no better than the bound of the angle alone.
    angle = rotation_angle_rad(np.eye(3), guess)
    assert angle_only_error_rad(angle, true, UP, order) <= error + 1e-6


@given(turn=ANGLES, order=st.integers(1, 6), steps=st.integers(0, 5))
def test_turns_that_look_alike_are_no_error(turn: float, order: int, steps: int) -> None:
    alike = rotation_about(UP, turn + 2 * np.pi * steps / order)
    assert rotation_error_rad(alike, rotation_about(UP, turn), UP, order) == pytest.approx(0, abs=1e-5)


def test_transform_error_turns_about_the_points_centre() -> None:
    square = np.array([[5.0, 1, 0], [5, -1, 0], [6, 0, 0], [4, 0, 0]])
    quarter = motion(0)
    quarter[:3, :3] = rotation_about(UP, deg(90))
    quarter[:3, 3] = np.array([5.0, 0, 0]) - quarter[:3, :3] @ [5, 0, 0]
    assert transform_error_m(np.eye(4), quarter, square, UP, 4) == pytest.approx(0, abs=1e-9)
    # Without symmetry each corner is off by a side of the square, sqrt(2).
    assert transform_error_m(np.eye(4), quarter, square, UP, 1) == pytest.approx(np.sqrt(2))
    assert transform_error_m(motion(0, (0.3, 0, 0)), np.eye(4), square, UP, 1) == pytest.approx(0.3)


@pytest.fixture
def half_seen(build) -> tuple[SimpleNamespace, object]:
    """A bar of 4 m that moved by 10 m: one visit sees its left half, the other its right half."""
    left, right = (20, 21), (32, 33)
    truth = build.truth(
        [(0, x, MOVED, 3) for x in left] + [(1, x, MOVED, 3) for x in right] + [(1, 50, STATIC, 0)]
    )
    result = build.result([(0, x, 14) for x in left] + [(1, x, 14) for x in right], {14: MOVED})
    return result, truth


def with_motion(result: SimpleNamespace, T: np.ndarray | None, rotation_rad: float | None = None) -> None:
    rows = None if T is None else tuple(map(tuple, T.tolist()))
    result.objects = tuple(
        dataclasses.replace(item, T_world_motion=rows, rotation_rad=rotation_rad) for item in result.objects
    )


def test_displacement_at_the_centroid_is_not_fooled_by_partial_views(half_seen) -> None:
    result, points = half_seen
    truth = GroundTruth(points, {3: Motion(motion(0, (10, 0, 0)))})
    by_views = evaluate_result(result, truth, radius_m=0.1).displacement[0]
    assert by_views.mean_error_m == pytest.approx(0, abs=1e-4)  # both see 12 m between the halves
    assert by_views.centroid_compared == 1
    assert by_views.mean_centroid_error_m == pytest.approx(2, abs=1e-4)
    with_motion(result, motion(0, (10, 0, 0)))
    assert evaluate_result(result, truth, radius_m=0.1).displacement[0].mean_centroid_error_m == (
        pytest.approx(0, abs=1e-4)
    )
    assert evaluate_result(result, points, radius_m=0.1).displacement[0].mean_centroid_error_m is None


def test_rotation_scores_by_hand(half_seen) -> None:
    result, points = half_seen
    truth = GroundTruth(points, {3: Motion(motion(100), symmetry_order=2), 7: Motion(np.eye(4))})
    assert evaluate_result(result, truth, radius_m=0.1).rotation[0].to_dict() == {
        "known": 1,
        "compared": 0,
        "angle_only": 0,
        "mean_error_deg": None,
        "median_error_deg": None,
        "largest_error_deg": None,
    }
    with_motion(result, motion(-60))  # 160 away, and half a turn less is 20
    turned = evaluate_result(result, truth, radius_m=0.1).rotation[0]
    assert (turned.compared, turned.angle_only) == (1, 0)
    assert turned.mean_error_deg == pytest.approx(20, abs=1e-4)
    with_motion(result, None, rotation_rad=deg(60))
    turned = evaluate_result(result, truth, radius_m=0.1).rotation[0]
    assert (turned.compared, turned.angle_only) == (1, 1)
    assert turned.mean_error_deg == pytest.approx(20, abs=1e-4)  # 80 looks like 100
