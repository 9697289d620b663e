"""What happens to a place between two visits: things are moved, taken away, brought, or replaced.

The story of a change says how it came about. Moved: ``carried`` elsewhere, ``swapped`` with another thing,
``shifted`` by less than half a metre or so, ``turned`` on the spot, ``tipped`` over. Replaced: by a thing of
the same shape with another print (``reprinted``), by a ``look-alike`` of similar size, or by something
``different``. ``jolted`` things stand still in the sense of ``motion``: the jolt is below its thresholds.

Nothing here is beyond knowing: of things that look the same, at most one changes and the others stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pipeline.synthetic.footprint import Footprint, footprint, is_free
from pipeline.synthetic.mix import Mix
from pipeline.synthetic.props import Arrangement, Prop, Workshop, reprinted
from pipeline.synthetic.shapes import pose
from pipeline.synthetic.spots import Reach, Spot
from pipeline.synthetic.world import Pose

_MODES = {"carried": 0.5, "swapped": 0.16, "shifted": 0.2, "turned": 0.14}
_SUCCESSORS = {"reprinted": 0.35, "look-alike": 0.35, "different": 0.3}
_SLACK_M = 0.012  # boxes around things are larger than the things
_LEAST_TURN_RAD = np.deg2rad(28.0)
_TRIES = 24


class Rearrangement:
    """Deals fates to spots so that nothing stands in anything else in either visit."""

    def __init__(
        self,
        shop: Workshop,
        spots: Sequence[Spot],
        substitute: Callable[[Spot], Prop],
        obstacles: Sequence[Footprint] = (),
        reach: Reach | None = None,
    ) -> None:
        """Prepare.

        Args:
            shop: source of numbers and textures.
            spots: all places; their things must not cut into each other.
            substitute: makes a different thing that may stand at a spot.
            obstacles: what stands there in both visits besides, without its supports.
            reach: how far things go.
        """
        self._shop, self._substitute, self._obstacles = shop, substitute, tuple(obstacles)
        self._reach = reach or Reach()
        self._spots = list(spots)
        self._standing: tuple[dict[int, Footprint], dict[int, Footprint]] = ({}, {})

    def deal(self, mix: Mix, plan: Arrangement) -> None:
        """Enter all spots into the plan with their fates."""
        self._reprint(mix.reprints)
        fate = self._fates(mix)
        self._duplicate(fate, mix.twins)
        for index, name in fate.items():
            box = self._box(index)
            if name not in ("spare", "appeared"):
                self._standing[0][index] = box
            if name not in ("spare", "disappeared"):
                self._standing[1][index] = box
        goals = self._moves([i for i, name in fate.items() if name == "moved"], fate)
        for index, name in fate.items():
            spot = self._spots[index]
            if name == "disappeared":
                plan.vanish(spot.prop, spot.pose)
            elif name == "appeared":
                plan.arrive(spot.prop, spot.pose)
            elif name == "replaced":
                self._replace(index, plan)
            elif name == "jolted":
                self._jolt(index, plan)
            elif index in goals:
                after, story = goals[index]
                plan.move(spot.prop, spot.pose, after, story)
            elif name in ("static", "moved"):
                plan.keep(spot.prop, spot.pose)

    def _fates(self, mix: Mix) -> dict[int, str]:
        names = ["moved"] * mix.moved + ["spare"] * mix.spare + ["replaced"] * mix.replaced
        names += ["appeared"] * mix.appeared + ["disappeared"] * mix.disappeared + ["jolted"] * mix.jolted
        # A race of exponential times: heavier spots tend to come first, and the first ones are moved.
        times = self._shop.rng.exponential(size=len(self._spots))
        order = np.argsort(times / [spot.weight for spot in self._spots])
        names = names[: len(order)] + ["static"] * (len(order) - len(names))
        fate = dict(sorted(zip(order.tolist(), names, strict=True)))
        self._spare_plain_things(fate)
        return fate

    def _spare_plain_things(self, fate: dict[int, str]) -> None:
        """Of things that cannot be told apart only one may change, or nobody could say which: in place.

        The fate of the others goes to things that can be told apart.
        """
        changed: set[str] = set()
        for index, name in fate.items():
            prop = self._spots[index].prop
            if not prop.plain or name in ("static", "spare"):
                continue
            if prop.class_name in changed:
                group = self._spots[index].group
                others = [i for i, n in fate.items() if n == "static" and not self._spots[i].prop.plain]
                others.sort(key=lambda i: self._spots[i].group != group)
                fate[index] = "static"
                if others:
                    fate[others[0]] = name
            changed.add(prop.class_name)

    def _reprint(self, count: int) -> None:
        """Give some spots things of the same shape as others', differing in print."""
        for index in self._some(count):
            for other in self._some(_TRIES):
                model = self._spots[other]
                if other != index and self._may_stand_for(model, self._spots[index]):
                    self._spots[index] = replace(self._spots[index], prop=reprinted(model.prop))
                    break

    def _duplicate(self, fate: dict[int, str], count: int) -> None:
        """Give spots whose thing stays the very same thing as one that will be moved."""
        movers = [i for i, name in fate.items() if name == "moved"]
        for mover in [movers[i] for i in self._shop.rng.permutation(len(movers))][:count]:
            for other in self._some(_TRIES):
                model = self._spots[mover]
                if fate[other] == "static" and self._may_stand_for(model, self._spots[other]):
                    self._spots[other] = replace(self._spots[other], prop=model.prop)
                    break

    def _may_stand_for(self, model: Spot, spot: Spot) -> bool:
        if model.group != spot.group:
            return False
        # A thing no wider than the one it stands for cuts into nothing either.
        sizes = [np.abs(s.prop.mesh.bounds[:, :2]).max(axis=0) for s in (model, spot)]
        return bool((sizes[0] <= sizes[1] + _SLACK_M).all() and model.prop.height <= spot.prop.height + 0.06)

    def _moves(self, movers: list[int], fate: dict[int, str]) -> dict[int, tuple[Pose, str]]:
        rng = self._shop.rng
        spare = [i for i, name in fate.items() if name == "spare"]
        spare = [spare[i] for i in rng.permutation(len(spare))]
        goals: dict[int, tuple[Pose, str]] = {}
        for index in [movers[i] for i in rng.permutation(len(movers))]:
            if index in goals:
                continue
            first = str(rng.choice(list(_MODES), p=list(_MODES.values())))
            for mode in dict.fromkeys([first, "carried", "shifted", "turned"]):
                if mode == "swapped":
                    waiting = [i for i in movers if i not in goals and i != index]
                    done = self._swap(index, waiting, goals)
                elif mode == "carried":
                    done = self._carry(index, spare, goals)
                elif mode == "shifted":
                    done = self._shift(index, goals)
                else:
                    done = self._turn(index, goals)
                if done:
                    break
        return goals

    def _carry(self, index: int, spare: list[int], goals: dict[int, tuple[Pose, str]]) -> bool:
        spot, rng = self._spots[index], self._shop.rng
        same = [i for i in spare if self._spots[i].group == spot.group]
        poses = [(i, self._spots[i].pose) for i in same]
        areas = [s.area for s in self._spots if s.group == spot.group and s.area is not None]
        for _ in range(_TRIES if areas else 0):
            area = areas[int(rng.integers(len(areas)))]
            x, y = (float(rng.uniform(-1, 1)) * half for half in (area.half_width_m, area.half_depth_m))
            poses.append((-1, area.T_world_area @ pose(x, y, 0, float(rng.normal(0, 0.4)))))
        for other, goal in poses:
            if np.linalg.norm(goal[:3, 3] - spot.pose[:3, 3]) < 2 * self._reach.shift_m[1] * 0.6:
                continue
            if spot.area is not None:
                goal = goal @ pose(0, 0, 0, float(rng.uniform(-np.pi, np.pi) if rng.random() < 0.4 else 0))
            if self._put(index, goal, "carried", goals):
                if other >= 0:
                    spare.remove(other)
                return True
        return False

    def _swap(self, index: int, waiting: list[int], goals: dict[int, tuple[Pose, str]]) -> bool:
        spot = self._spots[index]
        partners = [i for i in waiting if self._spots[i].group == spot.group]
        # Look-alikes first: to tell them apart takes their print.
        partners.sort(key=lambda i: self._spots[i].prop.class_name != spot.prop.class_name)
        for other in partners:
            places = spot.pose @ self._nudge(), self._spots[other].pose @ self._nudge()
            boxes = self._box(index, places[1]), self._box(other, places[0])
            if boxes[0].overlaps(boxes[1], _SLACK_M):
                continue
            if all(self._is_free(box, (index, other)) for box in boxes):
                goals[index], goals[other] = (places[1], "swapped"), (places[0], "swapped")
                self._standing[1][index], self._standing[1][other] = boxes
                return True
        return False

    def _shift(self, index: int, goals: dict[int, tuple[Pose, str]]) -> bool:
        spot, rng = self._spots[index], self._shop.rng
        if spot.area is None:
            return False
        low, high = self._reach.shift_m
        for _ in range(_TRIES):
            distance, heading = rng.uniform(low, high), rng.uniform(-np.pi, np.pi)
            goal = spot.pose.copy()
            goal[:2, 3] += distance * np.cos(heading), distance * np.sin(heading)
            if rng.random() < 0.4 and spot.prop.symmetry_order != 0:
                goal = goal @ pose(0, 0, 0, float(rng.uniform(-np.pi, np.pi)))
            if self._put(index, goal, "shifted", goals):
                return True
        return False

    def _turn(self, index: int, goals: dict[int, tuple[Pose, str]]) -> bool:
        spot, rng = self._spots[index], self._shop.rng
        order = spot.prop.symmetry_order
        if order == 0:
            return False
        step = 2 * np.pi / order
        for attempt in range(_TRIES):
            angle = float(rng.uniform(_LEAST_TURN_RAD, step - _LEAST_TURN_RAD))
            if attempt >= _TRIES // 2 and order == 1:
                angle = np.pi + float(rng.normal(0, 0.05))  # a box fits into its own place this way round
            if self._put(index, spot.pose @ pose(0, 0, 0, angle), "turned", goals):
                return True
        return False

    def _put(self, index: int, goal: Pose, story: str, goals: dict[int, tuple[Pose, str]]) -> bool:
        """Try a goal in visit 1, now and then with the thing on its side."""
        spot, rng = self._spots[index], self._shop.rng
        if spot.prop.tips and story in ("carried", "shifted") and rng.random() < 0.3:
            goal, story = goal @ _tip(spot.prop, int(rng.integers(4))), "tipped"
        box = self._box(index, goal)
        if story != "turned" and spot.area is not None and not self._within(box, spot.group):
            return False
        if not self._is_free(box, (index,)):
            return False
        goals[index] = (goal, story)
        self._standing[1][index] = box
        return True

    def _within(self, box: Footprint, group: str) -> bool:
        areas = [s.area for s in self._spots if s.group == group and s.area is not None]
        return any(
            area.contains(box, _SLACK_M) and abs(box.low_m - area.T_world_area[2, 3]) < 0.03 for area in areas
        )

    def _replace(self, index: int, plan: Arrangement) -> None:
        spot = self._spots[index]
        story = str(self._shop.rng.choice(list(_SUCCESSORS), p=list(_SUCCESSORS.values())))
        if spot.prop.plain:
            story = "different"
        where = spot.pose @ self._nudge()
        successor = None
        if story == "different":
            for _ in range(8):
                other = self._substitute(spot)
                box = footprint(other.mesh, where, self._reach.footprint_scale)
                fits = other.radius <= 1.25 * spot.prop.radius and self._is_free(box, (index,))
                if fits and not other.plain:
                    successor = other
                    break
            else:
                story = "look-alike"
        if successor is None and spot.prop.plain:
            plan.vanish(spot.prop, spot.pose)
            return
        if successor is None:
            successor = reprinted(spot.prop) if story == "reprinted" else spot.prop.lookalike()
        plan.replace(spot.prop, spot.pose, successor, where, story)

    def _jolt(self, index: int, plan: Arrangement) -> None:
        spot, rng = self._spots[index], self._shop.rng
        heading, distance = rng.uniform(-np.pi, np.pi), rng.uniform(0.01, 0.03)
        turn = np.deg2rad(float(rng.uniform(-5, 5)))
        after = spot.pose @ pose(distance * np.cos(heading), distance * np.sin(heading), 0, turn)
        if self._is_free(self._box(index, after), (index,)):
            plan.move(spot.prop, spot.pose, after, "jolted")
        else:
            plan.keep(spot.prop, spot.pose)

    def _nudge(self) -> Pose:
        dx, dy = self._shop.rng.normal(0, self._reach.nudge_m, 2)
        return pose(float(dx), float(dy), 0, float(self._shop.rng.normal(0, self._reach.nudge_rad)))

    def _some(self, count: int) -> list[int]:
        return self._shop.rng.permutation(len(self._spots))[:count].tolist()

    def _box(self, index: int, T_world_object: Pose | None = None) -> Footprint:
        spot = self._spots[index]
        where = spot.pose if T_world_object is None else T_world_object
        mesh, scale = spot.prop.mesh, self._reach.footprint_scale
        if abs(where[2, 2]) < 0.99:  # on its side
            upright = where.copy()
            upright[:3, :3] = np.eye(3)
            lying = np.eye(4)
            lying[:3, :3] = where[:3, :3]
            return footprint(mesh.placed(lying), upright, scale)
        return footprint(mesh, where, scale)

    def _is_free(self, box: Footprint, but: tuple[int, ...]) -> bool:
        others = [b for visit in self._standing for i, b in visit.items() if i not in but]
        return is_free(box, [*others, *self._obstacles], _SLACK_M)


def _tip(prop: Prop, side: int) -> Pose:
    """T_object_lying: turned on one of four sides and lifted onto what it stands on."""
    tipped = pose(0, 0, 0, side * np.pi / 2) @ pose(0, 0, 0, np.pi / 2, "x")
    lifted = pose(0, 0, -float(prop.mesh.placed(tipped).bounds[0, 2]))
    return lifted @ tipped
