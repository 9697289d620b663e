"""The shape of a tunnel, and where things stand, hang and sit in it: walls, floor, pipes, crown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.synthetic.world import Pose

SPRING_M = 0.55  # height at which the vault begins
BOWL_M = 0.95  # from there down to the deepest point of the floor


@dataclass(frozen=True)
class Bore:
    """A tunnel along an arc: cross-sections of half an ellipse over a bowl.

    Attributes:
        radius_m: of the arc of its centre line in plan.
        length_m: along that arc.
        half_width_m: where the vault begins.
        rise_m: of the vault above that.
        climb: rise of the centre line per metre.
    """

    radius_m: float
    length_m: float
    half_width_m: float
    rise_m: float
    climb: float

    def frame(self, s: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Point of the centre line at ``s`` metres, and unit vectors ahead and to the left, each (3,)."""
        turn = s / self.radius_m
        centre = np.array(
            [self.radius_m * np.sin(turn), self.radius_m * (1 - np.cos(turn)), self.climb * s], dtype=float
        )
        ahead = np.array([np.cos(turn), np.sin(turn), self.climb])
        return centre, ahead / np.linalg.norm(ahead), np.array([-np.sin(turn), np.cos(turn), 0.0])

    def section(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2) left and up of points of the vault, ``angle`` 0 = left spring line ... pi = right one."""
        return np.stack([self.half_width_m * np.cos(angle), SPRING_M + self.rise_m * np.sin(angle)], axis=1)

    def floor(self, left: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the floor at ``left`` metres from the middle."""
        return SPRING_M - BOWL_M + BOWL_M * np.abs(left / self.half_width_m) ** 2.5

    def at(self, s: float, left: float, up: float) -> NDArray[np.float64]:
        """(3,) world point."""
        centre, _, side = self.frame(s)
        return centre + left * side + np.array([0, 0, up])

    def sweep(
        self, section: NDArray[np.float64], steps: int, start: float, end: float
    ) -> NDArray[np.float64]:
        """(steps, N, 3) a cross-section (N, 2) carried along the centre line."""
        return np.array([[self.at(s, *point) for point in section] for s in np.linspace(start, end, steps)])


def upright_axes(
    x: NDArray[np.float64], z: NDArray[np.float64], origin: NDArray[np.float64], yaw: float
) -> Pose:
    """A pose with z as given, x as near to the given one as it can be, then turned about z."""
    z = z / np.linalg.norm(z)
    y = np.cross(z, x)
    y /= np.linalg.norm(y)
    x = np.cross(y, z)
    T = np.eye(4)
    c, s = np.cos(yaw), np.sin(yaw)
    T[:3, 0], T[:3, 1], T[:3, 2] = c * x + s * y, -s * x + c * y, z
    T[:3, 3] = origin
    return T


@dataclass(frozen=True)
class Wall:
    """A band of the vault: u runs along the tunnel, v up the wall; things face inwards, upright."""

    bore: Bore
    side: int  # 1 = left, -1 = right
    angles: tuple[float, float]
    group: str = "wall"
    turns: bool = False

    def _angle(self, v: float) -> float:
        return self.angles[0] + v / self.bore.rise_m

    def pose(self, u: float, v: float, yaw: float) -> Pose:
        """See ``Support``."""
        angle = self._angle(v)
        _, ahead, left = self.bore.frame(u)
        across, up = self.bore.section(np.array([angle]))[0]
        # Inwards: against the gradient of the ellipse.
        slope = np.array([np.cos(angle) / self.bore.half_width_m, np.sin(angle) / self.bore.rise_m])
        inward = -(self.side * slope[0] * left + np.array([0, 0, slope[1]]))
        origin = self.bore.at(u, self.side * across, up)
        return upright_axes(self.side * ahead, inward, origin, yaw)

    def holds(self, u: float, v: float) -> bool:
        """See ``Support``."""
        return 0.5 < u < self.bore.length_m - 0.5 and self.angles[0] <= self._angle(v) <= self.angles[1]

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """See ``Support``."""
        reach = (self.angles[1] - self.angles[0]) * self.bore.rise_m
        return float(rng.uniform(0.6, self.bore.length_m - 0.6)), float(rng.uniform(0, reach)), 0.0


@dataclass(frozen=True)
class Bowl:
    """The floor beside the walkway: things lean as it slopes."""

    bore: Bore
    side: int
    group: str = "floor"
    turns: bool = True

    def pose(self, u: float, v: float, yaw: float) -> Pose:
        """See ``Support``; v is the distance from the middle of the tunnel."""
        left = self.side * v
        slope = float(np.diff(self.bore.floor(np.array([left - 0.02, left + 0.02])))[0] / 0.04)
        _, ahead, side = self.bore.frame(u)
        height = float(self.bore.floor(np.array(left)))
        return upright_axes(ahead, np.array([0, 0, 1.0]) - slope * side, self.bore.at(u, left, height), yaw)

    def holds(self, u: float, v: float) -> bool:
        """See ``Support``."""
        return 0.4 < u < self.bore.length_m - 0.4 and 0.62 < v < 0.62 * self.bore.half_width_m

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """See ``Support``."""
        u, v = (
            rng.uniform(0.5, self.bore.length_m - 0.5),
            rng.uniform(0.65, 0.61 * self.bore.half_width_m),
        )
        return float(u), float(v), float(rng.uniform(-np.pi, np.pi))


@dataclass(frozen=True)
class Pipe:
    """A pipe along the tunnel: things sit around it, their z to the inside and upwards."""

    bore: Bore
    left: float
    up: float
    radius_m: float
    group: str = ""
    turns: bool = False

    def path(self, steps: int) -> NDArray[np.float64]:
        """(steps, 3) its axis."""
        return self.bore.sweep(np.array([[self.left, self.up]]), steps, 0.0, self.bore.length_m)[:, 0]

    def pose(self, u: float, v: float, yaw: float) -> Pose:
        """See ``Support``; v is not used."""
        _, ahead, left = self.bore.frame(u)
        outward = np.array([0, 0, 0.6]) - np.sign(self.left) * left
        return upright_axes(ahead, outward, self.bore.at(u, self.left, self.up), yaw)

    def holds(self, u: float, v: float) -> bool:
        """See ``Support``."""
        return 0.5 < u < self.bore.length_m - 0.5

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """See ``Support``."""
        return float(rng.uniform(0.6, self.bore.length_m - 0.6)), 0.0, float(rng.integers(2) * np.pi)


@dataclass(frozen=True)
class Crown:
    """Hooks along the top of the vault: things hang from it."""

    bore: Bore
    group: str = "crown"
    turns: bool = True

    def pose(self, u: float, v: float, yaw: float) -> Pose:
        """See ``Support``; v is the distance to the left of the middle."""
        _, ahead, _ = self.bore.frame(u)
        level = np.array([ahead[0], ahead[1], 0.0])
        up = SPRING_M + self.bore.rise_m * np.sqrt(max(1 - (v / self.bore.half_width_m) ** 2, 0.0))
        return upright_axes(level, np.array([0, 0, 1.0]), self.bore.at(u, v, float(up)), yaw)

    def holds(self, u: float, v: float) -> bool:
        """See ``Support``."""
        return 0.5 < u < self.bore.length_m - 0.5 and abs(v) < 0.5 * self.bore.half_width_m

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """See ``Support``."""
        v = rng.uniform(-0.45, 0.45) * self.bore.half_width_m
        return float(rng.uniform(0.6, self.bore.length_m - 0.6)), float(v), float(rng.uniform(-0.4, 0.4))
