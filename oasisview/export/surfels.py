"""Points as small flat squares along the surface: a mesh that any viewer shades, and that invents nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

NEIGHBOURS = 12  # that a point's surface direction is taken from
OVERLAP = 0.75  # half a square's side, in cells: squares of neighbouring cells just overlap


def thinned(points: NDArray[np.floating], cell_m: float) -> NDArray[np.float64]:
    """The mean of the points in each cell of a grid, (M, 3); also evens out the noise of the depth."""
    if len(points) == 0:
        return np.zeros((0, 3))
    points = np.asarray(points, np.float64)
    cells = np.floor((points - points.min(axis=0)) / cell_m).astype(np.int64)
    _, inverse, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(inverse.ravel(), points[:, axis]) for axis in range(3)], axis=1)
    return sums / counts[:, None]


def surface_directions(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals (N, 3) of the planes through each point's neighbours; their sign means nothing."""
    count = len(points)
    if count < 3:
        return np.tile([0.0, 0.0, 1.0], (count, 1))
    _, near = cKDTree(points).query(points, k=min(NEIGHBOURS, count))
    around = points[near] - points[near].mean(axis=1, keepdims=True)
    spread = np.einsum("nki,nkj->nij", around, around)
    return np.linalg.eigh(spread)[1][:, :, 0]


def squares(
    points: NDArray[np.float64], normals: NDArray[np.float64], half_side_m: float
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Vertices (4N, 3) and triangles (2N, 3) of one square per point, level side along the horizon."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    along = np.cross(helper, normals)
    along *= half_side_m / np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normals, along)
    corners = np.stack(
        [
            points - along - across,
            points + along - across,
            points + along + across,
            points - along + across,
        ],
        axis=1,
    )
    triangles = 4 * np.arange(len(points))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return corners.reshape(-1, 3).astype(np.float32), triangles.reshape(-1, 3)
