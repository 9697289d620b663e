"""Distances that a person measures in the map: points under clicks, and lines between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray

from oasisview.scene.map_points import Rgb

TAPE_RGB: dict[bool, Rgb] = {False: (20, 23, 28), True: (236, 239, 244)}
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Measurement:
    """A straight line between two points of the map.

    Attributes:
        start, end: world, metres.
        up_world: (3,) unit vector against gravity.
    """

    start: Point
    end: Point
    up_world: Point

    @property
    def length_m(self) -> float:
        """The straight distance."""
        return float(np.linalg.norm(np.subtract(self.end, self.start)))

    @property
    def rise_m(self) -> float:
        """How much higher the end is than the start; negative if lower."""
        return float(np.dot(np.subtract(self.end, self.start), self.up_world))

    @property
    def level_m(self) -> float:
        """The distance as seen from above."""
        return float(np.sqrt(max(self.length_m**2 - self.rise_m**2, 0.0)))

    def words(self) -> str:
        """Length, and its level and upright parts where they differ from it."""
        said = exact_length(self.length_m)
        if min(self.level_m, abs(self.rise_m)) < 0.02 * max(self.length_m, 1e-9):
            return said
        turn = "up" if self.rise_m > 0 else "down"
        return f"{said} ({exact_length(self.level_m)} across, {exact_length(abs(self.rise_m))} {turn})"


def exact_length(metres: float) -> str:
    """Tenths of centimetres below one metre, else metres to the centimetre."""
    return f"{metres * 100:.1f} cm" if metres < 1.0 else f"{metres:.2f} m"


def point_on_ray(
    origin: NDArray[np.floating],
    direction: NDArray[np.floating],
    points: NDArray[np.floating],
    radius_m: float,
) -> NDArray[np.float64] | None:
    """The drawn point that a click means: of the frontmost surface the point nearest to the ray.

    Args:
        origin, direction: (3,) of the ray; points: (N, 3); one frame, metres.
        radius_m: how far from the ray a point may lie.

    Returns:
        (3,) a point of ``points``, or None where none is near the ray.
    """
    norm = float(np.linalg.norm(direction))
    if len(points) == 0 or not np.isfinite(norm) or norm < 1e-12:
        return None
    unit = np.asarray(direction, np.float64) / norm
    relative = np.asarray(points, np.float32) - np.asarray(origin, np.float32)
    along = relative @ unit.astype(np.float32)
    across = np.einsum("ij,ij->i", relative, relative) - along * along
    near = np.flatnonzero((along > 0) & (across < radius_m**2))
    if len(near) == 0:
        return None
    front = near[along[near] < along[near].min() + 2 * radius_m]
    return np.asarray(points[front[np.argmin(across[front])]], np.float64)


class TapeMarks:
    """Lines, ends and lengths of one tab's measurements, under ``/map/tape``.

    Args:
        scene: of the tab; origin: of ``/map``, world, metres; point_size_m: of the map's points.
    """

    def __init__(self, scene: viser.SceneApi, origin: NDArray[np.floating], point_size_m: float) -> None:
        self._scene = scene
        self._origin = np.asarray(origin, np.float64)
        self._end_size = float(np.clip(1.3 * point_size_m, 0.015, 0.2))

    def draw(self, measurements: list[Measurement], first: Point | None, *, dark: bool) -> None:
        """Everything anew; ``first`` is a point that has no second one yet."""
        for name in ("lines", "ends"):
            self._remove(f"/map/tape/{name}")
        self._remove("/map/tape/lengths")
        ends = [point for m in measurements for point in (m.start, m.end)] + ([first] if first else [])
        if not ends:
            return
        colour = TAPE_RGB[dark]
        local = np.array(ends, np.float64) - self._origin
        self._scene.add_point_cloud(
            "/map/tape/ends",
            local.astype(np.float32),
            colour,
            point_size=self._end_size,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )
        if not measurements:
            return
        segments = local[: 2 * len(measurements)].reshape(-1, 2, 3)
        self._scene.add_line_segments(
            "/map/tape/lines", segments.astype(np.float32), colour, thickness=3.0, thickness_units="screen"
        )
        self._scene.add_frame("/map/tape/lengths", show_axes=False)
        for number, (measurement, ends_m) in enumerate(zip(measurements, segments, strict=True), start=1):
            self._scene.add_label(
                f"/map/tape/lengths/{number}",
                exact_length(measurement.length_m),
                position=tuple(ends_m.mean(axis=0)),
            )

    def _remove(self, name: str) -> None:
        handle = self._scene.get_handle_by_name(name)
        if handle is not None:
            handle.remove()
