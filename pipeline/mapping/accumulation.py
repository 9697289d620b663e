"""Submaps of LiDAR visits: points are accumulated as they are, since they are metrically accurate already
(paper, Sec. III-B.1), and rendered by splatting instead of ray casting a distance field."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, invert_rigid, transform_points
from pipeline.store.files import write_arrays

MAX_SPLAT_RADIUS_PX = 3
_NEAR_M = 0.05


class AccumulatedSubmap:
    """One submap under construction: the measured points of its keyframes, one per voxel.

    Args:
        voxel_size_m: edge of the cell of which one point is kept.
    """

    def __init__(self, voxel_size_m: float) -> None:
        self._voxel_size_m = voxel_size_m
        self._points: list[NDArray[np.float32]] = []
        self.keyframe_count = 0

    def integrate(
        self, depth: NDArray[np.float32], camera: PinholeCamera, T_world_camera: NDArray[np.float64]
    ) -> None:
        """Add the points of a depth image (h, w) in metres, 0 = no measurement."""
        self.keyframe_count += 1
        points = camera.backproject(depth)[depth > 0].astype(np.float64)
        world = transform_points(T_world_camera, points)
        self._points.append(_one_per_cell(world.astype(np.float32), self._voxel_size_m))

    def save(self, path: Path) -> None:
        """Write the points, one per voxel of the whole submap."""
        points = np.concatenate(self._points) if self._points else np.zeros((0, 3), np.float32)
        write_arrays(path, points_world=_one_per_cell(points, self._voxel_size_m))


def splat_depth(
    points_world: NDArray[np.float32],
    point_size_m: float,
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Depth image of points drawn as squares of about their own size.

    Args:
        points_world: (P, 3) metres.
        point_size_m: edge of the cell that a point stands for.

    Returns:
        (height, width) float32 metres along z; 0 where nothing is drawn.
    """
    points_camera = transform_points(invert_rigid(T_world_camera), points_world.astype(np.float64))
    pixels, depth = camera.project(points_camera)
    column, row = np.round(pixels).astype(np.int64).T
    margin = MAX_SPLAT_RADIUS_PX
    inside = (depth > _NEAR_M) & (column >= -margin) & (row >= -margin)
    inside &= (column < camera.width + margin) & (row < camera.height + margin)
    column, row, depth = column[inside], row[inside], depth[inside]
    radius = np.clip(np.round(0.5 * point_size_m * camera.fx / depth), 0, MAX_SPLAT_RADIUS_PX).astype(int)
    image = np.full(camera.height * camera.width, np.inf, np.float32)
    for dy in range(-margin, margin + 1):
        for dx in range(-margin, margin + 1):
            x, y = column + dx, row + dy
            drawn = radius >= max(abs(dx), abs(dy))
            drawn &= (x >= 0) & (y >= 0) & (x < camera.width) & (y < camera.height)
            if drawn.any():
                np.minimum.at(image, y[drawn] * camera.width + x[drawn], depth[drawn].astype(np.float32))
    return np.where(np.isfinite(image), image, 0).reshape(camera.height, camera.width).astype(np.float32)


def _one_per_cell(points: NDArray[np.float32], cell_m: float) -> NDArray[np.float32]:
    if not len(points):
        return points
    cells = np.floor(points / cell_m).astype(np.int64)
    cells -= cells.min(axis=0)
    size = cells.max(axis=0) + 1
    keys = (cells[:, 0] * size[1] + cells[:, 1]) * size[2] + cells[:, 2]
    return points[np.unique(keys, return_index=True)[1]]
