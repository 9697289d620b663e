"""The place from above: world points on a level plane, and the ground that each object stands on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from oasisview.export.exporter import ReviewedResult, Steps
from oasisview.export.object_points import object_parts
from oasisview.scene.viewpoints import horizontal_axes
from pipeline.result import Result

LEVEL_COSINE = np.cos(np.radians(15))  # robots' z axes lean that much at most: then x and y are kept
LEAST_SIDE_M = 0.01  # of the footprint of what has no area: a wire, a single point


@dataclass(frozen=True)
class GroundPlan:
    """Two level axes and one against gravity.

    Attributes:
        axes_world: (3, 3) rows east-like, north-like, up; right-handed unit vectors of the world frame.
        names: what the three axes are in terms of the world frame.
    """

    axes_world: NDArray[np.float64]
    names: tuple[str, str, str]

    @classmethod
    def of(cls, result: Result) -> GroundPlan:
        """World x and y where the world's z axis stands about upright, else level axes of our own."""
        up = np.asarray(result.sessions[-1].up_world, np.float64)
        if up[2] >= LEVEL_COSINE:
            return cls(np.eye(3), ("world x", "world y", "world z"))
        return cls(np.stack([*horizontal_axes(up), up]), ("level u", "level v", "up"))

    @property
    def is_world(self) -> bool:
        """Whether the plan's axes are those of the world frame."""
        return bool(np.array_equal(self.axes_world, np.eye(3)))

    def project(self, points_world: NDArray[np.floating]) -> NDArray[np.float64]:
        """(N, 3) or (3,) world points along the plan's axes, metres; the last column is height."""
        return np.asarray(points_world, np.float64) @ self.axes_world.T


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
