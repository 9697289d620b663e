"""The SQLite file under the journal: opened with suspicion, written durably, only ever appended to."""

from __future__ import annotations

import os
import sqlite3
import time
from contextlib import closing
from pathlib import Path

from oasisview.review.events import Event, Kind
from oasisview.review.fragments import decode, encode
from pipeline.errors import OasisError, ResultError, StorageError
from pipeline.result import ChangeLabel

SCHEMA_VERSION = 2
APPLICATION_ID = 0x4F415349  # "OASI" in the header tells our files from other programs'

_FIRST_COLUMNS = ("id", "at", "who", "kind", "object_id", "old_label", "new_label", "why", "target_id")
_COLUMNS = (*_FIRST_COLUMNS, "details")
_COLUMNS_OF_VERSION = {1: _FIRST_COLUMNS, 2: _COLUMNS}
# Which kinds there are is checked when rows are read: a new kind then needs no new schema.
_TABLE = """CREATE TABLE {name} (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        at TEXT NOT NULL,
        who TEXT NOT NULL,
        kind TEXT NOT NULL,
        object_id INTEGER NOT NULL,
        old_label INTEGER NOT NULL CHECK (old_label BETWEEN 0 AND 4),
        new_label INTEGER NOT NULL CHECK (new_label BETWEEN 0 AND 4),
        why TEXT NOT NULL,
        target_id INTEGER REFERENCES events (id),
        details TEXT NOT NULL DEFAULT ''
    )"""
_TRIGGERS = (
    """CREATE TRIGGER events_are_never_changed BEFORE UPDATE ON events
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END""",
    """CREATE TRIGGER events_are_never_removed BEFORE DELETE ON events
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END""",
)
_SCHEMA = (
    _TABLE.format(name="events"),
    *_TRIGGERS,
    f"PRAGMA application_id = {APPLICATION_ID}",
    f"PRAGMA user_version = {SCHEMA_VERSION}",
)
# A table's checks cannot be altered: the rows of version 1 are copied into a table of version 2.
_FROM_VERSION_1 = (
    _TABLE.format(name="events_2"),
    f"INSERT INTO events_2 ({', '.join(_FIRST_COLUMNS)}) SELECT {', '.join(_FIRST_COLUMNS)} FROM events",
    "DROP TABLE events",
    "ALTER TABLE events_2 RENAME TO events",
    *_TRIGGERS,
    f"PRAGMA user_version = {SCHEMA_VERSION}",
)
_MAGIC = b"SQLite format 3\0"
_HEADER_BYTES = 100
_MOVE_AWAY = "move it away to start a new journal, or restore it from a copy"


def exists(path: Path) -> bool:
    """Whether there is a journal to open; an empty file is what a crash before the first event leaves."""
    try:
        return path.stat().st_size > 0
    except FileNotFoundError:
        return False
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror or error}") from None


def open_existing(path: Path, busy_timeout_s: float) -> sqlite3.Connection:
    """Open a journal after looking at it read-only, so that a foreign file stays byte for byte as it is.

    Raises:
        ResultError: not a journal of oasisview, of a newer schema version, or damaged.
    """
    try:
        _check_header(path)
        with closing(_connect(path, busy_timeout_s, read_only=True)) as connection:
            _check_content(path, connection)
        return _connect(path, busy_timeout_s, read_only=not _writable(path))
    except sqlite3.DatabaseError as error:
        raise translated(path, error) from None
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror or error}") from None


def create(path: Path, busy_timeout_s: float) -> None:
    """Make an empty journal, whole or not at all; harmless when another process was faster."""
    try:
        with closing(_connect(path, busy_timeout_s)) as connection:
            # Still without WAL, so that the header that identifies the file is in the file itself.
            connection.execute("BEGIN IMMEDIATE")
            if connection.execute("PRAGMA user_version").fetchone()[0] == 0:
                for statement in _SCHEMA:
                    connection.execute(statement)
            connection.execute("COMMIT")
            _use_wal(connection, busy_timeout_s)
        descriptor = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(descriptor)  # else a power cut could forget the file's name
        finally:
            os.close(descriptor)
    except sqlite3.DatabaseError as error:
        raise translated(path, error) from None
    except OSError as error:
        raise StorageError(f"cannot write {path}: {error.strerror or error}") from None


def migrate(connection: sqlite3.Connection) -> None:
    """Bring a journal of an older schema up to this one, inside the caller's transaction: all or nothing.

    Only writers do it: a journal that is merely looked at stays as it is.
    """
    if _version(connection) == 1:
        for statement in _FROM_VERSION_1:
            connection.execute(statement)


def append(connection: sqlite3.Connection, event: Event) -> None:
    """Insert an event under the number it already carries; durable once the transaction commits."""
    connection.execute(
        f"INSERT INTO events ({', '.join(_COLUMNS)}) VALUES ({', '.join('?' * len(_COLUMNS))})",
        (
            event.id,
            event.at,
            event.who,
            event.kind.value,
            event.object_id,
            int(event.old_label),
            int(event.new_label),
            event.why,
            event.target_id,
            encode(event.groups),
        ),
    )


def read_events(connection: sqlite3.Connection, after: int) -> list[Event]:
    """Events with a number above ``after``, in order.

    Raises:
        ResultError: a row holds what no event can hold.
    """
    # All columns in one statement: another process may bring the schema up to date at any moment.
    rows = connection.execute("SELECT * FROM events WHERE id > ? ORDER BY id", (after,)).fetchall()
    rows = [row if len(row) == len(_COLUMNS) else (*row, "") for row in rows]
    try:
        return [
            Event(
                id=int(number),
                at=str(at),
                who=str(who),
                kind=Kind(kind),
                object_id=int(object_id),
                old_label=ChangeLabel(old_label),
                new_label=ChangeLabel(new_label),
                why=str(why),
                target_id=None if target_id is None else int(target_id),
                groups=decode(str(details)),
            )
            for number, at, who, kind, object_id, old_label, new_label, why, target_id, details in rows
        ]
    except (TypeError, ValueError) as error:
        raise ResultError(f"the journal of decisions is damaged: {error}", _MOVE_AWAY) from None


def translated(path: Path, error: sqlite3.DatabaseError) -> OasisError:
    """What went wrong in SQLite, in one finished line."""
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
        return StorageError(f"{path} is held by another program", "try again in a moment")
    if code == sqlite3.SQLITE_FULL:
        return StorageError(f"cannot write {path}: the disk is full", "free some space and decide again")
    if code in (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM, sqlite3.SQLITE_CANTOPEN):
        return StorageError(f"cannot write {path}: permission denied", "make the result folder writable")
    if code in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB):
        return ResultError(f"{path} is damaged ({error})", _MOVE_AWAY)
    return StorageError(f"cannot use {path}: {error}", "check the disk and the folder's permissions")


def _version(connection: sqlite3.Connection) -> int:
    return int(connection.execute("PRAGMA user_version").fetchone()[0])


def _writable(path: Path) -> bool:
    return os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)


def _connect(path: Path, busy_timeout_s: float, *, read_only: bool = False) -> sqlite3.Connection:
    uri = f"{path.resolve().as_uri()}?mode={'ro' if read_only else 'rwc'}"
    if read_only and not _writable(path) and not path.with_name(path.name + "-wal").exists():
        uri += "&immutable=1"  # WAL needs a companion file that cannot be made on read-only media
    connection = sqlite3.connect(
        uri, uri=True, timeout=busy_timeout_s, isolation_level=None, check_same_thread=False
    )
    connection.execute("PRAGMA synchronous = FULL")
    return connection


def _use_wal(connection: sqlite3.Connection, busy_timeout_s: float) -> None:
    """Switch to write-ahead logging; where a file system cannot, SQLite stays with its rollback journal."""
    deadline = time.monotonic() + busy_timeout_s
    while True:
        try:
            connection.execute("PRAGMA journal_mode = WAL")
            return
        except sqlite3.OperationalError:  # the busy timeout does not cover this statement
            if time.monotonic() > deadline:
                raise
            time.sleep(0.02)


def _check_header(path: Path) -> None:
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    if path.with_name(path.name + "-journal").exists():
        return  # creation was cut off; SQLite first rolls it back
    if len(header) < _HEADER_BYTES or not header.startswith(_MAGIC):
        raise ResultError(f"{path} is not a journal of decisions, or is damaged", _MOVE_AWAY)
    if int.from_bytes(header[68:72], "big") != APPLICATION_ID:
        raise ResultError(f"{path} is a database of another program", _MOVE_AWAY)
    _check_version(path, int.from_bytes(header[60:64], "big"))


def _check_content(path: Path, connection: sqlite3.Connection) -> None:
    version = _version(connection)
    _check_version(path, version)
    (verdict,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    columns = tuple(row[1] for row in connection.execute("PRAGMA table_info(events)"))
    if verdict != "ok" or columns != _COLUMNS_OF_VERSION.get(version):
        raise ResultError(f"{path} is damaged", _MOVE_AWAY)


def _check_version(path: Path, version: int) -> None:
    if version > SCHEMA_VERSION:
        raise ResultError(
            f"{path} was written by a newer oasisview (schema {version}, this one reads {SCHEMA_VERSION})",
            "update oasisview",
        )
