"""Which names in the map can be read: those that do not cover each other from where the camera is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Pixels that a name takes, with some air around it.
NAME_WIDTH_PX, NAME_HEIGHT_PX = 46.0, 20.0


def readable(
    places_world: ArrayLike,
    T_world_camera: NDArray[np.floating],
    fov_rad: float,
    width_px: float,
    height_px: float,
    *,
    taken_px: ArrayLike = (),
    limit: int = 14,
) -> NDArray[np.bool_]:
    """Choose names greedily in the order given (most important first).

    Args:
        places_world: (N, 3) where the names are anchored, metres.
        T_world_camera: (4, 4), OpenCV camera.
        fov_rad: vertical field of view.
        width_px, height_px: size of the view.
        taken_px: (M, 2) further names that are shown anyway, pixels from the view's centre.
        limit: most names at a time.

    Returns:
        (N,) whether to show each.
    """
    places = np.asarray(places_world, np.float64).reshape(-1, 3)
    local = (places - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
    scale = height_px / 2 / np.tan(fov_rad / 2)
    depth = np.maximum(local[:, 2], 1e-6)
    pixels = local[:, :2] / depth[:, None] * scale
    inside = (local[:, 2] > 0.1) & (np.abs(pixels) < [width_px / 2, height_px / 2]).all(axis=1)
    used = [np.asarray(p, np.float64) for p in np.asarray(taken_px, np.float64).reshape(-1, 2)]
    chosen = np.zeros(len(places), bool)
    for index in np.flatnonzero(inside):
        if chosen.sum() >= limit:
            break
        apart = [np.abs(pixels[index] - other) for other in used]
        if any(gap[0] < NAME_WIDTH_PX and gap[1] < NAME_HEIGHT_PX for gap in apart):
            continue
        used.append(pixels[index])
        chosen[index] = True
    return chosen
