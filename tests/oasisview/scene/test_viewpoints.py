from __future__ import annotations

import numpy as np
import pytest

from oasisview.scene.viewpoints import (
    Viewpoint,
    at_keyframe,
    clear_of,
    horizontal_axes,
    overview,
    towards_object,
)

UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("up", [[0, 0, 1], [0, -1, 0], [0.6, 0, 0.8]])
def test_horizontal_axes_are_level_and_orthonormal(up: list[float]) -> None:
    axes = np.stack([*horizontal_axes(np.array(up)), np.array(up)])
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)


def test_the_overview_looks_down_on_the_middle_from_outside() -> None:
    points = np.random.default_rng(0).uniform([-4, -2, 0], [4, 2, 1], (5000, 3))
    view = overview(points, UP)
    assert view.target == pytest.approx([0, 0, 0.5], abs=0.15)
    assert view.position[2] > 2
    assert np.linalg.norm(np.subtract(view.position, view.target)) > 5
    assert overview(np.zeros((0, 3)), UP).position != overview(np.zeros((0, 3)), UP).target


def test_an_object_is_seen_from_the_side_it_was_recorded_from_and_from_above() -> None:
    view = towards_object([1, 1, 0], [1.4, 1.4, 0.4], UP, seen_from=[5, 1.2, 1.5])
    assert view.target == pytest.approx([1.2, 1.2, 0.2])
    offset = np.subtract(view.position, view.target)
    assert offset[0] > 0 and abs(offset[1]) < 0.2 * offset[0] and offset[2] > 0
    above = towards_object([1, 1, 0], [1.4, 1.4, 0.4], UP, seen_from=[1.2, 1.2, 3])
    assert np.isfinite(above.position).all()


def test_both_places_of_a_moved_object_are_in_view_unless_far_apart() -> None:
    near = towards_object([0, 0, 0], [1, 1, 1], UP, [5, 0, 2], other_place=[2.5, 0.5, 0.5])
    assert near.target == pytest.approx([1.5, 0.5, 0.5])
    far = towards_object([0, 0, 0], [1, 1, 1], UP, [5, 0, 2], other_place=[40, 0.5, 0.5])
    assert far.target == pytest.approx([0.5, 0.5, 0.5])


def test_a_keyframe_is_looked_through() -> None:
    T = np.eye(4)
    T[:3, :3] = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], float)
    view = at_keyframe(T, back_off_m=0.5)
    assert view.position == pytest.approx([-0.5, 0, 0])
    assert view.target[0] > 0 and view.target[1:] == pytest.approx([0, 0])


def wall(x: float) -> np.ndarray:
    """A wall 2.5 m high across the x axis, a point every 5 cm."""
    y, z = np.meshgrid(np.arange(-4, 4, 0.05), np.arange(0, 2.5, 0.05))
    return np.stack([np.full(y.size, x), y.ravel(), z.ravel()], axis=1)


def test_a_clear_view_is_kept_and_a_hidden_one_goes_round_the_wall() -> None:
    wanted = Viewpoint((4.0, 0.0, 2.0), (0.0, 0.0, 0.5))
    assert clear_of(wanted, wall(-3.0), UP, 0.5) == wanted
    assert clear_of(wanted, np.zeros((0, 3)), UP, 0.5) == wanted
    found = clear_of(wanted, wall(2.0), UP, 0.5)
    eye, target = np.array(found.position), np.array(found.target)
    assert np.linalg.norm(eye - target) == pytest.approx(np.linalg.norm([4.0, 0.0, 1.5]))
    share = (2.0 - target[0]) / (eye[0] - target[0]) if eye[0] > 2.0 else np.inf
    crossing = target + share * (eye - target) if np.isfinite(share) else eye
    assert eye[0] < 2.0 or crossing[2] > 2.5, "the line of sight passes beside or above the wall"
    assert found.target == wanted.target and eye[2] >= 2.0 - 1e-9


def test_a_camera_is_never_below_the_ground() -> None:
    wanted = Viewpoint((0.0, 3.0, 1.0), (0.0, 0.0, 0.0))
    box = np.concatenate([wall(1.5), wall(-1.5), wall(1.5)[:, [1, 0, 2]], wall(-1.5)[:, [1, 0, 2]]])
    found = clear_of(wanted, box, UP, 0.4)
    assert found.position[2] > 2.0, "out of a box one looks from above"
