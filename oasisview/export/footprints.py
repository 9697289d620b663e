"""The ground that each object stands on, as an outline seen from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from oasisview.export.exporter import ReviewedResult, Steps
from oasisview.export.object_points import object_parts
from oasisview.scene.ground_plan import GroundPlan

LEAST_SIDE_M = 0.01  # of the footprint of what has no area: a wire, a single point


@dataclass(frozen=True)
class Footprint:
    """The ground below an object on one visit.

    Attributes:
        polygon_m: (M, 2) convex outline on the plan's axes, counter-clockwise seen from above, not closed.
        base_m, top_m: lowest and highest point along up, world, metres.
    """

    polygon_m: NDArray[np.float64]
    base_m: float
    top_m: float


def footprints(
    reviewed: ReviewedResult, plan: GroundPlan, steps: Steps | None = None
) -> dict[tuple[int, int], Footprint]:
    """Footprint of every sighting by (object id, visit); of its bounds where the map has no point of it."""
    outlines: dict[tuple[int, int], NDArray[np.float64]] = {}
    heights: dict[tuple[int, int], tuple[float, float]] = {}
    for (session_index, object_id), part in object_parts(reviewed, steps):
        key, points = (object_id, session_index), plan.project(part)
        earlier = outlines.get(key, np.zeros((0, 2)))
        outlines[key] = _outline(np.concatenate([earlier, points[:, :2]]))
        low, high = heights.get(key, (np.inf, -np.inf))
        heights[key] = (min(low, float(points[:, 2].min())), max(high, float(points[:, 2].max())))
    found_footprints = {key: Footprint(outline, *heights[key]) for key, outline in outlines.items()}
    for item in reviewed.objects:
        for sighting in item.sightings:
            key = (item.object_id, sighting.session)
            if key not in found_footprints:
                corners = plan.project(_corners(sighting.box_min_world_m, sighting.box_max_world_m))
                low, high = corners[:, 2].min(), corners[:, 2].max()
                found_footprints[key] = Footprint(_outline(corners[:, :2]), float(low), float(high))
    return found_footprints


def _outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convex hull, counter-clockwise; a small rectangle where the points span no area."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):  # fewer than three points, or all on one line
        low, high = points.min(axis=0), points.max(axis=0)
        missing = np.maximum(LEAST_SIDE_M - (high - low), 0.0) / 2
        (left, bottom), (right, top) = low - missing, high + missing
        return np.array([[left, bottom], [right, bottom], [right, top], [left, top]])


def _corners(low: tuple[float, float, float], high: tuple[float, float, float]) -> NDArray[np.float64]:
    sides = np.array([low, high], np.float64)
    return np.array([[sides[i, 0], sides[j, 1], sides[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
