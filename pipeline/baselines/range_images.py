"""Range images of scans and maps, and what they say about each other (after Removert, IROS 2020).

A range image holds the nearest range in cells of equal angle around a keyframe. A map point that is the
nearest in its cell is *in front* where the scan measured farther, and *behind* where it measured nearer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, invert_rigid, rotate_points, transform_points

_NEAR_M = 0.05


@dataclass(frozen=True)
class RangeImage:
    """Nearest range per occupied cell.

    Attributes:
        cells: (C,) cell numbers, ascending.
        ranges_m: (C,) nearest range in each, metres.
    """

    cells: NDArray[np.int64]
    ranges_m: NDArray[np.float32]

    def at(self, cells: NDArray[np.int64]) -> NDArray[np.float32]:
        """Range at some cells, NaN where nothing was measured."""
        if not len(self.cells):
            return np.full(len(cells), np.nan, np.float32)
        place = np.minimum(np.searchsorted(self.cells, cells), len(self.cells) - 1)
        return np.where(self.cells[place] == cells, self.ranges_m[place], np.nan).astype(np.float32)


def angular_cells(points_camera: NDArray[np.floating], cell_deg: float) -> NDArray[np.int64]:
    """Cell number of the direction of each point, (N, 3) in the camera frame -> (N,)."""
    cell = np.deg2rad(cell_deg)
    azimuth = np.arctan2(points_camera[:, 0], points_camera[:, 2])
    elevation = np.arctan2(points_camera[:, 1], np.hypot(points_camera[:, 0], points_camera[:, 2]))
    columns = int(np.ceil(2 * np.pi / cell)) + 1
    row = np.floor((elevation + np.pi / 2) / cell).astype(np.int64)
    return row * columns + np.floor((azimuth + np.pi) / cell).astype(np.int64)


def scan_image(depth: NDArray[np.float32], camera: PinholeCamera, cell_deg: float) -> RangeImage:
    """Range image of a depth image (h, w) in metres, 0 = no measurement."""
    points = camera.backproject(depth)[depth > 0]
    cells = angular_cells(points, cell_deg)
    found, nearest = _nearest_per_cell(cells, np.linalg.norm(points, axis=1))
    return RangeImage(found, np.linalg.norm(points[nearest], axis=1).astype(np.float32))


def disagreeing_points(
    points_world: NDArray[np.float32],
    candidates: NDArray[np.intp],
    scan: RangeImage,
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
    cell_deg: float,
    difference_m: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Map points in front of, and behind, what a scan measured; only the nearest of each cell is judged.

    Args:
        points_world: (M, 3) metres.
        candidates: numbers of the points that may be in view.
        difference_m: ranges that differ less agree.

    Returns:
        Numbers of the points in front and of those behind.
    """
    points_camera = transform_points(invert_rigid(T_world_camera), points_world[candidates])
    pixels, depth = camera.project(points_camera)
    inside = (depth > _NEAR_M) & (pixels > -0.5).all(axis=1)
    inside &= (pixels[:, 0] < camera.width - 0.5) & (pixels[:, 1] < camera.height - 0.5)
    candidates, points_camera = candidates[inside], points_camera[inside]
    ranges = np.linalg.norm(points_camera, axis=1)
    cells, nearest = _nearest_per_cell(angular_cells(points_camera, cell_deg), ranges)
    measured = scan.at(cells)
    farther = measured - ranges[nearest]  # NaN where nothing was measured: neither
    return candidates[nearest[farther > difference_m]], candidates[nearest[-farther > difference_m]]


def points_in_view(
    points_world: NDArray[np.float32],
    candidates: NDArray[np.intp],
    depth: NDArray[np.float32],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
    slack_m: float,
) -> NDArray[np.intp]:
    """Candidates that project onto a measured pixel with nothing more than ``slack_m`` in front of them."""
    relative = points_world[candidates] - T_world_camera[:3, 3].astype(np.float32)
    pixels, z = camera.project(rotate_points(T_world_camera[:3, :3].T, relative))
    column, row = np.rint(pixels).astype(np.int64).T
    inside = (z > _NEAR_M) & (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    kept = np.flatnonzero(inside)
    measured = depth[row[kept], column[kept]]
    return candidates[kept[(measured > 0) & (measured > z[kept] - slack_m)]]


def _nearest_per_cell(
    cells: NDArray[np.int64], ranges: NDArray[np.floating]
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Occupied cells in ascending order, and the position of the nearest entry of each."""
    order = np.lexsort((ranges, cells))
    found, first = np.unique(cells[order], return_index=True)
    return found, order[first]
