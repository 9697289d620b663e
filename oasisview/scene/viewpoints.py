"""Where the camera goes: the whole site, an object, a keyframe. World positions in metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

BOTH_PLACES_M = 3.5  # farther apart, both ends of a move make a view in which neither can be made out
CLEARANCE_M = 0.3  # a camera this close behind a wall still has it before its eye
CLEAR_BELOW = 0.15  # share of the view that may be hidden without looking for another side
VIEW_HALF_WIDTH = 0.25  # tangent; the middle of the view, where the target is
# Degrees around the target, and least degrees above the ground, from the least detour on.
_TURNS = (
    (0, 0), (0, 45), (30, 0), (-30, 0), (30, 45), (-30, 45), (65, 0), (-65, 0), (0, 62), (65, 45), (-65, 45),
    (110, 30), (-110, 30), (180, 30), (110, 60), (-110, 60), (180, 60), (0, 78),
)  # fmt: skip


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
        if apart < BOTH_PLACES_M:
            centre = (centre + np.asarray(other_place)) / 2
            radius = max(radius, 0.6 * apart)
    offset = np.asarray(seen_from, np.float64) - centre
    rise = float(offset @ up)
    level = offset - rise * up
    level_length = float(np.linalg.norm(level))
    if level_length < 1e-6:
        level, level_length = horizontal_axes(up)[0], 1.0
    direction = level / level_length + up * float(np.clip(rise / level_length, 0.55, 1.2))
    direction /= np.linalg.norm(direction)
    return _viewpoint(centre + direction * max(3.2 * radius, 1.2), centre)


def clear_of(
    wanted: Viewpoint, obstacles_world: NDArray[np.floating], up_world: NDArray[np.floating], near_m: float
) -> Viewpoint:
    """The same target from the nearest side from which nothing stands in between: walls hide rooms.

    Args:
        obstacles_world: (N, 3) points of the map; a sample of some 10,000 is enough.
        near_m: what is closer to the target than this belongs to it and hides nothing.

    Returns:
        The wanted viewpoint itself where it is clear, else one turned around the target or above it.
    """
    target = np.asarray(wanted.target, np.float64)
    offset = np.asarray(wanted.position, np.float64) - target
    distance = float(np.linalg.norm(offset))
    around = np.asarray(obstacles_world, np.float64) - target
    around = around[np.linalg.norm(around, axis=1) < distance + CLEARANCE_M]
    if distance < 1e-6 or len(around) == 0:
        return wanted
    up = np.asarray(up_world, np.float64)
    rise = float(offset @ up) / distance
    level = offset / distance - rise * up
    level_length = float(np.linalg.norm(level))
    level = level / level_length if level_length > 1e-6 else horizontal_axes(up)[0]
    side = np.cross(up, level)
    usual = float(np.arctan2(rise, level_length))
    best, least = wanted, np.inf
    for turn, elevation in _TURNS:
        steep = max(usual, np.radians(elevation))
        flat = np.cos(np.radians(turn)) * level + np.sin(np.radians(turn)) * side
        direction = np.cos(steep) * flat + np.sin(steep) * up
        hidden = _hidden_share(around, direction, up, distance, near_m)
        if hidden < least - 0.1:
            found = _viewpoint(target + direction * distance, target)
            best, least = (wanted if (turn, elevation) == _TURNS[0] else found), hidden
        if hidden <= CLEAR_BELOW:
            break
    return best


def _hidden_share(
    around: NDArray[np.float64],
    direction: NDArray[np.float64],
    up: NDArray[np.float64],
    distance: float,
    near_m: float,
) -> float:
    """How much of the middle of the view is taken by points before the target, in [0, 1]."""
    depth = distance - around @ direction  # from the camera, along its view
    before = (depth > -CLEARANCE_M) & (depth < distance - near_m)
    points, depth = around[before], np.maximum(depth[before], 0.05)
    right = np.cross(up, direction)
    right = right / max(float(np.linalg.norm(right)), 1e-9)
    cells = 6
    across = np.stack([points @ right, points @ np.cross(direction, right)], axis=1) / depth[:, None]
    cell = np.floor((across / VIEW_HALF_WIDTH + 1) / 2 * cells).astype(int)
    seen = cell[((cell >= 0) & (cell < cells)).all(axis=1)]
    return len(np.unique(seen @ [cells, 1])) / cells**2


def at_keyframe(T_world_camera: NDArray[np.floating], back_off_m: float = 0.0) -> Viewpoint:
    """Where a keyframe was taken from, looking where it looked; optionally some steps back."""
    T = np.asarray(T_world_camera, np.float64)
    forward = T[:3, 2]
    position = T[:3, 3] - forward * back_off_m
    return _viewpoint(position, position + forward * (1.5 + back_off_m))
