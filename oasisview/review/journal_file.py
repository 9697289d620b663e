"""A journal's file while it is open: followed event by event, written in transactions, by any thread."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

from oasisview.review import database
from oasisview.review.machine_map import MachineMap
from oasisview.review.replay import Replay
from pipeline.errors import ResultError
from pipeline.result import ChangeLabel

BUSY_TIMEOUT_S = 10.0
_Returned = TypeVar("_Returned")


class JournalFile:
    """The events of a file, replayed. The file is made with the first event, not before."""

    def __init__(
        self,
        path: str | Path,
        machine: Mapping[int, ChangeLabel] | MachineMap,
        *,
        busy_timeout_s: float = BUSY_TIMEOUT_S,
    ) -> None:
        """Open the journal at ``path``, or get ready to make it.

        Args:
            path: ``review.sqlite`` in the result folder.
            machine: what the machine found; the labels by object id are enough where nothing is corrected
                but labels.
            busy_timeout_s: how long to wait for another process that is writing.

        Raises:
            ResultError: the file is damaged, foreign or of a newer schema; it stays as it is.
        """
        self.path = Path(path)
        self._machine = machine if isinstance(machine, MachineMap) else MachineMap.of_labels(machine)
        self._busy_timeout_s = busy_timeout_s
        self._lock = threading.RLock()
        self._replay = Replay(self._machine)
        self._connection: sqlite3.Connection | None = None
        self._inode: tuple[int, int] | None = None
        with self._lock:
            self._follow()

    def __enter__(self) -> Self:
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
                    database.migrate(connection)
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
            self._replay = Replay(self._machine)
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
