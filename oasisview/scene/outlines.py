"""Line drawings in the map: boxes of objects, camera frusta, the robot's path. Pure arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
_BOX_EDGES = np.array(
    [[0, 1], [0, 2], [0, 4], [1, 3], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 6], [5, 7], [6, 7]]
)
FRUSTUM_EDGES = np.array([[0, 1], [0, 2], [0, 3], [0, 4], [1, 2], [2, 3], [3, 4], [4, 1]])


def box_corners(low: NDArray[np.floating], high: NDArray[np.floating]) -> NDArray[np.float32]:
    """The (8, 3) corners of axis-aligned bounds."""
    low = np.asarray(low, np.float32)
    return low + _CORNERS * (np.asarray(high, np.float32) - low)


def box_segments(
    low: NDArray[np.floating], high: NDArray[np.floating], margin_m: float = 0.0
) -> NDArray[np.float32]:
    """The (12, 2, 3) edges of axis-aligned bounds, grown by a margin on every side."""
    low, high = np.asarray(low, np.float32) - margin_m, np.asarray(high, np.float32) + margin_m
    return box_corners(low, high)[_BOX_EDGES]


def edges_of(corners: NDArray[np.floating]) -> NDArray[np.float32]:
    """The (12, 2, 3) edges of a box given by its (8, 3) corners, in the order of :func:`box_corners`."""
    return np.asarray(corners, np.float32)[_BOX_EDGES]


def dashed(segments: NDArray[np.floating], dash_m: float) -> NDArray[np.float32]:
    """Cut (S, 2, 3) segments into dashes of ``dash_m`` with gaps of the same length."""
    pieces = []
    for start, end in np.asarray(segments, np.float32):
        span = float(np.linalg.norm(end - start))
        count = int(np.clip(np.ceil(span / (2 * dash_m)), 1, 200))
        starts = np.arange(count, dtype=np.float32) / count
        stops = starts + 0.5 / count
        pieces.append(
            np.stack([start + starts[:, None] * (end - start), start + stops[:, None] * (end - start)], 1)
        )
    return np.concatenate(pieces) if pieces else np.zeros((0, 2, 3), np.float32)


def frustum_corners(
    camera: PinholeCamera, T_world_camera: NDArray[np.floating], depth_m: float
) -> NDArray[np.float32]:
    """(5, 3) world: the camera centre, then the image corners (clockwise from top left) at a depth."""
    corners = np.array(
        [
            [-0.5, -0.5],
            [camera.width - 0.5, -0.5],
            [camera.width - 0.5, camera.height - 0.5],
            [-0.5, camera.height - 0.5],
        ]
    )
    rays = np.column_stack(
        [(corners[:, 0] - camera.cx) / camera.fx, (corners[:, 1] - camera.cy) / camera.fy, np.ones(4)]
    )
    points = np.vstack([np.zeros(3), rays * depth_m])
    return (points @ T_world_camera[:3, :3].T + T_world_camera[:3, 3]).astype(np.float32)


def frustum_segments(
    camera: PinholeCamera, T_world_camera: NDArray[np.floating], depth_m: float
) -> NDArray[np.float32]:
    """The (8, 2, 3) edges of a camera's frustum up to a depth."""
    return frustum_corners(camera, T_world_camera, depth_m)[FRUSTUM_EDGES]


def path_segments(positions_world: NDArray[np.floating]) -> NDArray[np.float32]:
    """(K, 3) positions as (K-1, 2, 3) segments of a path."""
    positions = np.asarray(positions_world, np.float32).reshape(-1, 3)
    return np.stack([positions[:-1], positions[1:]], axis=1)


def box_mesh() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices (8, 3) and triangles (12, 3) of the unit box around the origin, facing outward."""
    faces = np.array(
        [
            *([0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]),
            *([2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]),
        ],
        np.uint32,
    )
    return _CORNERS - 0.5, faces
