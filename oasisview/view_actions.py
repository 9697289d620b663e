"""Saved viewpoints in one tab: keep what is seen now, fly back to it later."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import viser

from oasisview.cut_actions import CutActions
from oasisview.map_controls import MapControls
from oasisview.map_tools_panel import MapToolsPanel
from oasisview.page import Page
from oasisview.panels.hud import MODES
from oasisview.panels.map_tools import views_html
from oasisview.saved_views import ViewState
from oasisview.scene.viewpoints import Viewpoint
from oasisview.shell import Shell
from oasisview.verdict_actions import SelectObject
from oasisview.workbench import Workbench


class ViewActions:
    """The list of views in one tab.

    Args:
        client, shell, page, panel: the tab, and where its views are listed.
        bench: the open result; controls, cut: of the tab's map.
        select: shows an object everywhere.
        lock: held while the page's choices change.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        shell: Shell,
        page: Page,
        panel: Callable[[], MapToolsPanel],
        bench: Workbench,
        controls: MapControls,
        cut: CutActions,
        select: SelectObject,
        lock: threading.RLock,
    ) -> None:
        self._client = client
        self._shell = shell
        self._page = page
        self._panel = panel
        self._views = bench.views
        self._controls = controls
        self._cut = cut
        self._select = select
        self._lock = lock

    def ask_name(self) -> None:
        """Ask what the present view shall be called."""
        number = len(self._views.all()) + 1
        hint = "Keeps the camera, the visit shown, the selected object and the cut, for everybody."
        self._shell.ask_text("Name of this view", hint, f"View {number}", "save_view")

    def save(self, name: str) -> None:
        """Keep what is seen now."""
        if not name:
            return
        choices, box = self._page.choices, self._cut.box
        camera = self._client.camera
        state = ViewState(
            position=_rounded(camera.position),
            target=_rounded(camera.look_at),
            mode=choices.mode,
            selected=choices.selected,
            cut=None if box is None else (box.low_m, box.high_m),
        )
        self._views.add(" ".join(name.split())[:80], self._shell.user, state)
        self._shell.toast("View saved: it is in the Map tab, for everybody.")

    def fly(self, view_id: int) -> None:
        """Show a saved view."""
        view = next((v for v in self._views.all() if v.view_id == view_id), None)
        if view is None:
            self._shell.toast("This view was removed.")
            self.show()
            return
        state = view.state
        with self._lock:
            if state.selected is not None:
                self._select(state.selected)
            if state.mode in MODES and state.mode != self._page.choices.mode:
                self._controls.set_mode(state.mode)
            box = None if state.cut is None else self._cut.of_sides(*state.cut)
            if box != self._cut.box:
                self._cut.set(box)
            self._controls.fly(Viewpoint(state.position, state.target))

    def remove(self, view_id: int) -> None:
        """Forget a view."""
        self._views.remove(view_id)
        self._shell.toast("View removed.")

    def open(self) -> None:
        """Fill the panel, and follow what others save."""
        self.show()
        self._views.subscribe(self.show)

    def close(self) -> None:
        """The tab is gone."""
        self._views.unsubscribe(self.show)

    def show(self) -> None:
        """List the views."""
        self._panel().show_views(views_html(self._views.all()))


def _rounded(place: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 4) for value in place)
    return (x, y, z)
