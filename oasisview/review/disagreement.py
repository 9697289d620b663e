"""Where people disagree: their latest decisions that count say different things about the same part.

Everybody's own latest word counts; that a later one overrules in the map does not make it agreed.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from oasisview.review.corrected_map import CorrectedMap
from oasisview.review.events import CORRECTIONS, Event, Kind
from oasisview.review.fragments import Fragment, Members
from oasisview.review.machine_map import MachineMap
from pipeline.result import ChangeLabel


@dataclass(frozen=True)
class Opinion:
    """What one person says about a part of the map.

    Attributes:
        members: what it is one object with, itself included.
        label: what became of that; None where the person said nothing about it.
        is_object: False = no object at all.
        event_id: the decision that says so.
    """

    who: str
    members: Members
    label: ChangeLabel | None
    is_object: bool
    event_id: int

    def contradicts(self, other: Opinion) -> bool:
        """Whether both cannot be right."""
        if self.is_object != other.is_object:
            return True
        if not self.is_object:
            return False
        if self.members != other.members:
            return True
        return None not in (self.label, other.label) and self.label is not other.label


def disagreements(state: CorrectedMap, standing: Sequence[Event]) -> dict[int, tuple[Opinion, ...]]:
    """Opinions that contradict each other, oldest first, by object id (of what was dropped: its number).

    Args:
        state: the map with the decisions applied.
        standing: the decisions that count, in their order.
    """
    latest: dict[Fragment, dict[str, Opinion]] = defaultdict(dict)
    for event in standing:
        for opinion in _opinions(event, state.machine):
            for fragment in opinion.members:
                latest[fragment][event.who] = opinion
    parts: list[tuple[int, Members]] = [(number, e.members) for number, e in state.objects.items()]
    parts += [(entry.object_id, entry.members) for entry in state.dropped]
    found = {}
    for number, members in parts:
        opinions = _contradicting(latest, members)
        if opinions:
            found[number] = opinions
    return found


def _contradicting(latest: Mapping[Fragment, Mapping[str, Opinion]], members: Members) -> tuple[Opinion, ...]:
    found: dict[str, Opinion] = {}
    for fragment in sorted(members):
        voices = latest.get(fragment, {})
        for opinion in voices.values():
            if any(opinion.contradicts(other) for other in voices.values()):
                found.setdefault(opinion.who, opinion)
    return tuple(sorted(found.values(), key=lambda opinion: opinion.event_id))


def _opinions(event: Event, machine: MachineMap) -> Iterable[Opinion]:
    if event.kind in CORRECTIONS:
        for group in event.groups:
            yield Opinion(event.who, group.members, group.label, group.is_object, event.id)
    elif event.kind in (Kind.LABEL, Kind.ACCEPT):
        members = event.groups[0].members if event.groups else machine.members.get(event.object_id)
        if members:
            yield Opinion(event.who, members, event.new_label, True, event.id)
