"""What a journal holds: events as they were written, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from pipeline.errors import OasisError
from pipeline.result import ChangeLabel


class Kind(StrEnum):
    """What a person did."""

    LABEL = "label"  # set the label of an object
    ACCEPT = "accept"  # confirmed the machine's label
    NOTE = "note"  # wrote something down, no label
    UNDO = "undo"  # took back an own decision
    REDO = "redo"  # restored what was taken back


@dataclass(frozen=True)
class Event:
    """One row of the journal, never changed once written.

    Attributes:
        id: 1, 2, 3, ... without gaps, in the order in which they became durable.
        at: UTC, ISO 8601 with milliseconds.
        who: the person.
        object_id: the object it is about.
        old_label, new_label: final label of the object before and what this event says or, for undo and
            redo, restores; equal for notes.
        why: the person's reason; may be empty.
        target_id: the decision that an undo or redo is about; else None.
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


@dataclass(frozen=True)
class Decision:
    """A label, acceptance or note, and whether it was undone since; fields as in :class:`Event`."""

    event_id: int
    at: str
    who: str
    kind: Kind
    object_id: int
    old_label: ChangeLabel
    new_label: ChangeLabel
    why: str
    undone: bool


@dataclass(frozen=True)
class FinalLabel:
    """What an object counts as after all decisions.

    Attributes:
        overridden: a person's label stands and differs from the machine's.
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
        did = f"set object {event.object_id} to {event.new_label.name.lower()}"
        super().__init__(
            f"{event.who} {did} at {event.at[11:16]} UTC, after you looked", "look again, then decide"
        )
