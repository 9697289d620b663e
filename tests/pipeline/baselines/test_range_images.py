"""What a scan says about map points: in front, behind, or nothing."""

from __future__ import annotations

import numpy as np
from fixture_geometry import SMALL_CAMERA, pose
from hypothesis import given
from hypothesis import strategies as st

from pipeline.baselines.range_images import (
    RangeImage,
    angular_cells,
    disagreeing_points,
    points_in_view,
    scan_image,
)
from pipeline.camera import transform_points

CELL_DEG = 2.0
T_WORLD_CAMERA = pose((1.0, -2.0, 0.5), (0, 1, 0))


def on_axis(*depths_m: float) -> np.ndarray:
    """Points straight ahead of the camera, in the world."""
    points = np.array([[0.0, 0.0, depth] for depth in depths_m], np.float32)
    return transform_points(T_WORLD_CAMERA, points)


def judged(points: np.ndarray, wall_m: float) -> tuple[list[int], list[int]]:
    depth = np.full((SMALL_CAMERA.height, SMALL_CAMERA.width), wall_m, np.float32)
    front, behind = disagreeing_points(
        points,
        np.arange(len(points)),
        scan_image(depth, SMALL_CAMERA, CELL_DEG),
        SMALL_CAMERA,
        T_WORLD_CAMERA,
        CELL_DEG,
        0.1,
    )
    return front.tolist(), behind.tolist()


def test_point_is_in_front_behind_or_agrees_by_more_than_the_limit() -> None:
    assert judged(on_axis(1.5), wall_m=2.0) == ([0], [])
    assert judged(on_axis(2.5), wall_m=2.0) == ([], [0])
    assert judged(on_axis(1.95), wall_m=2.0) == ([], [])
    assert judged(on_axis(2.05), wall_m=2.0) == ([], [])


def test_only_the_nearest_point_of_a_cell_is_judged() -> None:
    assert judged(on_axis(3.0, 1.5, 2.0), wall_m=2.0) == ([1], [])


def test_nothing_is_said_without_a_measurement_or_out_of_the_image() -> None:
    beside = transform_points(T_WORLD_CAMERA, np.array([[5.0, 0.0, 1.0], [0.0, 0.0, -1.0]], np.float32))
    assert judged(beside, wall_m=2.0) == ([], [])
    assert judged(on_axis(1.5), wall_m=0.0) == ([], [])


def test_scan_keeps_the_nearest_range_of_each_cell() -> None:
    depth = np.full((SMALL_CAMERA.height, SMALL_CAMERA.width), 4.0, np.float32)
    depth[20:28, 28:36] = 1.0
    image = scan_image(depth, SMALL_CAMERA, CELL_DEG)
    centre = angular_cells(np.array([[0.0, 0.0, 1.0]]), CELL_DEG)
    corner = angular_cells(SMALL_CAMERA.backproject(depth)[:1, 0], CELL_DEG)
    np.testing.assert_allclose(image.at(centre), 1.0, atol=0.02)
    assert image.at(corner)[0] > 4.0  # a range is along the ray, not along the axis


@given(st.floats(-1.2, 1.2), st.floats(-1.5, 1.5), st.floats(0.5, 20.0), st.floats(1.1, 3.0))
def test_cell_follows_from_the_direction_alone(
    elevation: float, azimuth: float, range_m: float, times: float
) -> None:
    direction = np.array(
        [[np.cos(elevation) * np.sin(azimuth), np.sin(elevation), np.cos(elevation) * np.cos(azimuth)]]
    )
    # Off the rim of a cell, where rounding may decide.
    cell = np.deg2rad(0.4)
    offset = min(abs((angle / cell) % 1 - 0.5) for angle in (elevation + np.pi / 2, azimuth + np.pi))
    if offset < 0.49:
        near, far = (angular_cells(direction * scale, 0.4) for scale in (range_m, range_m * times))
        assert (
            near.tolist() == far.tolist()
            or max(abs((angle / cell) % 1 - 0.5) for angle in (elevation + np.pi / 2, azimuth + np.pi)) > 0.49
        )


def test_empty_range_image_knows_nothing() -> None:
    empty = RangeImage(np.zeros(0, np.int64), np.zeros(0, np.float32))
    assert np.isnan(empty.at(np.array([1, 2]))).all()


def test_points_in_view_leave_out_what_something_hides() -> None:
    depth = np.full((SMALL_CAMERA.height, SMALL_CAMERA.width), 2.0, np.float32)
    depth[:, :32] = 0.0
    points = np.concatenate([on_axis(1.0, 2.05, 3.0), on_axis(2.0) - [[0.5, 0.0, 0.0]]]).astype(np.float32)
    arguments = (points, np.arange(4), depth, SMALL_CAMERA, T_WORLD_CAMERA)
    assert points_in_view(*arguments, 0.1).tolist() == [0, 1]  # the last one has no measurement
    assert points_in_view(*arguments, np.inf).tolist() == [0, 1, 2]
