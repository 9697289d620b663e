"""Measuring in the map: two clicks make a distance, Esc takes the last step back."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import viser

from oasisview.map_tools_panel import MapToolsPanel
from oasisview.page import Page
from oasisview.panels.map_tools import tape_html
from oasisview.scene.map_points import MapPoints
from oasisview.scene.map_view import MapView
from oasisview.scene.tape import Measurement, Point, TapeMarks
from oasisview.shell import Shell


class TapeActions:
    """The measuring tape of one tab. While it is out, clicks in the map measure and select nothing.

    Args:
        client, shell, page, panel: the tab, and where its measurements are listed.
        points, view: the map.
        lock: held while the page's choices change.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        shell: Shell,
        page: Page,
        panel: Callable[[], MapToolsPanel],
        points: MapPoints,
        view: MapView,
        lock: threading.RLock,
    ) -> None:
        self._scene = client.scene
        self._client = client
        self._shell = shell
        self._page = page
        self._panel = panel
        self._points = points
        self._view = view
        self._lock = lock
        self._marks = TapeMarks(client.scene, points.origin, points.point_size_m)
        self._up: Point = tuple(np.asarray(points.up_world, np.float64).tolist())
        self._first: Point | None = None
        self._done: list[Measurement] = []

    @property
    def active(self) -> bool:
        """Whether clicks in the map measure."""
        return self._page.choices.measuring

    def toggle(self) -> None:
        """Take the tape out, or put it away; what was measured stays."""
        with self._lock:
            on = not self._page.choices.measuring
            self._page.choices.measuring = on
            self._first = None
            self._view.set_clickable(not on)
            if on:
                self._scene.on_click()(self._clicked)
            else:
                self._scene.remove_click_callback(self._clicked)
            self._show()

    def back(self) -> bool:
        """One step back: the first point, then the last distance, then the tape; False if it is not out."""
        with self._lock:
            if not self.active:
                return False
            if self._first is not None:
                self._first = None
            elif self._done:
                self._done.pop()
            else:
                self.toggle()
                return True
            self._show()
            return True

    def remove(self, number: int) -> None:
        """Forget a distance, counted from 1; 0 = all of them."""
        with self._lock:
            if number == 0:
                self._done.clear()
            elif number <= len(self._done):
                del self._done[number - 1]
            self._show()

    def redraw(self) -> None:
        """After the theme changed."""
        with self._lock:
            self._marks.draw(self._done, self._first, dark=self._page.choices.dark)

    def open(self) -> None:
        """Fill the panel for the first time."""
        self._panel().show_tape(tape_html(self._done, active=self.active))

    def _clicked(self, event: viser.SceneClickEvent) -> None:
        origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
        found = self._view.clicks.point_under(origin, direction)
        with self._lock:
            if not self.active:
                return
            if found is None:
                self._shell.toast("No point of the map there: click on something that is drawn.")
                return
            point: Point = tuple(found.tolist())
            if self._first is None:
                self._first = point
            else:
                self._done.append(Measurement(self._first, point, self._up))
                self._first = None
            self._show()

    def _hint(self) -> str:
        if self._first is not None:
            x, y, z = self._first
            return f"First point at x {x:.2f}, y {y:.2f}, z {z:.2f} m. Click the second one."
        if self._done:
            return f"{self._done[-1].words()}. Click a point for the next distance."
        return "Click the first point on anything that is drawn."

    def _show(self) -> None:
        self._page.choices.tape_hint = self._hint() if self.active else ""
        self._page.show_hud()
        with self._client.atomic():
            self._marks.draw(self._done, self._first, dark=self._page.choices.dark)
        self._panel().show_tape(tape_html(self._done, active=self.active))
