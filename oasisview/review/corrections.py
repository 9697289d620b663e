"""What people can say about identities, as groups of fragments for the journal; nothing is written here.

Every correction names all fragments of all objects that it concerns, so that what it means does not depend on
what is undone before it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from oasisview.review.corrected_map import CorrectedMap
from oasisview.review.events import Kind
from oasisview.review.fragments import Fragment, Group, Members
from pipeline.errors import InputError
from pipeline.result import ChangeLabel


@dataclass(frozen=True)
class Correction:
    """A correction that could be written.

    Attributes:
        object_id: the object that it is mainly about.
        concerned: the objects that it changes, by their present numbers.
    """

    kind: Kind
    object_id: int
    groups: tuple[Group, ...]
    concerned: tuple[int, ...]


def merge(state: CorrectedMap, object_ids: Sequence[int], label: ChangeLabel | None = None) -> Correction:
    """Several objects are pieces of one, on whatever visits they were seen."""
    chosen = tuple(dict.fromkeys(object_ids))
    if len(chosen) < 2:
        raise InputError("one object alone cannot be merged", "choose another object")
    members = frozenset().union(*(_members(state, object_id) for object_id in chosen))
    return Correction(Kind.MERGE, chosen[0], (Group(members, label),), chosen)


def same(state: CorrectedMap, one: int, other: int, label: ChangeLabel | None = None) -> Correction:
    """Two objects, one seen before and one seen now, are the same one.

    Where one of them was seen on both visits, its half on the visit of the other was matched wrongly and
    becomes an object of its own. ``label`` is static or moved as the person says; None = by its displacement.

    Raises:
        InputError: no such objects, or both were seen on the same visits.
    """
    first, second = _members(state, one), _members(state, other)
    if one == other:
        raise InputError("that is this object itself", "choose another object")
    if _sessions(first) == _sessions(second):
        raise InputError(
            f"objects {one} and {other} were seen on the same visits, so neither can have become the other",
            "merge them if they are pieces of one object",
        )
    if len(_sessions(first)) > len(_sessions(second)):
        first, second = second, first
    if not (_sessions(first) < _sessions(second) or _sessions(first).isdisjoint(_sessions(second))):
        raise InputError(
            f"objects {one} and {other} share some of their visits", "say first which of them are two"
        )
    left = frozenset(f for f in second if f.session in _sessions(first))
    groups = [Group(first | (second - left), label)]
    if left:
        groups.append(Group(left))
    return Correction(Kind.SAME, one, tuple(groups), (one, other))


def split_visits(state: CorrectedMap, object_id: int) -> Correction:
    """What was taken for one object on several visits is another one on each: one went, one came."""
    members = _members(state, object_id)
    sessions = sorted(_sessions(members))
    if len(sessions) < 2:
        raise InputError(
            f"object {object_id} was seen on one visit only", "there is nothing to part by visit"
        )
    groups = []
    for session in sessions:
        label = ChangeLabel.APPEARED if session == sessions[-1] else ChangeLabel.DISAPPEARED
        groups.append(Group(frozenset(f for f in members if f.session == session), label))
    return Correction(Kind.SPLIT, object_id, tuple(groups), (object_id,))


def take_apart(state: CorrectedMap, object_id: int) -> Correction:
    """A merged object is the pieces again that the machine found."""
    members = _members(state, object_id)
    by_machine = [
        frozenset(f for f in members if f.object_id == machine_id)
        for machine_id in sorted({f.object_id for f in members})
    ]
    if len(by_machine) < 2:
        raise InputError(f"object {object_id} was not merged", "there is nothing to take apart")
    return Correction(Kind.SPLIT, object_id, tuple(Group(part) for part in by_machine), (object_id,))


def drop(state: CorrectedMap, object_id: int) -> Correction:
    """No object at all: its points are background."""
    members = _members(state, object_id)
    return Correction(Kind.DROP, object_id, (Group(members, is_object=False),), (object_id,))


def keep(state: CorrectedMap, number: int) -> Correction:
    """What somebody dropped is an object after all."""
    found = next((entry for entry in state.dropped if entry.object_id == number), None)
    if found is None:
        raise InputError(f"nobody said that {number} is not an object", "look again, then decide")
    return Correction(Kind.KEEP, number, (Group(found.members),), (number,))


def _members(state: CorrectedMap, object_id: int) -> Members:
    entry = state.objects.get(object_id)
    if entry is None:
        raise InputError(f"the result has no object {object_id}", "choose an object of this result")
    return entry.members


def _sessions(members: Iterable[Fragment]) -> frozenset[int]:
    return frozenset(fragment.session for fragment in members)
