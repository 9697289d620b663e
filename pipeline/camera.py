"""Pinhole cameras and rigid transforms: pure arrays, no input or output.

Cameras follow the OpenCV convention everywhere in the code (x right, y down, z forward) and pixel
(0, 0) is the centre of the top-left pixel. ``T_a_b`` maps points of frame ``b`` into frame ``a``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]

# Nerfstudio, Blender and OpenGL cameras look along -z with y up; this flips their axes to OpenCV's.
T_OPENGL_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True)
class PinholeCamera:
    """Intrinsics of an undistorted camera, in pixels of an image of ``width`` x ``height``."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Calibration matrix K, (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], dtype=np.float64)

    def resized(self, width: int, height: int) -> PinholeCamera:
        """The same camera for an image scaled to ``width`` x ``height``."""
        sx, sy = width / self.width, height / self.height
        return PinholeCamera(
            width=width,
            height=height,
            fx=self.fx * sx,
            fy=self.fy * sy,
            cx=(self.cx + 0.5) * sx - 0.5,
            cy=(self.cy + 0.5) * sy - 0.5,
        )

    def strided(self, stride: int) -> PinholeCamera:
        """The camera of ``image[::stride, ::stride]`` (samples pixel centres, no averaging)."""
        return PinholeCamera(
            width=-(-self.width // stride),
            height=-(-self.height // stride),
            fx=self.fx / stride,
            fy=self.fy / stride,
            cx=self.cx / stride,
            cy=self.cy / stride,
        )

    def backproject(self, depth: FloatArray) -> NDArray[np.float32]:
        """Points of a depth image in the camera frame.

        Args:
            depth: metres along z, (H, W) of this camera; 0 = no measurement.

        Returns:
            (H, W, 3) float32 metres; a pixel without measurement gives the origin.
        """
        rows, columns = depth.shape
        x = (np.arange(columns, dtype=np.float32) - np.float32(self.cx)) / np.float32(self.fx)
        y = (np.arange(rows, dtype=np.float32) - np.float32(self.cy)) / np.float32(self.fy)
        z = depth.astype(np.float32, copy=False)
        return np.stack([x[None, :] * z, y[:, None] * z, z], axis=-1)

    def project(self, points_camera: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixels and depths of points in the camera frame.

        Args:
            points_camera: (..., 3) metres.

        Returns:
            (..., 2) pixel coordinates (column, row) and (...) depths in metres. Points at or behind the
            camera centre keep their depth <= 0; their pixels are meaningless.
        """
        z = points_camera[..., 2]
        safe = np.where(z > 1e-6, z, 1.0)
        u = points_camera[..., 0] / safe * self.fx + self.cx
        v = points_camera[..., 1] / safe * self.fy + self.cy
        return np.stack([u, v], axis=-1), z


def invert_rigid(T_a_b: FloatArray) -> NDArray[np.float64]:
    """Inverse of a rigid transform, (4, 4) -> (4, 4), without a general matrix inverse."""
    rotation = np.asarray(T_a_b[:3, :3], dtype=np.float64)
    inverse = np.eye(4)
    inverse[:3, :3] = rotation.T
    inverse[:3, 3] = -rotation.T @ np.asarray(T_a_b[:3, 3], dtype=np.float64)
    return inverse


# Rows of one product: larger ones wake BLAS threads, which costs far more than three columns are worth
# (77,000 points on two busy cores: 58 ms at once, 4 ms in pieces, the same bits).
_PIECE_ROWS = 4096


def rotate_points(R_a_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Turn points or directions, (N, 3) -> (N, 3), in the dtype of the points."""
    turned = np.empty_like(points_b)
    transposed = np.asarray(R_a_b).astype(points_b.dtype).T
    for begin in range(0, len(points_b), _PIECE_ROWS):
        piece = slice(begin, begin + _PIECE_ROWS)
        np.matmul(points_b[piece], transposed, out=turned[piece])
    return turned


def transform_points(T_a_b: FloatArray, points_b: FloatArray) -> FloatArray:
    """Apply a rigid transform (4, 4) to points, (N, 3) -> (N, 3), in the dtype of the points."""
    moved = rotate_points(T_a_b[:3, :3], points_b)
    moved += np.asarray(T_a_b[:3, 3]).astype(points_b.dtype)
    return moved


def is_rigid(T: FloatArray, tolerance: float = 1e-2) -> bool:
    """Whether a (4, 4) matrix is finite, homogeneous, orthonormal and right-handed."""
    T = np.asarray(T, dtype=np.float64)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        return False
    rotation = T[:3, :3]
    return bool(
        np.allclose(T[3], [0, 0, 0, 1], atol=1e-6)
        and np.allclose(rotation @ rotation.T, np.eye(3), atol=tolerance)
        and np.linalg.det(rotation) > 0
    )


def rotation_angle_rad(rotation_a: FloatArray, rotation_b: FloatArray) -> float:
    """Angle of the rotation between two (3, 3) rotation matrices, in radians."""
    cosine = (np.trace(np.asarray(rotation_a).T @ np.asarray(rotation_b)) - 1.0) / 2.0
    return float(np.arccos(np.clip(cosine, -1.0, 1.0)))
