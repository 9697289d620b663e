"""Cutting the map to a box: sliders, a box around the selected object, and on or off by a key."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import viser

from oasisview.map_tools_panel import MapToolsPanel
from oasisview.page import Page
from oasisview.panels.map_tools import cut_html
from oasisview.scene.cut import CutBox, CutFrame
from oasisview.scene.map_view import MapView
from oasisview.shell import Shell
from oasisview.workbench import Workbench

QUIET_S = 0.2  # a slider that rests so long is where the hand wants it


class CutActions:
    """The cut of one tab.

    The outline follows the hand; the points, which have to be sent anew, follow once it rests.

    Args:
        client, shell, page, panel: the tab, and where its sliders are.
        bench, view: the open result and its map.
        lock: held while the page's choices change.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        shell: Shell,
        page: Page,
        panel: Callable[[], MapToolsPanel],
        bench: Workbench,
        view: MapView,
        lock: threading.RLock,
    ) -> None:
        self._client = client
        self._shell = shell
        self._page = page
        self._panel = panel
        self._bench = bench
        self._view = view
        self._lock = lock
        self._frame = CutFrame.of(bench.result, bench.points)
        self._box = self._frame.whole()
        self._timer: threading.Timer | None = None

    @property
    def box(self) -> CutBox | None:
        """What the map is cut to; None while it is whole."""
        return self._box if self._page.choices.cut else None

    def move(self, face: str, value_m: float) -> None:
        """A slider moved."""
        with self._lock:
            self._box = self._box.moved(face, value_m)
            self._page.choices.cut = not self._box.is_whole
            self._view.marks.outline_cut(self.box)
            if self._timer is not None:
                self._timer.cancel()
            self._timer = threading.Timer(QUIET_S, self._apply)
            self._timer.daemon = True
            self._timer.start()

    def toggle(self) -> None:
        """Cut on or off; without a box yet, one around the selected object."""
        with self._lock:
            if self._page.choices.cut:
                self._page.choices.cut = False
                self._apply()
            elif self._box.is_whole:
                self.around_selected()
            else:
                self._page.choices.cut = True
                self._apply()

    def around_selected(self) -> None:
        """Cut to the selected object and its surroundings, on both visits."""
        with self._lock:
            chosen = self._page.choices.selected
            item = self._bench.catalogue.objects.get(chosen) if chosen is not None else None
            if item is None or not item.sightings:
                self._shell.toast(
                    "Select an object to cut the map around it, or move a slider of the Map tab."
                )
                return
            low = np.min([s.box_min_world_m for s in item.sightings], axis=0)
            high = np.max([s.box_max_world_m for s in item.sightings], axis=0)
            self.set(self._frame.around(low, high))

    def set(self, box: CutBox | None) -> None:
        """Cut to a box, or show everything."""
        with self._lock:
            self._box = box or self._frame.whole()
            self._page.choices.cut = not self._box.is_whole
            self._apply()
            self._panel().show_cut(cut_html(self._box))

    def reset(self) -> None:
        """Everything again, and all sliders at their ends."""
        self.set(None)

    def of_sides(self, low_m: tuple[float, ...], high_m: tuple[float, ...]) -> CutBox:
        """A box of this map with given sides, kept within its reach."""
        box = self._frame.whole()
        for axis, (low, high) in enumerate(zip(low_m, high_m, strict=True)):
            name = ("x", "y", "height")[axis]
            box = box.moved(f"{name}_low", low).moved(f"{name}_high", high)
        return box

    def open(self) -> None:
        """Fill the panel for the first time."""
        self._panel().show_cut(cut_html(self._box))

    def close(self) -> None:
        """The tab is gone."""
        if self._timer is not None:
            self._timer.cancel()

    def _apply(self) -> None:
        with self._lock:
            self._view.set_cut(self.box)
            self._page.show_hud()
