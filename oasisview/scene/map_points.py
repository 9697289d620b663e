"""The points of a result as the browser gets them: thinned once, split so that little has to be resent."""

from __future__ import annotations

import colorsys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from oasisview import palette
from oasisview.heatmap_colours import rgb
from oasisview.scene.level_of_detail import MAX_POINTS, ceiling_height, point_spacing_m, thin
from oasisview.scene.viewpoints import Viewpoint, overview
from pipeline.result import ChangeLabel, Result, SessionResult

Rgb = tuple[int, int, int]
LABEL_RGB: Mapping[bool, Mapping[ChangeLabel, Rgb]] = {
    False: {label: rgb(colour) for label, colour in palette.LIGHT.items()},
    True: {label: rgb(colour) for label, colour in palette.DARK.items()},
}
REPLACED_RGB: Mapping[bool, Rgb] = {False: rgb(palette.REPLACED_LIGHT), True: rgb(palette.REPLACED_DARK)}
OBSTACLE_SAMPLE = 40_000
GROUND_RGB: Mapping[bool, Rgb] = {False: (244, 245, 247), True: (20, 22, 26)}


@dataclass(frozen=True)
class VisitPoints:
    """Points of one visit, split into what recolours (objects) and what never does.

    Attributes:
        background, ceiling: (N, 3) float32 points around ``MapPoints.origin``; *_rgb their true colours.
        objects: (N, 3) float32; objects_rgb true colours; object_ids (N,) int32.
    """

    background: NDArray[np.float32]
    background_rgb: NDArray[np.uint8]
    ceiling: NDArray[np.float32]
    ceiling_rgb: NDArray[np.uint8]
    objects: NDArray[np.float32]
    objects_rgb: NDArray[np.uint8]
    object_ids: NDArray[np.int32]


@dataclass(frozen=True)
class MapPoints:
    """Points of both visits relative to ``origin`` (world, metres), which keeps float32 exact far out.

    ``total_points`` and ``shown_points`` tell how much was thinned away; ``point_size_m`` covers the gaps.
    """

    visits: tuple[VisitPoints, ...]
    origin: NDArray[np.float64]
    up_world: NDArray[np.float64]
    point_size_m: float
    home: Viewpoint
    total_points: int
    shown_points: int

    @property
    def frustum_depth_m(self) -> float:
        """How deep cameras are drawn: in proportion to the map's detail."""
        return float(np.clip(8 * self.point_size_m, 0.12, 1.0))

    def local_pose(self, T_world_camera: NDArray[np.floating]) -> NDArray[np.float64]:
        """A camera pose relative to ``origin``."""
        local = np.array(T_world_camera, np.float64)
        local[:3, 3] -= self.origin
        return local

    def with_objects(self, tables: tuple[NDArray[np.int32], ...]) -> MapPoints:
        """The same points with other object ids: of every visit, the new id by the present one."""
        visits = tuple(
            replace(visit, object_ids=table[visit.object_ids])
            for visit, table in zip(self.visits, tables, strict=True)
        )
        return replace(self, visits=visits)

    def obstacles_world(self, visit: int) -> NDArray[np.float64]:
        """A sample of what can stand before a camera in a visit, (N, 3) world, metres; no ceiling."""
        points = np.concatenate([self.visits[visit].background, self.visits[visit].objects])
        return points[:: max(1, len(points) // OBSTACLE_SAMPLE)].astype(np.float64) + self.origin


def load_map_points(result: Result, max_points: int = MAX_POINTS) -> MapPoints:
    """Read and thin the maps of a result; seconds for many millions of points, so keep it off the loop."""
    sessions = result.sessions[:2]
    total = sum(len(session.points_world) for session in sessions)
    # Half of what may be sent belongs to objects, as far as they need it: they are what is looked at.
    object_counts = [int(np.count_nonzero(np.asarray(session.object_ids) > 0)) for session in sessions]
    object_budget = min(sum(object_counts), max_points // 2)
    object_share = object_budget / max(sum(object_counts), 1)
    rest = total - sum(object_counts)
    rest_share = min(1.0, (max_points - object_budget) / max(rest, 1))
    up = np.asarray(sessions[-1].up_world, np.float64)
    origin = _middle([session.points_world for session in sessions])
    visits = tuple(_load_visit(session, origin, up, object_share, rest_share) for session in sessions)
    drawn = [np.concatenate([visit.background, visit.objects]) for visit in visits]
    largest = max(drawn, key=len)
    home = overview(largest, up)
    return MapPoints(
        visits=visits,
        origin=origin,
        up_world=up,
        point_size_m=float(np.clip(1.5 * point_spacing_m(largest), 0.01, 0.3)),
        home=Viewpoint(_shifted(home.position, origin), _shifted(home.target, origin)),
        total_points=total,
        shown_points=sum(len(v.background) + len(v.ceiling) + len(v.objects) for v in visits),
    )


def _middle(clouds: list[NDArray[np.float32]]) -> NDArray[np.float64]:
    """A round place in the middle of all points."""
    means = [np.mean(points[:: max(1, len(points) // 5000)], axis=0) for points in clouds if len(points)]
    return np.asarray(np.round(np.mean(means, axis=0)) if means else np.zeros(3), np.float64)


def _shifted(point: tuple[float, float, float], by: NDArray[np.floating]) -> tuple[float, float, float]:
    return (float(point[0] + by[0]), float(point[1] + by[1]), float(point[2] + by[2]))


def _load_visit(
    session: SessionResult,
    origin: NDArray[np.float64],
    up: NDArray[np.float64],
    object_share: float,
    rest_share: float,
) -> VisitPoints:
    points = (np.asarray(session.points_world, np.float64) - origin).astype(np.float32)
    colours, ids = np.asarray(session.colours), np.asarray(session.object_ids)
    on_object = np.flatnonzero(ids > 0)
    rest = np.flatnonzero(ids <= 0)
    on_object = on_object[thin(points[on_object], round(object_share * len(on_object)))]
    rest = rest[thin(points[rest], round(rest_share * len(rest)))]
    cameras = np.array([k.T_world_camera[:3, 3] for k in session.keyframes]).reshape(-1, 3) - origin
    ceiling = ceiling_height(points[rest] @ up.astype(np.float32), cameras @ up)
    above = np.zeros(len(rest), bool) if ceiling is None else points[rest] @ up.astype(np.float32) > ceiling
    low, high = rest[~above], rest[above]
    return VisitPoints(
        points[low], colours[low], points[high], colours[high], points[on_object], colours[on_object],
        ids[on_object].astype(np.int32),
    )  # fmt: skip


def identity_rgb(object_id: int) -> Rgb:
    """A colour of an object's own, the same in every visit; neighbours in number differ most."""
    hue = (object_id * 0.6180339887) % 1.0
    lightness = (0.45, 0.58, 0.38)[object_id % 3]
    red, green, blue = colorsys.hls_to_rgb(hue, lightness, 0.75)
    return round(255 * red), round(255 * green), round(255 * blue)


def muted(colours: NDArray[np.uint8], *, dark: bool) -> NDArray[np.uint8]:
    """True colours, paled towards the page so that changes stand out."""
    values = colours.astype(np.float32)
    grey = values.mean(axis=1, keepdims=True)
    towards = 40.0 if dark else 228.0
    return np.round((0.35 * values + 0.65 * grey) * 0.55 + towards * 0.45).astype(np.uint8)


def object_colours(
    colours_rgb: NDArray[np.uint8],
    object_ids: NDArray[np.int32],
    mode: str,
    label_of: Callable[[int], ChangeLabel | None],
    label_rgb: Mapping[ChangeLabel, Rgb],
    *,
    dark: bool,
    pale: NDArray[np.uint8] | None = None,
) -> NDArray[np.uint8]:
    """Colours of object points, (N, 3), for the mode ``label``, ``identity`` or ``true``.

    What has no label is painted like background. ``pale`` is ``muted`` of the colours, if known already.
    """
    if mode == "true" or len(object_ids) == 0:
        return colours_rgb
    known = np.unique(object_ids)
    paint = np.zeros((len(known), 3), np.float32)
    strength = np.full((len(known), 1), 0.8, np.float32)
    for row, object_id in enumerate(known):
        if object_id == 0:  # people said that it is no object
            strength[row] = 0.0
            continue
        if mode == "identity":
            paint[row] = identity_rgb(int(object_id))
            continue
        label = label_of(int(object_id))
        if label is None:
            strength[row] = 0.0
            continue
        paint[row] = label_rgb[label]
        if label is ChangeLabel.STATIC:
            strength[row] = 0.5
    index = np.searchsorted(known, object_ids)
    base = (muted(colours_rgb, dark=dark) if pale is None else pale).astype(np.float32)
    mixed = base * (1 - strength[index]) + paint[index] * strength[index]
    return np.round(mixed).astype(np.uint8)
