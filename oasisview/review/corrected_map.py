"""The map after all decisions that stand: which fragments are one object, its label, who said so.

A pure function of the machine's map and the standing decisions in their order. A correction takes the
fragments that it names out of whatever they were in and makes its groups of them, so any sequence of
decisions gives a partition of all fragments, and without decisions the machine's. A label does the same for
the object that it was given to.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from oasisview.review.derived_object import derived_object
from oasisview.review.events import CORRECTIONS, Event, FinalLabel, Kind
from oasisview.review.fragments import Fragment, Members
from oasisview.review.machine_map import MachineMap
from oasisview.review.replacements import final_replaced
from pipeline.result import ChangeLabel, MapObject, ReplacedEvent


@dataclass(frozen=True)
class CorrectedObject:
    """An object after all corrections.

    Attributes:
        item: the object; its label is the machine's or what follows from a correction, its replaced events
            those of the corrected map.
        members: the fragments that it is made of.
        final: what it counts as, and who says so.
        cause: the correction that made it; None for an object as the machine found it.
    """

    item: MapObject
    members: Members
    final: FinalLabel
    cause: Event | None = None

    @property
    def machine_ids(self) -> tuple[int, ...]:
        """The machine's objects that it has fragments of, ascending."""
        return tuple(sorted({fragment.object_id for fragment in self.members}))


@dataclass(frozen=True)
class DroppedObject:
    """What somebody said is no object. ``object_id`` is the number that it would have."""

    object_id: int
    members: Members
    event: Event


@dataclass(frozen=True)
class CorrectedMap:
    """All objects after all corrections.

    Attributes:
        machine: what the corrections build on.
        objects: by object id, ascending.
        dropped: what is no object, ascending by number.
        replaced: replaced events between the final labels.
    """

    machine: MachineMap
    objects: Mapping[int, CorrectedObject]
    dropped: tuple[DroppedObject, ...]
    replaced: tuple[ReplacedEvent, ...]

    @cached_property
    def object_of(self) -> Mapping[Fragment, int]:
        """Object id of every fragment; 0 = no object."""
        found = {f: object_id for object_id, entry in self.objects.items() for f in entry.members}
        return found | {f: 0 for entry in self.dropped for f in entry.members}

    @cached_property
    def is_corrected(self) -> bool:
        """Whether any object differs from what the machine found."""
        return bool(self.dropped) or any(entry.cause is not None for entry in self.objects.values())

    def present_id(self, number: int) -> int | None:
        """The object that a number of any earlier state belongs to now; None if it is no object."""
        if number in self.objects:
            return number
        fragment = self.machine.fragment_of.get(number)
        return (self.object_of[fragment] or None) if fragment is not None else None

    def concerned(self, fragments: Iterable[Fragment]) -> frozenset[int]:
        """The objects that hold any of the fragments."""
        return frozenset(self.object_of.get(fragment, 0) for fragment in fragments) - {0}

    def table(self, session: int) -> NDArray[np.int32]:
        """Object id indexed by the machine's object id, for points and masks of a visit; 0 stays 0."""
        table = np.arange(max(self.machine.objects, default=0) + 1, dtype=np.int32)
        for fragment, object_id in self.object_of.items():
            if fragment.session == session:
                table[fragment.object_id] = object_id
        return table


@dataclass
class _Class:
    members: set[Fragment]
    is_object: bool = True
    cause: Event | None = None


@dataclass
class _Builder:
    """Fragments in classes, and labels by the exact fragments that they were given to."""

    machine: MachineMap
    class_of: dict[Fragment, _Class] = field(default_factory=dict)
    said: dict[Members, tuple[Event, ChangeLabel]] = field(default_factory=dict)

    def regroup(self, event: Event) -> None:
        for group in event.groups:
            self._gather(group.members, event, is_object=group.is_object)
            if group.label is not None:
                self.said[self._known(group.members)] = (event, group.label)

    def label(self, event: Event) -> None:
        """A label says as well that what it was given to is one object.

        So it keeps its object where a correction below it is taken back, or restored, by somebody else.
        """
        machine_members = self.machine.members.get(event.object_id, frozenset())
        members = self._known(event.groups[0].members if event.groups else machine_members)
        if members:
            present = self.class_of[min(members)]
            if present.members != members or not present.is_object:
                self._gather(members, event, is_object=True)
            self.said[members] = (event, event.new_label)

    def _known(self, members: Members) -> Members:
        """Without those of a result that was computed again, and has fewer objects."""
        return members.intersection(self.class_of)

    def _gather(self, members: Members, event: Event, *, is_object: bool) -> None:
        known = self._known(members)
        made = _Class(set(known), is_object, event)
        for fragment in known:
            torn = self.class_of[fragment]
            torn.members.discard(fragment)
            torn.cause = event
            self.class_of[fragment] = made


def corrected_map(machine: MachineMap, standing: Iterable[Event]) -> CorrectedMap:
    """The map that follows from decisions.

    Args:
        machine: what they were made on.
        standing: decisions that were not taken back, in the order of their numbers.
    """
    builder = _Builder(machine)
    for members in machine.members.values():
        found = _Class(set(members))
        builder.class_of.update(dict.fromkeys(members, found))
    for event in standing:
        if event.kind in CORRECTIONS:
            builder.regroup(event)
        elif event.kind in (Kind.LABEL, Kind.ACCEPT):
            builder.label(event)
    objects: dict[int, CorrectedObject] = {}
    dropped: list[DroppedObject] = []
    for entry in {id(found): found for found in builder.class_of.values()}.values():
        members = frozenset(entry.members)
        number = min(machine.number_of[fragment] for fragment in members)
        if entry.is_object:
            cause = None if machine.members.get(number) == members else entry.cause
            objects[number] = _object(machine, number, members, cause, builder.said.get(members))
        elif entry.cause is not None:
            dropped.append(DroppedObject(number, members, entry.cause))
    objects = {number: objects[number] for number in sorted(objects)}
    replaced = final_replaced(machine, objects)
    return CorrectedMap(
        machine,
        _with_replaced(objects, replaced),
        tuple(sorted(dropped, key=lambda entry: entry.object_id)),
        replaced,
    )


def _object(
    machine: MachineMap,
    number: int,
    members: Members,
    cause: Event | None,
    said: tuple[Event, ChangeLabel] | None,
) -> CorrectedObject:
    item = derived_object(machine, members, number)
    decision, label = said if said is not None else (cause, item.label)
    if decision is None:
        return CorrectedObject(item, members, FinalLabel(label, overridden=False))
    overridden = cause is not None or label is not item.label
    final = FinalLabel(label, overridden, decision.who, decision.at, decision.why, decision.id)
    return CorrectedObject(item, members, final, cause)


def _with_replaced(
    objects: Mapping[int, CorrectedObject], replaced: tuple[ReplacedEvent, ...]
) -> dict[int, CorrectedObject]:
    replaced_by = {event.disappeared_id: event.appeared_id for event in replaced}
    replaces = {event.appeared_id: event.disappeared_id for event in replaced}
    linked = {}
    for number, entry in objects.items():
        by, of = replaced_by.get(number), replaces.get(number)
        if (entry.item.replaced_by, entry.item.replaces) != (by, of):
            entry = replace(entry, item=replace(entry.item, replaced_by=by, replaces=of))
        linked[number] = entry
    return linked
