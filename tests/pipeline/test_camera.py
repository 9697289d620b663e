from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from pipeline.camera import (
    T_OPENGL_OPENCV,
    PinholeCamera,
    invert_rigid,
    is_rigid,
    rotation_angle_rad,
    transform_points,
)

finite = st.floats(-50, 50, allow_nan=False)


@st.composite
def cameras(draw: st.DrawFn) -> PinholeCamera:
    width, height = draw(st.integers(4, 60)), draw(st.integers(4, 60))
    return PinholeCamera(
        width,
        height,
        fx=draw(st.floats(10, 200)),
        fy=draw(st.floats(10, 200)),
        cx=draw(st.floats(0, width - 1)),
        cy=draw(st.floats(0, height - 1)),
    )


@st.composite
def rigid_transforms(draw: st.DrawFn) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(draw(arrays(float, 3, elements=st.floats(-3, 3)))).as_matrix()
    T[:3, 3] = draw(arrays(float, 3, elements=finite))
    return T


def test_backprojection_by_hand() -> None:
    camera = PinholeCamera(3, 2, fx=2.0, fy=4.0, cx=1.0, cy=0.5)
    depth = np.array([[2.0, 2.0, 2.0], [4.0, 0.0, 4.0]], np.float32)

    points = camera.backproject(depth)

    # x = (u - cx) / fx * z, y = (v - cy) / fy * z
    assert points[0].tolist() == [[-1, -0.25, 2], [0, -0.25, 2], [1, -0.25, 2]]
    assert points[1, 2].tolist() == [2, 0.5, 4]
    assert points[1, 1].tolist() == [0, 0, 0]


@given(cameras(), st.floats(0.2, 40))
def test_projecting_what_was_backprojected_gives_the_pixels_back(camera: PinholeCamera, depth: float) -> None:
    image = np.full((camera.height, camera.width), depth, np.float32)

    pixels, z = camera.project(camera.backproject(image))

    row, column = np.mgrid[: camera.height, : camera.width]
    assert pixels[..., 0] == pytest.approx(column, abs=1e-3)
    assert pixels[..., 1] == pytest.approx(row, abs=1e-3)
    assert z == pytest.approx(image)


def test_points_behind_the_camera_keep_their_depth_sign() -> None:
    camera = PinholeCamera(4, 4, 2, 2, 1.5, 1.5)

    pixels, z = camera.project(np.array([[1.0, 1.0, -2.0], [0.0, 0.0, 0.0]]))

    assert z.tolist() == [-2, 0]
    assert np.isfinite(pixels).all()


@given(cameras(), st.integers(1, 4), st.integers(1, 4))
def test_resized_camera_sees_image_corners_and_centres_at_the_same_directions(
    camera: PinholeCamera, across: int, down: int
) -> None:
    resized = camera.resized(camera.width * across, camera.height * down)

    # Pixel edges (-0.5 and width - 0.5) are what scaling an image keeps in place.
    for edge, resized_edge in ((-0.5, -0.5), (camera.width - 0.5, resized.width - 0.5)):
        before = (edge - camera.cx) / camera.fx
        assert (resized_edge - resized.cx) / resized.fx == pytest.approx(before, abs=1e-9)
    for edge, resized_edge in ((-0.5, -0.5), (camera.height - 0.5, resized.height - 0.5)):
        before = (edge - camera.cy) / camera.fy
        assert (resized_edge - resized.cy) / resized.fy == pytest.approx(before, abs=1e-9)


def test_resizing_there_and_back_changes_nothing() -> None:
    camera = PinholeCamera(640, 480, 525.0, 520.0, 319.5, 241.0)
    back = camera.resized(160, 120).resized(640, 480)

    assert (back.fx, back.fy, back.cx, back.cy) == pytest.approx((525.0, 520.0, 319.5, 241.0))


@given(cameras(), st.integers(1, 5), st.integers(0, 100))
def test_strided_camera_is_the_camera_of_the_strided_image(
    camera: PinholeCamera, stride: int, seed: int
) -> None:
    depth = np.random.default_rng(seed).uniform(0.5, 9, (camera.height, camera.width)).astype(np.float32)
    strided = camera.strided(stride)

    assert (strided.height, strided.width) == depth[::stride, ::stride].shape
    expected = camera.backproject(depth)[::stride, ::stride]
    assert strided.backproject(depth[::stride, ::stride]) == pytest.approx(expected, rel=1e-4, abs=1e-4)


@given(rigid_transforms())
def test_inverse_undoes_a_rigid_transform(T: np.ndarray) -> None:
    assert invert_rigid(T) @ T == pytest.approx(np.eye(4), abs=1e-9)
    assert is_rigid(T)
    assert is_rigid(invert_rigid(T))


@given(rigid_transforms(), arrays(float, (5, 3), elements=finite))
def test_transforming_points_is_multiplying_homogeneous_ones(T: np.ndarray, points: np.ndarray) -> None:
    expected = (T @ np.c_[points, np.ones(5)].T).T[:, :3]

    assert transform_points(T, points) == pytest.approx(expected, abs=1e-9)
    assert transform_points(T, points.astype(np.float32)).dtype == np.float32


@pytest.mark.parametrize(
    "T",
    [
        np.full((4, 4), np.nan),
        np.diag([1.0, 1.0, -1.0, 1.0]),  # mirrored
        np.diag([2.0, 2.0, 2.0, 1.0]),  # scaled
        np.eye(4) + np.eye(4, k=-3) * 0.5,  # no homogeneous last row
        np.eye(3),
    ],
)
def test_matrices_that_are_no_pose_are_told(T: np.ndarray) -> None:
    assert not is_rigid(T)


@given(st.floats(0, 3.1), arrays(float, 3, elements=st.floats(-1, 1)))
def test_rotation_angle_is_the_angle_turned(angle: float, axis: np.ndarray) -> None:
    length = np.linalg.norm(axis)
    axis = axis / length if length > 1e-3 else np.array([0.0, 0.0, 1.0])
    base = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()
    turned = base @ Rotation.from_rotvec(angle * axis).as_matrix()

    assert rotation_angle_rad(base, turned) == pytest.approx(angle, abs=1e-6)
    assert rotation_angle_rad(turned, base) == pytest.approx(angle, abs=1e-6)


def test_opengl_cameras_look_along_minus_z_with_y_up() -> None:
    assert (T_OPENGL_OPENCV @ [0, 0, 1, 1]).tolist() == [0, 0, -1, 1]
    assert (T_OPENGL_OPENCV @ [0, 1, 0, 1]).tolist() == [0, -1, 0, 1]
    assert (T_OPENGL_OPENCV @ [1, 0, 0, 1]).tolist() == [1, 0, 0, 1]
