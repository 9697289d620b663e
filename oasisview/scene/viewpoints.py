"""Where the camera goes: the whole site, an object, a keyframe. World positions in metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Viewpoint:
    """A camera position and the point it looks at, both (3,) world, metres."""

    position: tuple[float, float, float]
    target: tuple[float, float, float]


def _viewpoint(position: NDArray[np.floating], target: NDArray[np.floating]) -> Viewpoint:
    return Viewpoint(
        (float(position[0]), float(position[1]), float(position[2])),
        (float(target[0]), float(target[1]), float(target[2])),
    )


def horizontal_axes(up_world: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit vectors that span the ground."""
    up = np.asarray(up_world, np.float64)
    seed = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = np.cross(up, seed)
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)


def overview(points_world: NDArray[np.floating], up_world: NDArray[np.floating]) -> Viewpoint:
    """The whole map from a corner above it."""
    if len(points_world) == 0:
        return _viewpoint(np.array([2.0, 2.0, 2.0]), np.zeros(3))
    up = np.asarray(up_world, np.float64)
    right, forward = horizontal_axes(up)
    axes = np.stack([right, forward, up])
    sample = np.asarray(points_world[:: max(1, len(points_world) // 20000)], np.float64) @ axes.T
    low, high = np.percentile(sample, 6, axis=0), np.percentile(sample, 94, axis=0)
    centre = (low + high) / 2
    reach = max(float(np.linalg.norm((high - low)[:2])), 0.5)
    position = centre + np.array([-0.38, -0.56, 0.74]) * reach * 0.85
    return _viewpoint(position @ axes, centre @ axes)


def towards_object(
    low: ArrayLike,
    high: ArrayLike,
    up_world: NDArray[np.floating],
    seen_from: ArrayLike,
    other_place: ArrayLike | None = None,
) -> Viewpoint:
    """An object from above and from the side it was recorded from; both places if it moved.

    Args:
        low, high: (3,) bounds, metres.
        up_world: (3,) unit vector.
        seen_from: (3,) camera centre of its best keyframe: that side is in the map.
        other_place: (3,) centroid at the other visit; far places are left out of the view.
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    up = np.asarray(up_world, np.float64)
    centre = (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, 0.25)
    if other_place is not None:
        apart = float(np.linalg.norm(np.asarray(other_place) - centre))
        if apart < 6.0:
            centre = (centre + np.asarray(other_place)) / 2
            radius = max(radius, 0.75 * apart)
    offset = np.asarray(seen_from, np.float64) - centre
    rise = float(offset @ up)
    level = offset - rise * up
    level_length = float(np.linalg.norm(level))
    if level_length < 1e-6:
        level, level_length = horizontal_axes(up)[0], 1.0
    direction = level / level_length + up * float(np.clip(rise / level_length, 0.55, 1.2))
    direction /= np.linalg.norm(direction)
    return _viewpoint(centre + direction * max(3.2 * radius, 1.2), centre)


def at_keyframe(T_world_camera: NDArray[np.floating], back_off_m: float = 0.0) -> Viewpoint:
    """Where a keyframe was taken from, looking where it looked; optionally some steps back."""
    T = np.asarray(T_world_camera, np.float64)
    forward = T[:3, 2]
    position = T[:3, 3] - forward * back_off_m
    return _viewpoint(position, position + forward * (1.5 + back_off_m))
