"""Inspectors' decisions on a result: durable, attributed, undoable without limit.

The journal is ``review.sqlite`` beside ``result.json``. Nothing in it is ever changed or removed; undo is
an event like any other, and the state is a replay of all events (``oasisview.review.replay`` defines
what undo means when several people work at once). Methods may be called from any thread, and other
processes may read and write the same file at the same time. When a method returns, what it did is on
the disk.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from oasisview.review import database
from oasisview.review.corrected_map import CorrectedMap, CorrectedObject
from oasisview.review.corrected_result import CorrectedResult
from oasisview.review.disagreement import Opinion, disagreements
from oasisview.review.events import CORRECTIONS, ConflictError, Decision, Event, FinalLabel, Kind
from oasisview.review.fragments import Group, Members, all_members
from oasisview.review.journal_file import JournalFile
from oasisview.review.machine_map import MachineMap
from oasisview.review.people import checked_name, checked_reason, one_line
from oasisview.review.replay import Change, Replay
from pipeline.errors import InputError
from pipeline.result import ChangeLabel, Result

REVIEW_FILE = "review.sqlite"


@dataclass(frozen=True)
class Snapshot:
    """What follows from the decisions.

    Attributes:
        corrected: the map with all of them applied.
        disagreements: opinions that contradict each other, by object id.
        undone: numbers of the decisions that do not count.
    """

    corrected: CorrectedMap
    disagreements: Mapping[int, tuple[Opinion, ...]]
    undone: frozenset[int]


class Journal(JournalFile):
    """All decisions about one result. The file is made with the first decision, not before."""

    @classmethod
    def of(cls, result: Result) -> Journal:
        """The journal of a result."""
        machine = result.machine if isinstance(result, CorrectedResult) else result
        return cls(result.path / REVIEW_FILE, MachineMap.of(machine))

    # What people do

    def decide(
        self,
        object_id: int,
        label: ChangeLabel | int,
        *,
        who: str,
        why: str = "",
        expected_event_id: int | None = None,
    ) -> Decision:
        """Set the label of an object.

        Args:
            expected_event_id: the last event that ``who`` had seen (``last_event_id`` at that time);
                None = decide whatever others did meanwhile.

        Raises:
            ConflictError: somebody else decided on the object after ``expected_event_id``, or took back or
                restored such a decision.
            InputError: no such object or label, no name, or too long a reason.
            StorageError: it could not be saved; the journal is unchanged.
        """
        return self._decide(Kind.LABEL, object_id, _label(label), who, why, expected_event_id)

    def accept(
        self, object_id: int, *, who: str, why: str = "", expected_event_id: int | None = None
    ) -> Decision:
        """Confirm the machine's label of an object; raises like :meth:`decide`."""
        entry = self.corrected().objects.get(object_id)
        label = entry.item.label if entry is not None else ChangeLabel.UNKNOWN
        return self._decide(Kind.ACCEPT, object_id, label, who, why, expected_event_id)

    def correct(
        self,
        kind: Kind,
        object_id: int,
        groups: Sequence[Group],
        *,
        who: str,
        why: str = "",
        expected_event_id: int | None = None,
    ) -> Decision:
        """Say which fragments are one object, or none (``oasisview.review.corrections`` makes the groups).

        Args:
            kind: one of ``CORRECTIONS``.
            object_id: the object that it is mainly about, by its present number.
            groups: what becomes of the fragments concerned; no fragment twice.

        Raises:
            ConflictError: somebody else decided on any object concerned after ``expected_event_id``.
            InputError: no such fragments, no name, or too long a reason.
            StorageError: it could not be saved; the journal is unchanged.
        """
        who, why = checked_name(who), checked_reason(why)
        members = all_members(groups)
        if kind not in CORRECTIONS or not members or sum(len(g.members) for g in groups) != len(members):
            raise InputError("that is no correction", "name every part of the objects concerned once")
        if not members <= self._machine.number_of.keys():
            raise InputError("the result has no such parts of objects", "choose objects of this result")
        with self._transaction() as connection:
            self._check_unchanged(members, who, expected_event_id)
            before = self._replay.state()
            event = self._event(who, kind, object_id, ChangeLabel.UNKNOWN, ChangeLabel.UNKNOWN, why, None)
            event = replace(event, groups=tuple(groups))
            after = self._replay.state_with(event)
            event = replace(
                event,
                old_label=_label_in(before, members, object_id),
                new_label=_label_in(after, groups[0].members, object_id),
            )
            database.append(connection, event)
        return self._written(event.id)

    def restore(
        self, event_id: int, *, who: str, why: str = "", expected_event_id: int | None = None
    ) -> Decision | None:
        """Go back to the state after an event, 0 = to what the machine found; None if it is that state.

        Everybody's decisions since then end to count, and those that were taken back since count again;
        nothing is erased, and undo brings it all back.

        Raises:
            ConflictError: somebody else did anything after ``expected_event_id``.
            InputError: there is no such event, no name, or too long a reason.
            StorageError: it could not be saved; the journal is unchanged.
        """
        who, why = checked_name(who), checked_reason(why)
        if not 0 <= event_id <= self.last_event_id:
            raise InputError(f"the journal has no entry {event_id}", "choose an entry of the list")
        if self.restoring(event_id) == Change(frozenset(), frozenset()):
            return None
        with self._transaction() as connection:
            if expected_event_id is not None:
                others = [e for e in self._replay.events[expected_event_id:] if e.who != who]
                if others:
                    raise ConflictError(others[-1])
            unknown = ChangeLabel.UNKNOWN
            event = self._event(who, Kind.RESTORE, 0, unknown, unknown, why, event_id or None)
            database.append(connection, event)
        return self._written(event.id)

    def note(self, object_id: int, text: str, *, who: str) -> Decision:
        """Write something down about an object without deciding; raises like :meth:`decide`."""
        if not one_line(text):
            raise InputError("the note is empty", "write at least a word")
        return self._decide(Kind.NOTE, object_id, None, who, text, None)

    def undo(self, who: str) -> Decision | None:
        """Take back that person's latest decision or note that stands; None when there is none."""
        return self._turn(Kind.UNDO, who)

    def redo(self, who: str) -> Decision | None:
        """Restore what that person undid last; None when nothing is left to redo."""
        return self._turn(Kind.REDO, who)

    # What follows from it

    def can_undo(self, who: str) -> bool:
        """Whether undo would do something."""
        return self._asked(lambda replay: replay.undoable(checked_name(who)) is not None)

    def can_redo(self, who: str) -> bool:
        """Whether redo would do something."""
        return self._asked(lambda replay: replay.redoable(checked_name(who)) is not None)

    @property
    def last_event_id(self) -> int:
        """Number of the latest event; 0 without any."""
        return self._asked(lambda replay: replay.last_event_id)

    def decisions(self) -> tuple[Decision, ...]:
        """All labels, acceptances and notes, undone ones included, in the order they were made."""
        return self._asked(Replay.decisions)

    def corrected(self) -> CorrectedMap:
        """The map with all decisions applied."""
        return self._asked(Replay.state)

    def snapshot(self) -> Snapshot:
        """Everything that follows from the decisions, as of one moment."""
        return self._asked(
            lambda replay: Snapshot(
                replay.state(),
                disagreements(replay.state(), replay.standing_events()),
                frozenset(d.event_id for d in replay.decisions() if d.undone),
            )
        )

    def final_labels(self) -> dict[int, FinalLabel]:
        """Final label of every object of the corrected map."""
        return {number: entry.final for number, entry in self.corrected().objects.items()}

    def preview(self, kind: Kind, object_id: int, groups: Sequence[Group]) -> CorrectedMap:
        """The map that a correction would give; nothing is written."""
        unknown = ChangeLabel.UNKNOWN

        def imagine(replay: Replay) -> CorrectedMap:
            event = Event(
                replay.last_event_id + 1, "", "", kind, object_id, unknown, unknown, "", None, tuple(groups)
            )
            return replay.state_with(event)

        return self._asked(imagine)

    def restoring(self, event_id: int) -> Change:
        """Which decisions :meth:`restore` would take away and bring back."""
        return self._asked(lambda replay: replay.restoring(event_id))

    def undoable(self, who: str) -> Event | None:
        """What undo would take back."""
        return self._asked(lambda replay: replay.undoable(checked_name(who)))

    def fragments_of(self, event: Event) -> Members:
        """The fragments that an event changes something about."""
        return self._asked(lambda replay: replay.concerned_by(event))

    def changes_since(self, event_id: int) -> tuple[Event, ...]:
        """Events after ``event_id`` (0 = all), those of other processes included."""
        return self._asked(lambda replay: tuple(replay.events[max(event_id, 0) :]))

    # How it is written

    def _decide(
        self,
        kind: Kind,
        object_id: int,
        label: ChangeLabel | None,
        who: str,
        why: str,
        expected_event_id: int | None,
    ) -> Decision:
        who, why = checked_name(who), checked_reason(why)
        self._asked(lambda replay: _entry(replay, object_id))  # refused before a file is made for it
        with self._transaction() as connection:
            entry = _entry(self._replay, object_id)
            self._check_unchanged(entry.members, who, expected_event_id)
            old = entry.final.label
            new = old if label is None else label
            event = self._event(who, kind, int(object_id), old, new, why, None)
            if self._machine.members.get(object_id) != entry.members:
                event = replace(event, groups=(Group(entry.members),))
            database.append(connection, event)
        return self._written(event.id)

    def _turn(self, kind: Kind, who: str) -> Decision | None:
        who = checked_name(who)
        if not (self.can_undo(who) if kind is Kind.UNDO else self.can_redo(who)):
            return None
        with self._transaction() as connection:
            undo = kind is Kind.UNDO
            target = self._replay.undoable(who) if undo else self._replay.redoable(who)
            if target is None:  # the same person did it in another window meanwhile
                return None
            members = self._replay.fragments(target)
            old = _label_in(self._replay.state(), members, target.object_id)
            new = _label_in(self._replay.state_if_turned(target, stands=not undo), members, target.object_id)
            event = self._event(who, kind, target.object_id, old, new, "", target.id)
            database.append(connection, event)
        return self._written(target.id)

    def _check_unchanged(self, members: Members, who: str, expected_event_id: int | None) -> None:
        if expected_event_id is None:
            return
        other = self._replay.latest_by_others(members, who)
        if other is not None and other.id > expected_event_id:
            raise ConflictError(other)

    def _written(self, event_id: int) -> Decision:
        with self._lock:
            self._follow()
            return self._replay.decision(event_id)

    def _event(
        self,
        who: str,
        kind: Kind,
        object_id: int,
        old: ChangeLabel,
        new: ChangeLabel,
        why: str,
        target_id: int | None,
    ) -> Event:
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        return Event(self._replay.last_event_id + 1, at, who, kind, object_id, old, new, why, target_id)


def _label(label: ChangeLabel | int) -> ChangeLabel:
    try:
        return ChangeLabel(label)
    except ValueError:
        raise InputError(f"there is no label {label!r}", "labels are 0 to 4") from None


def _entry(replay: Replay, object_id: int) -> CorrectedObject:
    entry = replay.state().objects.get(object_id)
    if entry is None:
        raise InputError(f"the result has no object {object_id}", "choose an object of this result")
    return entry


def _label_in(state: CorrectedMap, members: Members, object_id: int) -> ChangeLabel:
    """The label of what an event is about: its object if it is there, else the one of its first fragment."""
    if object_id not in state.objects or not state.objects[object_id].members & members:
        numbers = sorted(state.concerned(members))
        if not numbers:  # no object any more: background, which is static
            return ChangeLabel.STATIC if members else ChangeLabel.UNKNOWN
        object_id = numbers[0]
    return state.objects[object_id].final.label
