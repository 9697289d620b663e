"""What one person sees of the map: which visit, colours, layers, theme, and where the camera is."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from oasisview import memory
from oasisview.page import Page
from oasisview.panels.hud import legend_html
from oasisview.scene import viewpoints
from oasisview.scene.map_view import MapView
from oasisview.shell import Shell
from oasisview.workbench import Workbench
from pipeline.result import ChangeLabel, MapObject


class MapControls:
    """The switches over the map of one tab, and its camera.

    Args:
        shell, page, bench, view: the tab, its panels, the open result and the map.
        lock: held while the page's choices change.
        show_band: draws the band of keyframes anew.
    """

    def __init__(
        self,
        shell: Shell,
        page: Page,
        bench: Workbench,
        view: MapView,
        lock: threading.RLock,
        show_band: Callable[[], None],
    ) -> None:
        self._shell = shell
        self._page = page
        self._bench = bench
        self._catalogue = bench.catalogue
        self._decisions = bench.decisions
        self._choices = page.choices
        self._map = view
        self._lock = lock
        self._show_band = show_band

    def set_mode(self, mode: str) -> None:
        """Before, after or both in the map."""
        with self._lock:
            self._choices.wanted_mode = mode
            self.apply_mode(mode)
            self._shell.set_address(map=mode)
            self._map.marks.select(self._selected())

    def apply_mode(self, mode: str) -> None:
        """Show a visit for as long as the selection needs it; the person's own choice is kept."""
        self._choices.mode = mode
        self._map.set_mode(mode)
        self._page.show_hud()

    def flip_mode(self) -> None:
        """Before or after in the map, the other one."""
        self.set_mode("after" if self._choices.mode == "before" else "before")

    def set_colours(self, colours: str) -> None:
        """Colour objects by label, by identity or as recorded."""
        with self._lock:
            self._choices.colours = colours
            self._map.set_colours(colours)
            self._remember()
            self._shell.set_html("legend", legend_html(colours, self._choices.mode))

    def set_layer(self, switch: dict[str, Any]) -> None:
        """Switch one layer of the map."""
        with self._lock:
            self._choices.layers = self._choices.layers.switched(switch["key"], switch["value"])
            self._map.set_layers(self._choices.layers)
            self._remember()

    def set_theme(self, dark: bool) -> None:
        """Light or dark page."""
        with self._lock:
            self._choices.dark = dark
            self._shell.set_theme(dark)
            self._map.set_theme(dark)
            self._remember()
            self._map.marks.select(self._selected())
            self._page.show_hud()
            self._show_band()

    def fly_home(self) -> None:
        """See the whole site."""
        self.fly(self._bench.points.home)

    def fly(self, viewpoint: viewpoints.Viewpoint) -> None:
        """Move the camera smoothly."""
        self._shell.fly_to(viewpoint.position, viewpoint.target)

    def fly_keyframe(self) -> None:
        """Look through the camera of the keyframe in the band."""
        choices = self._choices
        keyframes = self._catalogue.session(choices.session).keyframes
        if keyframes:
            self.fly(viewpoints.at_keyframe(keyframes[choices.keyframe].T_world_camera, back_off_m=0.3))

    def fly_selected(self) -> None:
        """Fly to the selected object."""
        item = self._selected()
        if item is None or not item.sightings:
            return
        sighting = item.sightings[-1]
        keyframes = self._catalogue.session(sighting.session).keyframes
        best = sighting.keyframes[0] if sighting.keyframes else None
        up = self._bench.points.up_world
        seen_from = keyframes[best].T_world_camera[:3, 3] if best is not None else up
        moved = self._decisions.label_of(item.object_id) is ChangeLabel.MOVED
        before = item.sighting(0)
        other = before.centroid_world_m if moved and before is not None and before is not sighting else None
        low, high = np.array(sighting.box_min_world_m), np.array(sighting.box_max_world_m)
        wanted = viewpoints.towards_object(low, high, up, seen_from, other)
        reach = float(np.linalg.norm(high - low)) / 2 + 0.3
        obstacles = self._bench.points.obstacles_world(sighting.session)
        self.fly(viewpoints.clear_of(wanted, obstacles, up, reach))

    def _selected(self) -> MapObject | None:
        chosen = self._choices.selected
        return self._catalogue.objects.get(chosen) if chosen is not None else None

    def _remember(self) -> None:
        self._shell.remember(memory.tastes(self._choices))
