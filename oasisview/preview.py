"""A preview in the map: colours that stand for something other than what has been decided, until it ends."""

from __future__ import annotations

import threading
from collections.abc import Callable

from oasisview.scene.map_view import MapView, VisitLabels
from oasisview.shell import Shell


class Preview:
    """At most one preview in the map of a tab; a bar over the map says what it is and ends it.

    Args:
        shell, view: the tab and its map.
        lock: held while what is shown changes.
    """

    def __init__(self, shell: Shell, view: MapView, lock: threading.RLock) -> None:
        self._shell = shell
        self._map = view
        self._lock = lock
        self._ended: Callable[[], None] | None = None
        self._bar = ""
        shell.on_event("end_preview", lambda _: self.end())

    def show(
        self, bar: str, labels: VisitLabels, ended: Callable[[], None], *, keep_bar: bool = False
    ) -> None:
        """Colour the map by ``labels``.

        Args:
            bar: html of the bar over the map.
            ended: called when the preview gives way to another one or is ended by the person.
            keep_bar: the bar is there already and a hand may be on it.
        """
        with self._lock:
            before, self._ended = self._ended, ended
            if before is not None and before != ended:
                before()
                keep_bar = False
            self._map.set_preview(labels)
            if bar != self._bar and not (keep_bar and self._bar):
                self._shell.set_html("preview", bar)
            self._bar = bar

    def end(self, of: Callable[[], None] | None = None) -> None:
        """Back to what has been decided; with ``of``, only if that preview is the one shown, untold."""
        with self._lock:
            if self._ended is None or (of is not None and self._ended != of):
                return
            ended, self._ended, self._bar = self._ended, None, ""
            self._map.set_preview(None)
            self._shell.set_html("preview", "")
            if of is None:
                ended()
