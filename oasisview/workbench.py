"""A result that is open for inspection: everything that all browsers share."""

from __future__ import annotations

import threading
from collections.abc import Callable

from oasisview.assets import AssetTable
from oasisview.catalogue import Catalogue
from oasisview.decisions import SharedDecisions
from oasisview.saved_views import SavedViews
from oasisview.scene.map_points import MapPoints, load_map_points
from pipeline.result import Result


class Workbench:
    """Catalogue, map points and decisions of one result, and who is looking at it.

    Construction reads the maps (seconds for large ones): keep it off the event loop.
    """

    def __init__(self, result: Result, assets: AssetTable) -> None:
        self.result = result
        self.catalogue = Catalogue(result, assets)
        self._machine_points = load_map_points(result)
        self.points: MapPoints = self._machine_points
        self.decisions = SharedDecisions(result)
        self._follow_corrections()
        # Before any page: what pages draw from has to be corrected when they hear of it.
        self.decisions.subscribe(lambda _: self._follow_corrections())
        self.views = SavedViews(result.path)
        self.name = result.path.stem
        self._present: dict[int, str] = {}
        self._looked_at: dict[int, int] = {}
        self._watchers: list[Callable[[], None]] = []
        self._lock = threading.Lock()

    def enter(self, client_id: int, user: str, watcher: Callable[[], None]) -> None:
        """Somebody opened a page; ``watcher`` is told of everyone who comes and goes."""
        with self._lock:
            self._present[client_id] = user
            self._watchers.append(watcher)
        self._tell()

    def leave(self, client_id: int, watcher: Callable[[], None]) -> None:
        """Somebody closed a page."""
        with self._lock:
            self._present.pop(client_id, None)
            self._looked_at.pop(client_id, None)
            if watcher in self._watchers:
                self._watchers.remove(watcher)
        self._tell()

    def look_at(self, client_id: int, object_id: int) -> None:
        """Somebody selected an object; everyone else sees where they are."""
        with self._lock:
            if client_id not in self._present or self._looked_at.get(client_id) == object_id:
                return
            self._looked_at[client_id] = object_id
        self._tell()

    def others(self, client_id: int) -> list[tuple[str, int | None]]:
        """Who else is looking, by name, and at which object; one entry per page."""
        with self._lock:
            present = [
                (name, self._looked_at.get(client))
                for client, name in self._present.items()
                if client != client_id
            ]
        state = self.decisions.corrected
        found = [(name, None if number is None else state.present_id(number)) for name, number in present]
        return sorted(found, key=lambda other: (other[0], other[1] or 0))

    def close(self) -> None:
        """Let go of the files."""
        self.decisions.close()

    def _follow_corrections(self) -> None:
        corrected = self.decisions.corrected
        self.catalogue.follow(corrected)
        points = self._machine_points
        if corrected.is_corrected:
            points = points.with_objects(tuple(map(corrected.table, range(len(points.visits)))))
        self.points = points

    def _tell(self) -> None:
        with self._lock:
            watchers = tuple(self._watchers)
        for watcher in watchers:
            watcher()
