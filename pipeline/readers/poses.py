"""Poses as archives state them: checked, repaired within rounding, and turned to our conventions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import T_OPENGL_OPENCV
from pipeline.errors import InputError

ROUNDING = 1e-6  # deviation from orthonormal up to which a pose is taken as it is
MAX_DEVIATION = 1e-2  # up to which it is repaired
IDENTITY, LAST_ROW = np.eye(3), np.array([0.0, 0.0, 0.0, 1.0])


def checked_pose(matrix: Any) -> NDArray[np.float64]:
    """A rigid (4, 4) camera-to-world matrix; rotations written with few digits are made orthonormal.

    Raises:
        InputError: what is wrong, as a clause that follows the frame's name.
    """
    if matrix is None:
        raise InputError("its pose is missing")
    try:
        T = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError("its pose is not a matrix of numbers") from None
    if T.shape == (3, 4):
        T = np.vstack([T, LAST_ROW])
    if T.shape != (4, 4):
        raise InputError(f"its pose has shape {T.shape} instead of (4, 4)")
    if not np.isfinite(T).all():
        raise InputError("its pose is not finite")
    rotation = T[:3, :3]
    deviation = np.abs(rotation @ rotation.T - IDENTITY).max()
    is_homogeneous = np.abs(T[3] - LAST_ROW).max() <= ROUNDING
    if deviation > MAX_DEVIATION or not is_homogeneous or np.linalg.det(rotation) <= 0:
        raise InputError(_why_not_rigid(T))
    if deviation > ROUNDING:
        u, _, vt = np.linalg.svd(rotation)
        T[:3, :3] = u @ vt
    return T


def _why_not_rigid(T: NDArray[np.float64]) -> str:
    if np.abs(T[3] - LAST_ROW).max() > ROUNDING:
        return "its pose is not rigid (the last row is not 0 0 0 1)"
    rotation = T[:3, :3]
    determinant = float(np.linalg.det(rotation))
    scale = abs(determinant) ** (1 / 3)
    if scale > 0 and np.allclose(rotation @ rotation.T, scale**2 * np.eye(3), atol=1e-2 * scale**2):
        if determinant < 0:
            return "its pose is not rigid (mirrored axes)"
        return f"its pose is not rigid (rotation scaled by {scale:.3g}; poses must be metric and unscaled)"
    return "its pose is not rigid (the rotation is not orthonormal)"


def opencv_from_opengl(T_world_opengl: NDArray[np.float64]) -> NDArray[np.float64]:
    """Camera-to-world pose of the OpenCV camera that sees what this OpenGL camera sees, (4, 4)."""
    return np.asarray(T_world_opengl @ T_OPENGL_OPENCV)
