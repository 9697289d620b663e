"""A preview in the map: colours that stand for something other than what has been decided, until it ends."""

from __future__ import annotations

import threading
from collections.abc import Callable

from oasisview.page import Page
from oasisview.scene.map_view import MapView, VisitLabels
from oasisview.shell import Shell


class Preview:
    """At most one preview in the map of a tab; the HUD says what it is and ends it.

    Args:
        shell, page, view: the tab, its panels and its map.
        lock: held while the page's choices change.
    """

    def __init__(self, shell: Shell, page: Page, view: MapView, lock: threading.RLock) -> None:
        self._page = page
        self._map = view
        self._lock = lock
        self._ended: Callable[[], None] | None = None
        shell.on_event("end_preview", lambda _: self.end())

    def show(self, words: str, labels: VisitLabels, ended: Callable[[], None]) -> None:
        """Colour the map by ``labels``; ``ended`` is called when the preview gives way or is ended."""
        with self._lock:
            if self._ended is not None and self._ended != ended:
                before, self._ended = self._ended, None
                before()
            self._ended = ended
            self._map.set_preview(labels)
            if self._page.choices.preview != words:
                self._page.choices.preview = words
                self._page.show_hud()

    def end(self, of: Callable[[], None] | None = None) -> None:
        """Back to what has been decided; with ``of``, only if that preview is the one shown."""
        with self._lock:
            if self._ended is None or (of is not None and self._ended != of):
                return
            ended, self._ended = self._ended, None
            self._map.set_preview(None)
            self._page.choices.preview = ""
            self._page.show_hud()
            if of is None:
                ended()
