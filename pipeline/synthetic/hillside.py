"""A camp on a hillside: no level ground, no walls; tents, rocks, trees, washing and lanterns on lines.

For held-out checks only: nothing is tuned on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.synthetic import camp, furniture, goods, prints, street, textures
from pipeline.synthetic.carpark import OUTDOOR_SENSOR
from pipeline.synthetic.lighting import daylight
from pipeline.synthetic.mix import draw_mix
from pipeline.synthetic.paths import walk
from pipeline.synthetic.perches import Ball, Perch, PerchChanges, settle
from pipeline.synthetic.props import Arrangement, Prop, Workshop
from pipeline.synthetic.shapes import Mesh, join
from pipeline.synthetic.sheets import sheet, tube
from pipeline.synthetic.world import Pose, SyntheticScene

_RADIUS_M = 7.0  # of the camp
_LAND_M = 26.0  # half the side of the land around


@dataclass(frozen=True)
class Terrain:
    """Height of the ground: a slope with hollows and knolls, rising to hills at its rim.

    Attributes:
        waves: (N, 4) amplitude in metres, wave numbers along x and y in radians per metre, phase.
        slope: (2,) rise per metre along x and y.
    """

    waves: NDArray[np.float64]
    slope: NDArray[np.float64]

    def height(self, x: NDArray[np.float64] | float, y: NDArray[np.float64] | float) -> NDArray[np.float64]:
        """Metres at world x and y."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        amplitude, kx, ky, phase = self.waves.T
        field = (amplitude * np.sin(x[..., None] * kx + y[..., None] * ky + phase)).sum(axis=-1)
        rim = np.clip(np.hypot(x, y) - _RADIUS_M * 1.6, 0, 13)
        return field + self.slope[0] * x + self.slope[1] * y + 0.035 * rim**2

    def normal(self, x: float, y: float) -> NDArray[np.float64]:
        """(3,) unit normal."""
        step = 0.15
        dx = (self.height(x + step, y) - self.height(x - step, y)) / (2 * step)
        dy = (self.height(x, y + step) - self.height(x, y - step)) / (2 * step)
        up = np.array([-float(dx), -float(dy), 1.0])
        return up / np.linalg.norm(up)


@dataclass(frozen=True)
class Ground:
    """The camp's part of the terrain; things lean with the slope as far as ``lean`` says (0 = upright)."""

    terrain: Terrain
    lean: float = 1.0
    group: str = "ground"
    turns: bool = True

    def pose(self, u: float, v: float, yaw: float) -> Pose:
        """See ``Support``; u and v are world x and y."""
        up = self.lean * self.terrain.normal(u, v) + (1 - self.lean) * np.array([0, 0, 1.0])
        up /= np.linalg.norm(up)
        ahead = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        side = np.cross(up, ahead)
        side /= np.linalg.norm(side)
        T = np.eye(4)
        T[:3, :3] = np.stack([np.cross(side, up), side, up], axis=1)
        T[:3, 3] = u, v, float(self.terrain.height(u, v))
        return T

    def holds(self, u: float, v: float) -> bool:
        """See ``Support``."""
        return float(np.hypot(u, v)) < _RADIUS_M

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """See ``Support``."""
        distance, angle = _RADIUS_M * np.sqrt(rng.uniform(0.02, 1)), rng.uniform(-np.pi, np.pi)
        return (
            float(distance * np.cos(angle)),
            float(distance * np.sin(angle)),
            float(rng.uniform(-np.pi, np.pi)),
        )


@dataclass(frozen=True)
class Line:
    """A cord between two trees; things hang from it."""

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    sag_m: float
    group: str = "line"
    turns: bool = False

    @property
    def length_m(self) -> float:
        """Between its ends."""
        return float(np.linalg.norm(self.end - self.start))

    def points(self, share: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) at shares of its length."""
        at = self.start + share[:, None] * (self.end - self.start)
        at[:, 2] -= self.sag_m * 4 * share * (1 - share)
        return at

    def pose(self, u: float, v: float, yaw: float) -> Pose:
        """See ``Support``; u runs along the cord, v is not used."""
        share = u / self.length_m
        T = np.eye(4)
        T[:3, 3] = self.points(np.array([share]))[0]
        along = self.end - self.start
        heading = float(np.arctan2(along[1], along[0])) + yaw
        c, s = np.cos(heading), np.sin(heading)
        T[:2, :2] = [[c, -s], [s, c]]
        return T

    def holds(self, u: float, v: float) -> bool:
        """See ``Support``."""
        return 0.4 < u < self.length_m - 0.4

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """See ``Support``."""
        return float(rng.uniform(0.5, self.length_m - 0.5)), 0.0, float(rng.integers(2) * np.pi)


def camp_thing(shop: Workshop) -> Prop:
    """Something that campers leave about."""
    rng = shop.rng
    match int(rng.integers(9)):
        case 0:
            return furniture.bag(shop, prints.vivid(rng, 60, 200))
        case 1 | 2:
            return camp.canister(shop, prints.vivid(rng, 90, 230))
        case 3:
            return camp.roll(shop, prints.vivid(rng, 70, 220))
        case 4:
            size = (shop.between(0.35, 0.6), shop.between(0.3, 0.4), shop.between(0.25, 0.4))
            return furniture.carton(shop, size, prints.vivid(rng, 110, 230), prints.vivid(rng, 20, 90))
        case 5:
            return goods.crate(shop, (shop.between(0.4, 0.6), 0.36, shop.between(0.25, 0.35)), (150, 112, 74))
        case 6:
            return furniture.chair(shop, prints.vivid(rng, 70, 210))
        case 7:
            return camp.pot(shop, prints.vivid(rng, 60, 200))
        case _:
            return camp.log(shop, shop.between(0.9, 1.8), shop.between(0.1, 0.18))


def hanging_thing(shop: Workshop) -> Prop:
    """Something that hangs from a cord."""
    if shop.rng.random() < 0.4:
        return camp.lantern(shop, prints.vivid(shop.rng, 130, 240))
    return camp.washing(shop, shop.between(0.4, 0.8), shop.between(0.45, 0.9))


def land(shop: Workshop, terrain: Terrain, lines: list[Line]) -> Mesh:
    """Ground with grass and bare earth, and the cords."""
    rng = shop.rng
    grass = textures.leaves(rng, shop.near((104, 122, 62), 14), 256)
    earth = textures.speckled(rng, shop.near((124, 104, 78), 14), 0.3, 256)
    mask = np.clip(textures.noise(rng, 256, 1.4) * 0.9 + 0.4, 0, 1)[..., None]
    tile = shop.tile((grass * mask + earth * (1 - mask)).astype(np.uint8), macro=0.16)
    axis = np.concatenate(
        [
            np.linspace(-_LAND_M, -11, 12)[:-1],
            np.linspace(-11, 11, 64),
            np.linspace(11, _LAND_M, 12)[1:],
        ]
    )
    x, y = np.meshgrid(axis, axis)
    parts = [sheet(np.stack([x, y, terrain.height(x, y)], axis=-1), tile, 2.6)]
    cord = shop.paint((196, 186, 160), 0.2)
    parts += [tube(line.points(np.linspace(0, 1, 13)), 0.008, cord, 0.3, 6) for line in lines]
    for _ in range(14):  # trees on the hills around
        angle, distance = rng.uniform(-np.pi, np.pi), rng.uniform(12, 19)
        x0, y0 = float(distance * np.cos(angle)), float(distance * np.sin(angle))
        far = street.tree(shop, shop.between(4, 7)).mesh
        parts.append(far.at(x0, y0, float(terrain.height(x0, y0)) - 0.1, shop.between(-3, 3)))
    return join(parts)


def build(shop: Workshop, seed: int, frames: int, camera: PinholeCamera) -> SyntheticScene:
    """Draw a camp."""
    rng = shop.rng
    wave = [
        (a, k * np.cos(d), k * np.sin(d), shop.between(-3, 3))
        for a, k, d in (
            (shop.between(0.3, 0.6), shop.between(0.25, 0.4), shop.between(-3, 3)),
            (shop.between(0.15, 0.25), shop.between(0.6, 0.9), shop.between(-3, 3)),
            (shop.between(0.04, 0.07), shop.between(1.6, 2.4), shop.between(-3, 3)),
        )
    ]
    terrain = Terrain(np.array(wave), rng.uniform(-0.12, 0.12, 2))
    leaning, upright = Ground(terrain), Ground(terrain, 0.3, "upright")
    plan = Arrangement()
    perches: list[Perch] = []
    fixed: list[Ball] = []

    def stand(prop: Prop, support: Ground, weight: float = 1.0) -> None:
        perch = settle(shop, prop, [support], [*fixed, *(one.ball for one in perches)], weight)
        if perch is not None:
            perches.append(perch)

    posts: list[NDArray[np.float64]] = []
    for _ in range(shop.count(5, 7)):
        tree = street.tree(shop, shop.between(3.6, 5.2))
        for _ in range(30):
            T = Ground(terrain, 0.0).pose(*Ground(terrain).draw(rng))
            if all(np.linalg.norm(T[:3, 3] - other) > 2.4 for other in posts):
                plan.keep(tree, T)
                posts.append(T[:3, 3])
                fixed.append((T[:3, 3], 0.35))
                break
    colours = [prints.vivid(rng, 110, 235) for _ in range(4)]
    for _ in range(shop.count(5, 7)):
        colour = colours[int(rng.integers(4))]
        match int(rng.integers(4)):
            case 0:
                tent = camp.ridge_tent(shop, shop.between(1.9, 2.5), shop.near(colour))
            case 1:
                tent = camp.tarp(shop, (shop.between(1.8, 2.6), shop.between(1.6, 2.2)), shop.near(colour))
            case _:
                tent = camp.dome_tent(shop, shop.between(0.85, 1.2), [shop.near(colour), (214, 210, 200)])
        stand(tent, upright, 0.6)
    lines: list[Line] = []
    for one in range(len(posts)):
        for other in range(one + 1, len(posts)):
            gap = float(np.linalg.norm(posts[one][:2] - posts[other][:2]))
            if 2.4 < gap < 8.0 and len(lines) < 4:
                ends = [posts[i] + np.array([0, 0, shop.between(1.7, 2.0)]) for i in (one, other)]
                lines.append(Line(ends[0], ends[1], 0.03 * gap))
    stones = [camp.boulder(shop, shop.between(0.3, 0.8)) for _ in range(shop.count(5, 8))]
    for stone in [camp.fireplace(shop), *stones]:
        lying = settle(shop, stone, [leaning], [*fixed, *(perch.ball for perch in perches)])
        if lying is not None:
            plan.keep(stone, lying.T_world_object)
            fixed.append(lying.ball)
    for _ in range(shop.count(3, 4)):
        stand(camp.notice(shop), upright, 0.8)
    for _ in range(shop.count(26, 34)):
        stand(camp_thing(shop), leaning)
    for _ in range(shop.count(9, 13) if lines else 0):
        hung = settle(shop, hanging_thing(shop), lines, [perch.ball for perch in perches])
        perches += [hung] if hung is not None else []

    def substitute(perch: Perch) -> Prop:
        return hanging_thing(shop) if perch.support.group == "line" else camp_thing(shop)

    mix = draw_mix(shop, len(perches), seed % 3 == 0, (0.12, 0.12, 0.15), jolted=shop.count(0, 3))
    PerchChanges(shop, perches, substitute, fixed).deal(mix, plan)
    partial = shop.count(0, 1)
    return SyntheticScene(
        name="hillside",
        seed=seed,
        atlas=shop.atlas,
        background=land(shop, terrain, lines),
        objects=plan.objects(rng),
        lighting=(daylight(shop), daylight(shop)),
        paths=(
            _wander(shop, terrain, partial == 0, frames),
            _wander(shop, terrain, partial == 1, frames),
        ),
        camera=camera,
        sensor=OUTDOOR_SENSOR,
        truth_voxel_m=0.04,
    )


def _wander(shop: Workshop, terrain: Terrain, partial: bool, frames: int) -> np.ndarray:
    """Round the camp at changing distance, looking across it; a partial walk leaves a side out."""
    rng = shop.rng
    laps = shop.between(0.45, 0.65) if partial else shop.between(0.95, 1.1)
    start, turn = shop.between(0, 2 * np.pi), rng.choice([-1.0, 1.0])
    angle = start + turn * np.linspace(0, 2 * np.pi * laps, 17)
    distance = _RADIUS_M * (0.95 + 0.15 * np.sin(angle * shop.count(2, 3) + shop.between(0, 6)))
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    height = terrain.height(x, y) + shop.between(1.5, 1.9)
    ahead = angle + np.pi - turn * shop.between(-0.3, 0.6)
    tx, ty = _RADIUS_M * 0.12 * np.cos(ahead), _RADIUS_M * 0.12 * np.sin(ahead)
    targets = np.stack([tx, ty, terrain.height(tx, ty) + 0.35], axis=1)
    return walk(np.stack([x, y, height], axis=1), targets, frames, rng, 0.04)
