"""Projecting the points of a surface into an image: which of them is seen at each pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, rotate_points

_NEAR_M = 0.05
# A point stands for its pixel and the eight around it, so that a surface has no holes between its points.
_FOOTPRINT = tuple((dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1))


def visible_points(
    points_world: NDArray[np.float32],
    candidates: NDArray[np.integer],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
) -> NDArray[np.int32]:
    """The nearest point at every pixel.

    Args:
        points_world: (M, 3) metres.
        candidates: numbers of the points that may be in view.

    Returns:
        (height, width) point numbers, -1 = none.
    """
    relative = points_world[candidates] - T_world_camera[:3, 3].astype(np.float32)
    pixels, depth = camera.project(rotate_points(T_world_camera[:3, :3].T, relative))
    inside = (depth > _NEAR_M) & (pixels > -1.5).all(axis=1)
    inside &= (pixels[:, 0] < camera.width + 0.5) & (pixels[:, 1] < camera.height + 0.5)
    kept = np.flatnonzero(inside)
    # Written from far to near, so that the nearest point stays.
    kept = kept[np.argsort(-depth[kept], kind="stable")]
    column, row = np.rint(pixels[kept]).astype(np.int64).T
    # One pixel of margin takes the footprints of points at the rim.
    image = np.full((camera.height + 4, camera.width + 4), -1, np.int32)
    rows = np.stack([row + dy for dy, _ in _FOOTPRINT], axis=1).reshape(-1) + 2
    columns = np.stack([column + dx for _, dx in _FOOTPRINT], axis=1).reshape(-1) + 2
    image[rows, columns] = np.repeat(candidates[kept].astype(np.int32), len(_FOOTPRINT))
    return image[2:-2, 2:-2]
