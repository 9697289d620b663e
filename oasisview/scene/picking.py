"""Which object a click in the map means: the frontmost point along the ray, not the frontmost box.

The browser only reports clicks on meshes, so invisible boxes catch them; boxes nest (a carton in a
shelf), so what was meant is decided here, against the points that are drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class RayHit:
    """The frontmost point near a ray: distance along it in metres, and the object of the point."""

    distance_m: float
    object_id: int


def first_hit(
    origin: NDArray[np.floating],
    direction: NDArray[np.floating],
    points_world: NDArray[np.floating],
    object_ids: NDArray[np.integer],
    radius_m: float,
) -> RayHit | None:
    """The point nearest to the ray's origin among those within ``radius_m`` of the ray.

    Args:
        origin, direction: (3,) of the ray, world; the direction needs no unit length.
        points_world: (N, 3) metres; object_ids: (N,) of each point.
        radius_m: how far from the ray a point may lie.

    Returns:
        The hit, or None where no point is near the ray or the ray has no direction.
    """
    if len(points_world) == 0:
        return None
    norm = float(np.linalg.norm(direction))
    if not np.isfinite(norm) or norm < 1e-12:
        return None
    unit = (np.asarray(direction, np.float64) / norm).astype(np.float32)
    relative = np.asarray(points_world, np.float32) - np.asarray(origin, np.float32)
    along = relative @ unit
    across_squared = np.einsum("ij,ij->i", relative, relative) - along * along
    near = np.flatnonzero((along > 0) & (across_squared < radius_m * radius_m))
    if len(near) == 0:
        return None
    best = near[np.argmin(along[near])]
    return RayHit(float(along[best]), int(object_ids[best]))


def pick_object(
    origin: NDArray[np.floating],
    direction: NDArray[np.floating],
    object_points: NDArray[np.floating],
    object_ids: NDArray[np.integer],
    background_points: NDArray[np.floating],
    *,
    radius_m: float,
    point_size_m: float,
) -> int | None:
    """The object that a click means, or None where the click meets background or nothing.

    Objects are given the wider radius: people aim at an object's middle, where points may be sparse.
    Background only counts where a drawn point really covers the click.
    """
    hit = first_hit(origin, direction, object_points, object_ids, radius_m)
    if hit is None:
        return None
    zeros = np.zeros(len(background_points), np.int32)
    wall = first_hit(origin, direction, background_points, zeros, point_size_m / 2)
    if wall is not None and wall.distance_m < hit.distance_m - 2 * radius_m:
        return None
    return hit.object_id
