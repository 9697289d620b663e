"""Changes in places without level supports: things lie on slopes, hang on lines and walls, sit on pipes.

The counterpart of ``changes`` (whose words for what happens are used here too): a support turns two
coordinates along it and a turn into a pose, and what is moved stays on supports of its kind.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.synthetic.mix import Mix
from pipeline.synthetic.props import Arrangement, Prop, Workshop, reprinted
from pipeline.synthetic.world import Pose

_MODES = {"carried": 0.45, "swapped": 0.2, "shifted": 0.2, "turned": 0.15}
_SUCCESSORS = {"reprinted": 0.45, "look-alike": 0.3, "different": 0.25}
_SHIFT_M = (0.12, 0.5)
_LEAST_TURN_RAD = np.deg2rad(28.0)
_TRIES = 40


class Support(Protocol):
    """Something to stand on or hang from."""

    @property
    def group(self) -> str:
        """Things are moved to supports of the same group only."""

    @property
    def turns(self) -> bool:
        """Whether things may stand on it any way round."""

    def pose(self, u: float, v: float, yaw: float) -> Pose:
        """T_world_object of a thing ``u`` and ``v`` metres along the support."""

    def holds(self, u: float, v: float) -> bool:
        """Whether the support reaches there."""

    def draw(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """u, v and turn of a place anywhere on it."""


Ball = tuple[NDArray[np.float64], float]  # centre in the world, (3,), and radius, metres


@dataclass(frozen=True)
class Perch:
    """A thing and where it is on a support."""

    prop: Prop
    support: Support
    u: float
    v: float
    yaw: float
    weight: float = 1.0

    @property
    def T_world_object(self) -> Pose:
        """(4, 4)."""
        return self.support.pose(self.u, self.v, self.yaw)

    @property
    def ball(self) -> Ball:
        """What holds most of the thing."""
        return ball_of(self.prop, self.T_world_object)


def ball_of(prop: Prop, T_world_object: Pose) -> Ball:
    """What holds most of a thing."""
    low, high = prop.mesh.bounds.astype(np.float64)
    centre = T_world_object[:3, :3] @ ((low + high) / 2) + T_world_object[:3, 3]
    return centre, 0.42 * float(np.linalg.norm(high - low))


def settle(
    shop: Workshop, prop: Prop, supports: Sequence[Support], taken: Sequence[Ball], weight: float = 1.0
) -> Perch | None:
    """Find room for a thing on one of the supports; None without any."""
    for _ in range(_TRIES):
        support = supports[int(shop.rng.integers(len(supports)))]
        perch = Perch(prop, support, *support.draw(shop.rng), weight)
        if _clear(perch.ball, taken):
            return perch
    return None


def _clear(ball: Ball, others: Sequence[Ball]) -> bool:
    return all(np.linalg.norm(ball[0] - centre) > ball[1] + radius for centre, radius in others)


class PerchChanges:
    """Deals fates to perches so that nothing gets into anything else in either visit."""

    def __init__(
        self,
        shop: Workshop,
        perches: Sequence[Perch],
        substitute: Callable[[Perch], Prop],
        obstacles: Sequence[Ball] = (),
    ) -> None:
        """Prepare; ``substitute`` makes a different thing that may be where a perch is."""
        self._shop, self._perches, self._substitute = shop, list(perches), substitute
        self._obstacles = list(obstacles)
        self._goals: dict[int, tuple[Perch, str]] = {}
        self._fate: dict[int, str] = {}

    def deal(self, mix: Mix, plan: Arrangement) -> None:
        """Enter all perches into the plan with their fates."""
        rng = self._shop.rng
        self._multiply(mix.reprints, exact=False)
        names = ["moved"] * mix.moved + ["replaced"] * mix.replaced + ["jolted"] * mix.jolted
        names += ["appeared"] * mix.appeared + ["disappeared"] * mix.disappeared
        times = rng.exponential(size=len(self._perches)) / [perch.weight for perch in self._perches]
        order = np.argsort(times)
        names = names[: len(order)] + ["static"] * (len(order) - len(names))
        self._fate = dict(sorted(zip(order.tolist(), names, strict=True)))
        self._spare_plain_things()
        self._multiply(mix.twins, exact=True)
        for index in [i for i, name in self._fate.items() if name == "moved"]:
            if index not in self._goals:
                self._move(index)
        for index, name in self._fate.items():
            perch = self._perches[index]
            if index in self._goals:
                goal, story = self._goals[index]
                plan.move(perch.prop, perch.T_world_object, goal.T_world_object, story)
            elif name == "disappeared":
                plan.vanish(perch.prop, perch.T_world_object)
            elif name == "appeared":
                plan.arrive(perch.prop, perch.T_world_object)
            elif name == "replaced":
                self._replace(perch, plan)
            elif name == "jolted":
                plan.move(perch.prop, perch.T_world_object, self._slid(perch, 0.01, 0.03), "jolted")
            else:
                plan.keep(perch.prop, perch.T_world_object, perch.prop.sway() if perch.prop.sway else None)

    def _multiply(self, count: int, exact: bool) -> None:
        """Make things alike: in shape only, or twins of things that will be moved."""
        indices = self._shop.rng.permutation(len(self._perches)).tolist()
        models = [i for i in indices if not exact or self._fate[i] == "moved"]
        for model in models[:count]:
            mine = self._perches[model]
            for index in indices:
                perch = self._perches[index]
                if index == model or perch.support.group != mine.support.group:
                    continue
                if mine.ball[1] > perch.ball[1] * 1.05 or (exact and self._fate[index] != "static"):
                    continue
                self._perches[index] = replace(perch, prop=mine.prop if exact else reprinted(mine.prop))
                break

    def _spare_plain_things(self) -> None:
        """Of things that cannot be told apart only one may change."""
        changed: set[str] = set()
        for index, name in self._fate.items():
            prop = self._perches[index].prop
            if prop.plain and name != "static":
                if prop.class_name in changed:
                    self._fate[index] = "static"
                changed.add(prop.class_name)

    def _move(self, index: int) -> None:
        rng, perch = self._shop.rng, self._perches[index]
        first = str(rng.choice(list(_MODES), p=list(_MODES.values())))
        for mode in dict.fromkeys([first, "carried", "shifted", "turned"]):
            if mode == "swapped" and self._swap(index):
                return
            for _ in range(_TRIES):
                goal = self._proposed(perch, mode)
                if goal is not None and self._is_free(goal, (index,)):
                    self._goals[index] = goal, mode
                    return

    def _proposed(self, perch: Perch, mode: str) -> Perch | None:
        rng = self._shop.rng
        order = perch.prop.symmetry_order
        if mode == "carried":
            supports = [p.support for p in self._perches if p.support.group == perch.support.group]
            support = supports[int(rng.integers(len(supports)))]
            goal = Perch(perch.prop, support, *support.draw(rng))
            far = np.linalg.norm(goal.T_world_object[:3, 3] - perch.T_world_object[:3, 3]) > 2 * _SHIFT_M[1]
            return goal if far else None
        if mode == "shifted":
            heading, distance = rng.uniform(-np.pi, np.pi), rng.uniform(*_SHIFT_M)
            u, v = perch.u + distance * np.cos(heading), perch.v + distance * np.sin(heading)
            turn = rng.uniform(-np.pi, np.pi) if perch.support.turns and rng.random() < 0.4 else 0.0
            goal = replace(perch, u=float(u), v=float(v), yaw=perch.yaw + float(turn))
            gone = np.linalg.norm(goal.T_world_object[:3, 3] - perch.T_world_object[:3, 3])
            return goal if perch.support.holds(u, v) and gone >= _SHIFT_M[0] * 0.8 else None
        if mode == "turned" and perch.support.turns and order != 0:
            angle = rng.uniform(_LEAST_TURN_RAD, 2 * np.pi / order - _LEAST_TURN_RAD)
            return replace(perch, yaw=perch.yaw + float(angle))
        return None

    def _swap(self, index: int) -> bool:
        mine = self._perches[index]
        waiting = [i for i, name in self._fate.items() if name == "moved" and i not in self._goals]
        for other in waiting:
            theirs = self._perches[other]
            if other == index or theirs.support.group != mine.support.group:
                continue
            goals = replace(theirs, prop=mine.prop), replace(mine, prop=theirs.prop)
            if all(self._is_free(goal, (index, other)) for goal in goals):
                self._goals[index], self._goals[other] = (goals[0], "swapped"), (goals[1], "swapped")
                return True
        return False

    def _is_free(self, goal: Perch, but: tuple[int, ...]) -> bool:
        others = [perch.ball for i, perch in enumerate(self._perches) if i not in but]
        others += self._obstacles
        others += [moved.ball for i, (moved, _) in self._goals.items() if i not in but]
        return _clear(goal.ball, others)

    def _replace(self, perch: Perch, plan: Arrangement) -> None:
        story = str(self._shop.rng.choice(list(_SUCCESSORS), p=list(_SUCCESSORS.values())))
        if perch.prop.plain:
            story = "different"
        where = perch.T_world_object
        successor = perch.prop
        if story == "different":
            for _ in range(10):
                other = self._substitute(perch)
                if not other.plain and ball_of(other, where)[1] <= 1.3 * perch.ball[1]:
                    successor = other
                    break
            else:
                if perch.prop.plain:
                    plan.vanish(perch.prop, where)
                    return
                story = "look-alike"
        if story == "look-alike":
            successor = perch.prop.lookalike()
        if story == "reprinted":
            # Same shape, same place: nothing but the print tells. A change without a trace in geometry.
            successor = reprinted(perch.prop)
            plan.replace(perch.prop, where, successor, where, story)
            return
        plan.replace(perch.prop, where, successor, self._slid(perch, 0.0, 0.02), story)

    def _slid(self, perch: Perch, least_m: float, most_m: float) -> Pose:
        """A pose a little along the support, turned by at most 5 degrees."""
        rng = self._shop.rng
        heading, distance = rng.uniform(-np.pi, np.pi), rng.uniform(least_m, most_m)
        u, v = perch.u + distance * np.cos(heading), perch.v + distance * np.sin(heading)
        turn = np.deg2rad(rng.uniform(-5, 5)) if perch.support.turns else 0.0
        return perch.support.pose(float(u), float(v), perch.yaw + float(turn))
