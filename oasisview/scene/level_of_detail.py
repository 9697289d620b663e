"""How much of a map is sent to the browser: maps of any size open, objects keep their detail."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

# A browser on a laptop without a graphics card still turns this many points around.
MAX_POINTS = 1_500_000


def thin(points_world: NDArray[np.floating], max_points: int) -> NDArray[np.int64]:
    """Indices of one point per voxel, with the voxel grown until at most ``max_points`` remain.

    Ascending, deterministic, and evenly spread: dense surfaces lose most, thin ones stay visible.
    """
    count = len(points_world)
    if count <= max_points:
        return np.arange(count, dtype=np.int64)
    if max_points <= 0:
        return np.zeros(0, np.int64)
    low = points_world.min(axis=0).astype(np.float64)
    extent = float(np.max(points_world.max(axis=0) - low)) or 1.0
    # Surfaces fill about (extent / voxel)^2 voxels of a cube: a first guess that the loop corrects.
    voxel = extent / max(np.sqrt(max_points), 1.0) / 4
    kept = np.arange(count, dtype=np.int64)
    while True:
        cells = np.floor((points_world[kept] - low) / voxel).astype(np.int64)
        keys = (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]
        # Each round only looks at what the one before left: the sort over all points happens once.
        kept = kept[np.unique(keys, return_index=True)[1]]
        if len(kept) <= max_points:
            return np.sort(kept)
        voxel *= max(1.1, float(np.sqrt(len(kept) / max_points)))


def point_spacing_m(points_world: NDArray[np.floating], samples: int = 2000) -> float:
    """Typical distance between neighbouring points, metres: what a drawn point has to cover."""
    if len(points_world) < 2:
        return 0.02
    step = max(1, len(points_world) // samples)
    tree = cKDTree(points_world)
    distances = tree.query(points_world[::step], k=2)[0][:, 1]
    return float(np.median(distances)) or 0.02


def ceiling_height(
    heights: NDArray[np.floating], camera_heights: NDArray[np.floating], *, share: float = 0.04
) -> float | None:
    """Height above which a map is a ceiling, so that rooms can be looked into from above.

    Args:
        heights: (N,) of the points along the up direction, metres.
        camera_heights: (K,) of the cameras on the same axis.
        share: part of all points that one 10 cm layer must hold to be a ceiling.

    Returns:
        The height just below the lowest such layer above every camera, or None (no ceiling).
    """
    if len(heights) == 0 or len(camera_heights) == 0:
        return None
    start = float(np.max(camera_heights)) + 0.1
    above = heights[heights > start]
    if len(above) < share * len(heights):
        return None
    bins = np.floor((above - start) / 0.1).astype(np.int64)
    counts = np.bincount(np.minimum(bins, 100))
    layers = np.flatnonzero(counts >= share * len(heights))
    return None if len(layers) == 0 else start + 0.1 * float(layers[0]) - 0.05
