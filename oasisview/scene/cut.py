"""A box that the map is cut to: what is inside stays, what is outside is not drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from oasisview.scene.ground_plan import GroundPlan
from oasisview.scene.map_points import MapPoints, VisitPoints
from pipeline.result import Result

AXES = ("x", "y", "height")
FACES = tuple(f"{axis}_{end}" for axis in AXES for end in ("low", "high"))
STEP_M = 0.05
_SAMPLE = 100_000


@dataclass(frozen=True)
class CutFrame:
    """What a map can be cut along: level axes and height, and how far it reaches.

    Attributes:
        axes_world: (3, 3) rows x, y, up as unit vectors of the world.
        origin_world: (3,) where drawn points count from, metres.
        low_m, high_m: (3,) reach along the axes, world, metres; height counts from ``floor_m``.
        floor_m: height of the lowest part of the map along up, world.
    """

    axes_world: NDArray[np.float64]
    origin_world: NDArray[np.float64]
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]
    floor_m: float

    @classmethod
    def of(cls, result: Result, points: MapPoints) -> CutFrame:
        """The frame of a map; stray points beyond its reach do not count."""
        axes = GroundPlan.of(result).axes_world
        drawn = [p for visit in points.visits for p in (visit.background, visit.ceiling, visit.objects)]
        sample = [p[:: max(1, len(p) // _SAMPLE)] for p in drawn if len(p)]
        if not sample:
            return cls(axes, points.origin, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0)
        along = (np.concatenate(sample) + points.origin) @ axes.T
        low, high = np.percentile(along, [0.3, 99.7], axis=0)
        floor = float(low[2])
        low[2], high[2] = 0.0, high[2] - floor
        low = np.floor(low / STEP_M) * STEP_M
        high = np.maximum(np.ceil(high / STEP_M) * STEP_M, low + STEP_M)
        return cls(axes, points.origin, _triple(low), _triple(high), floor)

    def whole(self) -> CutBox:
        """The box that cuts nothing away."""
        return CutBox(self, self.low_m, self.high_m)

    def around(self, low_world: NDArray[np.floating], high_world: NDArray[np.floating]) -> CutBox:
        """The box around world bounds with some surroundings."""
        low, high = np.asarray(low_world, np.float64), np.asarray(high_world, np.float64)
        margin = max(0.3, 0.5 * float(np.linalg.norm(high - low)))
        along = _corners(np.array([low, high])) @ self.axes_world.T - [0, 0, self.floor_m]
        return CutBox(
            self,
            _triple(np.clip(along.min(axis=0) - margin, self.low_m, self.high_m)),
            _triple(np.clip(along.max(axis=0) + margin, self.low_m, self.high_m)),
        )


@dataclass(frozen=True)
class CutBox:
    """The part of a map that stays; a side at the end of its reach cuts nothing."""

    frame: CutFrame
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]

    def moved(self, face: str, value_m: float) -> CutBox:
        """A copy with one side elsewhere; the opposite side gives way. ``ValueError`` for no such side."""
        axis_name, _, end = face.rpartition("_")
        if face not in FACES:
            raise ValueError(f"a box has no side {face!r}")
        axis = AXES.index(axis_name)
        low, high = list(self.low_m), list(self.high_m)
        value = float(np.clip(value_m, self.frame.low_m[axis], self.frame.high_m[axis]))
        if end == "low":
            low[axis] = min(value, self.frame.high_m[axis] - STEP_M)
            high[axis] = max(high[axis], low[axis] + STEP_M)
        else:
            high[axis] = max(value, self.frame.low_m[axis] + STEP_M)
            low[axis] = min(low[axis], high[axis] - STEP_M)
        return replace(self, low_m=_triple(low), high_m=_triple(high))

    @property
    def is_whole(self) -> bool:
        """Whether nothing is cut away."""
        return self.low_m == self.frame.low_m and self.high_m == self.frame.high_m

    def holds(self, points_world: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Which of (N, 3) world points stay."""
        return self._holds(np.asarray(points_world, np.float64) - self.frame.origin_world)

    def cut(self, visit: VisitPoints) -> VisitPoints:
        """The points of a visit that stay."""
        background, ceiling, objects = map(self._holds, (visit.background, visit.ceiling, visit.objects))
        return VisitPoints(
            visit.background[background], visit.background_rgb[background],
            visit.ceiling[ceiling], visit.ceiling_rgb[ceiling],
            visit.objects[objects], visit.objects_rgb[objects], visit.object_ids[objects],
        )  # fmt: skip

    def _holds(self, points: NDArray[np.floating]) -> NDArray[np.bool_]:
        """As :meth:`holds`, for points that count from ``origin_world`` as drawn ones do."""
        frame = self.frame
        shift = frame.axes_world @ frame.origin_world - [0.0, 0.0, frame.floor_m]
        inside = np.ones(len(points), bool)
        for axis in range(3):
            at_low = np.isclose(self.low_m[axis], frame.low_m[axis])
            at_high = np.isclose(self.high_m[axis], frame.high_m[axis])
            if at_low and at_high:
                continue
            along = points @ frame.axes_world[axis].astype(points.dtype)
            if not at_low:
                inside &= along >= self.low_m[axis] - shift[axis]
            if not at_high:
                inside &= along <= self.high_m[axis] - shift[axis]
        return inside

    def corners_world(self) -> NDArray[np.float64]:
        """(8, 3) corners, in the order of ``outlines.box_corners``."""
        above_floor = np.array([0.0, 0.0, self.frame.floor_m])
        return _corners(np.array([self.low_m, self.high_m]) + above_floor) @ self.frame.axes_world


def _corners(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """(8, 3) corners between the low and the high end (2, 3) of three axes."""
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def _triple(values: NDArray[np.floating] | list[float]) -> tuple[float, float, float]:
    return (round(float(values[0]), 4), round(float(values[1]), 4), round(float(values[2]), 4))
