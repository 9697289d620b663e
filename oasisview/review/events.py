"""What a journal holds: events as they were written, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from oasisview.review.fragments import Group
from pipeline.errors import OasisError
from pipeline.result import ChangeLabel


class Kind(StrEnum):
    """What a person did."""

    LABEL = "label"  # set the label of an object
    ACCEPT = "accept"  # confirmed the machine's label
    NOTE = "note"  # wrote something down, no label
    UNDO = "undo"  # took back an own decision
    REDO = "redo"  # restored what was taken back
    MERGE = "merge"  # said that several objects are pieces of one
    SAME = "same"  # said that an object before and an object now are the same one
    SPLIT = "split"  # said that what was one object is two or more
    DROP = "drop"  # said that it is no object
    KEEP = "keep"  # said that what was dropped is an object
    RESTORE = "restore"  # went back to an earlier state
    WHAT_IF = "what_if"  # took over what other limits would say, of many objects at once


CORRECTIONS = frozenset({Kind.MERGE, Kind.SAME, Kind.SPLIT, Kind.DROP, Kind.KEEP, Kind.WHAT_IF})
DECISIONS = CORRECTIONS | {Kind.LABEL, Kind.ACCEPT, Kind.NOTE, Kind.RESTORE}


@dataclass(frozen=True)
class Event:
    """One row of the journal, never changed once written.

    Attributes:
        id: 1, 2, 3, ... without gaps, in the order in which they became durable.
        at: UTC, ISO 8601 with milliseconds.
        who: the person.
        object_id: the object it is about, by its number at that time; 0 for a restored state.
        old_label, new_label: final label of the object before and what this event says or, for undo and
            redo, restores; equal for notes.
        why: the person's reason; may be empty.
        target_id: the decision that an undo or redo is about, or the event after which the restored state
            was; None for other kinds, and for the state before the first event.
        groups: what a correction made of the fragments concerned; for a label of a corrected object that
            object's fragments; empty for an object as the machine found it.
    """

    id: int
    at: str
    who: str
    kind: Kind
    object_id: int
    old_label: ChangeLabel
    new_label: ChangeLabel
    why: str
    target_id: int | None
    groups: tuple[Group, ...] = ()


@dataclass(frozen=True)
class Decision:
    """Anything that a person did but undo and redo, and whether it counts; fields as in :class:`Event`.

    ``undone``: it was taken back, by its author or by a restored earlier state.
    """

    event_id: int
    at: str
    who: str
    kind: Kind
    object_id: int
    old_label: ChangeLabel
    new_label: ChangeLabel
    why: str
    undone: bool
    groups: tuple[Group, ...] = ()


@dataclass(frozen=True)
class FinalLabel:
    """What an object counts as after all decisions.

    Attributes:
        overridden: a person's label stands and differs from the machine's, or the object itself is another
            than the machine found.
        decided_by, decided_at, why: of the standing decision; None where nobody decided.
        event_id: the standing decision; None where nobody decided.
    """

    label: ChangeLabel
    overridden: bool
    decided_by: str | None = None
    decided_at: str | None = None
    why: str | None = None
    event_id: int | None = None


class ConflictError(OasisError):
    """Somebody else decided on the object after what the caller had seen; nothing was written.

    Attributes:
        event: the other person's latest event about the object.
    """

    def __init__(self, event: Event) -> None:
        self.event = event
        super().__init__(
            f"{event.who} {_did(event)} at {event.at[11:16]} UTC, after you looked",
            "look again, then decide",
        )


def _did(event: Event) -> str:
    number = event.object_id
    return {
        Kind.MERGE: f"merged object {number} with others",
        Kind.SAME: f"said that object {number} is the same as another",
        Kind.SPLIT: f"split object {number}",
        Kind.DROP: f"said that object {number} is not an object",
        Kind.KEEP: f"said that object {number} is an object",
        Kind.RESTORE: "went back to an earlier state",
        Kind.WHAT_IF: "applied other limits to many objects",
    }.get(event.kind, f"set object {number} to {event.new_label.name.lower()}")
