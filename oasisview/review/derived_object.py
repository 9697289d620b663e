"""The object that a group of fragments makes: where it is, and what became of it, unless a person says so.

What follows from the fragments:

- They are exactly one object of the machine: that object, as the machine saw it.
- Seen on several visits: *static* or *moved*. The largest object of the machine that is in the group as a
  whole on several visits leads (its motion was registered; a fragment that is added must not bend it);
  otherwise the distance between the centroids of the first and the last visit decides, against tau_d.
- Seen on one visit only: the fragments vote with their points. A fragment of an object that is in the group
  as a whole votes for the machine's label; one whose other visit was taken away votes *disappeared* on an
  earlier visit and *appeared* on the last one.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from oasisview.review.fragments import Fragment, Members
from oasisview.review.machine_map import MachineMap
from pipeline.result import ChangeLabel, MapObject, Sighting

_STAYS = (ChangeLabel.STATIC, ChangeLabel.MOVED)


def derived_object(machine: MachineMap, members: Members, object_id: int) -> MapObject:
    """The object of a group, under an id, without replaced events unless it is the machine's own object."""
    leading = _leading(machine, members)
    base = machine.objects[leading]
    if machine.members[leading] == members:
        return base if base.object_id == object_id else replace(base, object_id=object_id)
    sightings = _sightings(machine, members)
    label, displacement = _became(machine, members, sightings)
    pair = _leading_pair(machine, members)
    motion = machine.objects[pair] if pair is not None else None
    evidence = (
        machine.pair_evidence(sightings[0].instance, sightings[-1].instance) if len(sightings) > 1 else None
    )
    sigma, s_bar, case = evidence or (base.sigma, base.s_bar, base.case)
    return replace(
        base,
        object_id=object_id,
        label=label,
        sigma=sigma,
        s_bar=s_bar,
        case=case,
        coverage=min((s.coverage for s in sightings), default=base.coverage),
        displacement_m=displacement,
        rotation_rad=motion.rotation_rad if motion is not None else None,
        T_world_motion=motion.T_world_motion if motion is not None else None,
        counterpart_instance=_counterpart(machine, base, sightings),
        replaced_by=None,
        replaces=None,
        sightings=sightings,
    )


def joined_displacement_m(machine: MachineMap, members: Members) -> float | None:
    """How far a group's thing went between its first and its last visit, metres; None if seen on one only."""
    return _became(machine, members, _sightings(machine, members))[1]


def _leading(machine: MachineMap, members: Members) -> int:
    """The machine object with the most points in a group; the smaller id among equals."""
    points: dict[int, int] = defaultdict(int)
    for fragment in members:
        points[fragment.object_id] += machine.points(fragment)
    return min(points, key=lambda object_id: (-points[object_id], object_id))


def _leading_pair(machine: MachineMap, members: Members) -> int | None:
    pairs = [
        object_id
        for object_id in {fragment.object_id for fragment in members}
        if len(machine.members[object_id]) > 1
        and machine.is_whole(object_id, members)
        and machine.objects[object_id].label in _STAYS
    ]
    if not pairs:
        return None
    return min(pairs, key=lambda i: (-sum(machine.points(f) for f in machine.members[i]), i))


def _became(
    machine: MachineMap, members: Members, sightings: tuple[Sighting, ...]
) -> tuple[ChangeLabel, float | None]:
    pair = _leading_pair(machine, members)
    if pair is not None:
        return machine.objects[pair].label, machine.objects[pair].displacement_m
    if len(sightings) > 1:
        before, after = (np.array(s.centroid_world_m) for s in (sightings[0], sightings[-1]))
        displacement = round(float(np.linalg.norm(after - before)), 6)
        moved = displacement > machine.tau_d_m
        return (ChangeLabel.MOVED if moved else ChangeLabel.STATIC), displacement
    votes: dict[ChangeLabel, int] = defaultdict(int)
    for fragment in members:
        votes[_vote(machine, members, fragment)] += machine.points(fragment)
    return min(votes, key=lambda label: (-votes[label], int(label))), None


def _vote(machine: MachineMap, members: Members, fragment: Fragment) -> ChangeLabel:
    if machine.is_whole(fragment.object_id, members):
        return machine.objects[fragment.object_id].label
    last = max(other.session for other in machine.members[fragment.object_id])
    return ChangeLabel.APPEARED if fragment.session == last else ChangeLabel.DISAPPEARED


def _sightings(machine: MachineMap, members: Members) -> tuple[Sighting, ...]:
    by_session: dict[int, list[Sighting]] = defaultdict(list)
    for fragment in sorted(members):
        sighting = machine.objects[fragment.object_id].sighting(fragment.session)
        if sighting is not None:
            by_session[fragment.session].append(sighting)
    return tuple(_joined(by_session[session]) for session in sorted(by_session))


def _joined(parts: list[Sighting]) -> Sighting:
    """Sightings of one visit as one; the largest leads where there can be only one value."""
    if len(parts) == 1:
        return parts[0]
    parts = sorted(parts, key=lambda part: -part.point_count)
    weights = np.array([max(part.point_count, 1) for part in parts], np.float64)
    centroid = np.average([part.centroid_world_m for part in parts], axis=0, weights=weights)
    low = np.min([part.box_min_world_m for part in parts], axis=0)
    high = np.max([part.box_max_world_m for part in parts], axis=0)
    keyframes = dict.fromkeys(keyframe for part in parts for keyframe in part.keyframes)
    return replace(
        parts[0],
        centroid_world_m=_triple(centroid),
        box_min_world_m=_triple(low),
        box_max_world_m=_triple(high),
        point_count=sum(part.point_count for part in parts),
        coverage=round(float(np.average([part.coverage for part in parts], weights=weights)), 6),
        keyframes=tuple(keyframes),
    )


def _counterpart(machine: MachineMap, base: MapObject, sightings: tuple[Sighting, ...]) -> int | None:
    """Instance of the counterpart in the other visit, as ``MapObject`` defines it."""
    if len(sightings) > 1:
        return sightings[-1].instance
    if len(base.sightings) > 1 and sightings:
        # Torn from its other visit, which stays the nearest candidate, now a rejected one.
        others = [s.instance for s in base.sightings if s.session != sightings[0].session]
        return others[0] if others else None
    return base.counterpart_instance


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 6) for value in values)
    return (x, y, z)
