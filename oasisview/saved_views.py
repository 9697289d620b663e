"""Viewpoints that people keep for a result: named, shared by everybody who opens it.

They stand in a small database beside the journal, whose name makes a new run of the result keep it
(``pipeline.store.swap``). Several processes may use it at the same time.
"""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from pipeline.errors import ResultError, StorageError

VIEWS_FILE = "review-viewpoints.sqlite"
MAX_VIEWS = 500
BUSY_TIMEOUT_S = 5.0
_SCHEMA = (
    "CREATE TABLE IF NOT EXISTS viewpoint (id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL, "
    "who TEXT NOT NULL, at TEXT NOT NULL, content TEXT NOT NULL)"
)
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class ViewState:
    """What a view shows.

    Attributes:
        position, target: camera and what it looks at, world, metres.
        mode: before, after or both.
        selected: object id, or None.
        cut: low and high sides of the cut (x, y, height), metres; None where the map is whole.
    """

    position: Triple
    target: Triple
    mode: str
    selected: int | None = None
    cut: tuple[Triple, Triple] | None = None


@dataclass(frozen=True)
class SavedView:
    """A named view; ``at`` is UTC in ISO 8601."""

    view_id: int
    name: str
    who: str
    at: str
    state: ViewState


class SavedViews:
    """The views of one result. Methods touch the disk: never call them on the event loop."""

    def __init__(self, result_path: Path) -> None:
        self._path = result_path / VIEWS_FILE
        self._lock = threading.Lock()
        self._listeners: list[Callable[[], None]] = []

    def all(self) -> tuple[SavedView, ...]:
        """Oldest first; entries that cannot be read are left out.

        Raises:
            ResultError: the file is damaged or something else.
        """
        if not self._path.exists():
            return ()
        with self._open("reading") as connection:
            connection.execute(_SCHEMA)
            rows = connection.execute(
                "SELECT id, name, who, at, content FROM viewpoint ORDER BY id"
            ).fetchall()
        return tuple(view for row in rows if (view := _view(*row)) is not None)

    def add(self, name: str, who: str, state: ViewState) -> None:
        """Keep a view; it is on the disk when this returns.

        Raises:
            StorageError: it could not be saved, or there are too many.
            ResultError: as :meth:`all`.
        """
        at = datetime.now(UTC).isoformat(timespec="seconds")
        with self._open("saving") as connection:
            connection.execute(_SCHEMA)
            (count,) = connection.execute("SELECT count(*) FROM viewpoint").fetchone()
            if count >= MAX_VIEWS:
                raise StorageError(f"there are {count} saved views already", "remove some first")
            connection.execute(
                "INSERT INTO viewpoint (name, who, at, content) VALUES (?, ?, ?, ?)",
                (name, who, at, json.dumps(asdict(state))),
            )
        self._tell()

    def remove(self, view_id: int) -> None:
        """Forget a view; raises as :meth:`add`."""
        if self._path.exists():
            with self._open("removing") as connection:
                connection.execute(_SCHEMA)
                connection.execute("DELETE FROM viewpoint WHERE id = ?", (view_id,))
            self._tell()

    def subscribe(self, listener: Callable[[], None]) -> None:
        """Call ``listener`` when views of this process change."""
        with self._lock:
            self._listeners.append(listener)

    def unsubscribe(self, listener: Callable[[], None]) -> None:
        """Stop calling it."""
        with self._lock:
            if listener in self._listeners:
                self._listeners.remove(listener)

    def _tell(self) -> None:
        with self._lock:
            listeners = tuple(self._listeners)
        for listener in listeners:
            listener()

    @contextmanager
    def _open(self, doing: str) -> Iterator[sqlite3.Connection]:
        try:
            with closing(sqlite3.connect(self._path, timeout=BUSY_TIMEOUT_S)) as connection, connection:
                yield connection
        except sqlite3.OperationalError as error:
            raise StorageError(
                f"{doing} views in {self._path} failed: {error}", "check that the result folder is writable"
            ) from None
        except sqlite3.DatabaseError as error:
            raise ResultError(
                f"{self._path} holds no saved views ({error})", "move it away; views start anew without it"
            ) from None


def _view(view_id: int, name: str, who: str, at: str, content: str) -> SavedView | None:
    try:
        record = json.loads(content)
        cut = record.get("cut")
        state = ViewState(
            position=_triple(record["position"]),
            target=_triple(record["target"]),
            mode=str(record["mode"]),
            selected=None if record.get("selected") is None else int(record["selected"]),
            cut=None if cut is None else (_triple(cut[0]), _triple(cut[1])),
        )
        return SavedView(int(view_id), str(name), str(who), str(at), state)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError):
        return None


def _triple(values: object) -> Triple:
    x, y, z = (float(value) for value in values)  # type: ignore[attr-defined]
    return (x, y, z)
