"""Inspectors' decisions on a result: durable, attributed, undoable without limit.

The journal is ``review.sqlite`` beside ``result.json``. Nothing in it is ever changed or removed; undo is
an event like any other, and the state is a replay of all events (``oasisview.review.replay`` defines
what undo means when several people work at once). Methods may be called from any thread, and other
processes may read and write the same file at the same time. When a method returns, what it did is on
the disk.
"""

from __future__ import annotations

import sqlite3
import threading
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from oasisview.review import database
from oasisview.review.events import ConflictError, Decision, Event, FinalLabel, Kind
from oasisview.review.replay import Replay
from pipeline.errors import InputError, ResultError
from pipeline.result import ChangeLabel, Result

REVIEW_FILE = "review.sqlite"
MAX_WHO_LENGTH = 80
MAX_WHY_LENGTH = 500
BUSY_TIMEOUT_S = 10.0

# Bidirectional overrides: a name or reason must not be able to turn the text around it.
_BIDIRECTIONAL = frozenset("\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
_Returned = TypeVar("_Returned")


class Journal:
    """All decisions about one result. The file is made with the first decision, not before."""

    def __init__(
        self,
        path: str | Path,
        machine: Mapping[int, ChangeLabel],
        *,
        busy_timeout_s: float = BUSY_TIMEOUT_S,
    ) -> None:
        """Open the journal at ``path``, or get ready to make it.

        Args:
            path: ``review.sqlite`` in the result folder.
            machine: the machine's label of every object of the result, by object id.
            busy_timeout_s: how long to wait for another process that is writing.

        Raises:
            ResultError: the file is damaged, foreign or of a newer schema; it stays as it is.
        """
        self.path = Path(path)
        self._machine = dict(machine)
        self._busy_timeout_s = busy_timeout_s
        self._lock = threading.RLock()
        self._replay = Replay()
        self._connection: sqlite3.Connection | None = None
        self._inode: tuple[int, int] | None = None
        with self._lock:
            self._follow()

    @classmethod
    def of(cls, result: Result) -> Journal:
        """The journal of a result."""
        return cls(result.path / REVIEW_FILE, {item.object_id: item.label for item in result.objects})

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file; a later call opens it again."""
        with self._lock:
            if self._connection is not None:
                self._connection.close()
            self._connection = None

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
        label = self._machine.get(object_id, ChangeLabel.UNKNOWN)
        return self._decide(Kind.ACCEPT, object_id, label, who, why, expected_event_id)

    def note(self, object_id: int, text: str, *, who: str) -> Decision:
        """Write something down about an object without deciding; raises like :meth:`decide`."""
        if not _cleaned(text):
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
        return self._asked(lambda replay: replay.undoable(_name(who)) is not None)

    def can_redo(self, who: str) -> bool:
        """Whether redo would do something."""
        return self._asked(lambda replay: replay.redoable(_name(who)) is not None)

    @property
    def last_event_id(self) -> int:
        """Number of the latest event; 0 without any."""
        return self._asked(lambda replay: replay.last_event_id)

    def decisions(self) -> tuple[Decision, ...]:
        """All labels, acceptances and notes, undone ones included, in the order they were made."""
        return self._asked(Replay.decisions)

    def final_labels(self, machine: Mapping[int, ChangeLabel] | None = None) -> dict[int, FinalLabel]:
        """Final label of every object; ``machine`` = the machine's labels if not those of the result."""
        return self._asked(lambda replay: replay.final_labels(self._machine if machine is None else machine))

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
        who, why = _name(who), _reason(why)
        if object_id not in self._machine:
            raise InputError(f"the result has no object {object_id}", "choose an object of this result")
        with self._transaction() as connection:
            if expected_event_id is not None:
                other = self._replay.latest_by_others(object_id, who)
                if other is not None and other.id > expected_event_id:
                    raise ConflictError(other)
            old = self._label_of(object_id)
            new = old if label is None else label
            event = self._event(who, kind, int(object_id), old, new, why, None)
            database.append(connection, event)
        with self._lock:
            self._follow()
            return self._replay.decision(event.id)

    def _turn(self, kind: Kind, who: str) -> Decision | None:
        who = _name(who)
        if not (self.can_undo(who) if kind is Kind.UNDO else self.can_redo(who)):
            return None
        with self._transaction() as connection:
            undo = kind is Kind.UNDO
            target = self._replay.undoable(who) if undo else self._replay.redoable(who)
            if target is None:  # the same person did it in another window meanwhile
                return None
            old = self._label_of(target.object_id)
            new = self._label_of(
                target.object_id, without=target.id if undo else 0, restored=0 if undo else target.id
            )
            event = self._event(who, kind, target.object_id, old, new, "", target.id)
            database.append(connection, event)
        with self._lock:
            self._follow()
            return self._replay.decision(target.id)

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

    def _label_of(self, object_id: int, *, without: int = 0, restored: int = 0) -> ChangeLabel:
        event = self._replay.standing(object_id, without=without, restored=restored)
        if event is not None:
            return event.new_label
        return self._machine.get(object_id, ChangeLabel.UNKNOWN)

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        """The only writer of all processes, with every earlier event replayed."""
        with self._lock:
            if self._connection is None and not database.exists(self.path):
                database.create(self.path, self._busy_timeout_s)
            self._follow()
            connection = self._connection
            assert connection is not None
            self._check_in_place()
            try:
                connection.execute("BEGIN IMMEDIATE")
                try:
                    self._follow()
                    yield connection
                    connection.execute("COMMIT")
                except BaseException:
                    if connection.in_transaction:
                        connection.execute("ROLLBACK")
                    raise
            except sqlite3.DatabaseError as error:
                raise database.translated(self.path, error) from None

    def _follow(self) -> None:
        """Replay what this or another process has written since; the lock is held."""
        if self._connection is None:
            if not database.exists(self.path):
                return
            self._connection = database.open_existing(self.path, self._busy_timeout_s)
            self._inode = self._inode_on_disk()
            self._replay = Replay()
        try:
            events = database.read_events(self._connection, self._replay.last_event_id)
        except sqlite3.DatabaseError as error:
            raise database.translated(self.path, error) from None
        for event in events:
            self._replay.apply(event)

    def _check_in_place(self) -> None:
        """Refuse to write into a file that nobody will find again and call that saved."""
        if self._inode_on_disk() != self._inode:
            raise ResultError(
                f"{self.path} was replaced or removed since it was opened", "close and open the result again"
            )

    def _inode_on_disk(self) -> tuple[int, int] | None:
        try:
            status = self.path.stat()
        except OSError:
            return None
        return status.st_dev, status.st_ino

    def _asked(self, question: Callable[[Replay], _Returned]) -> _Returned:
        with self._lock:
            self._follow()
            return question(self._replay)


def _label(label: ChangeLabel | int) -> ChangeLabel:
    try:
        return ChangeLabel(label)
    except ValueError:
        raise InputError(f"there is no label {label!r}", "labels are 0 to 4") from None


def _name(who: str) -> str:
    name = _cleaned(who)
    if not name:
        raise InputError("a decision needs the name of who decides", "say who you are")
    if len(name) > MAX_WHO_LENGTH:
        raise InputError(
            f"the name is {len(name)} characters long", f"use at most {MAX_WHO_LENGTH} characters"
        )
    return name


def _reason(why: str) -> str:
    reason = _cleaned(why)
    if len(reason) > MAX_WHY_LENGTH:
        raise InputError(
            f"the reason is {len(reason)} characters long", f"use at most {MAX_WHY_LENGTH} characters"
        )
    return reason


def _cleaned(text: str) -> str:
    """One line of printable text: line breaks become spaces, control characters and lone surrogates go."""
    spaced = "".join(" " if character.isspace() else character for character in text)
    kept = (
        character
        for character in spaced
        if unicodedata.category(character) not in ("Cc", "Cs") and character not in _BIDIRECTIONAL
    )
    return " ".join("".join(kept).split())
