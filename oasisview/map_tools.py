"""What a person does to the map besides looking at objects: measure, cut, keep views, share a link."""

from __future__ import annotations

import threading
from collections.abc import Callable

import viser

from oasisview import events
from oasisview.cut_actions import CutActions
from oasisview.map_controls import MapControls
from oasisview.page import Page
from oasisview.scene.cut import FACES
from oasisview.scene.map_view import MapView
from oasisview.shell import Shell
from oasisview.tape_actions import TapeActions
from oasisview.verdict_actions import SelectObject
from oasisview.view_actions import ViewActions
from oasisview.workbench import Workbench

_ANY_LENGTH_M = events.number(-1e7, 1e7)


class MapTools:
    """The tools of one tab; arguments as of its parts."""

    def __init__(
        self,
        client: viser.ClientHandle,
        shell: Shell,
        page: Page,
        bench: Workbench,
        view: MapView,
        controls: MapControls,
        select: SelectObject,
        lock: threading.RLock,
    ) -> None:
        self._shell = shell
        self.tape = TapeActions(client, shell, page, lambda: page.tools, bench.points, view, lock)
        self.cut = CutActions(client, shell, page, lambda: page.tools, bench, view, lock)
        self.views = ViewActions(
            client, shell, page, lambda: page.tools, bench, controls, self.cut, select, lock
        )

    def bind(self) -> None:
        """Connect what the page sends to what it does."""
        on, add = self._shell.on_event, self._shell.add_command
        on("measure", lambda _: self.tape.toggle())
        on("escape", self._step_back)
        on("remove_distance", self.tape.remove, events.whole_number(0, 100_000))
        for face in FACES:
            on(f"cut_{face}", self._mover(face), _ANY_LENGTH_M, latest_only=True)
        on("cut_around", lambda _: self.cut.around_selected())
        on("cut_reset", lambda _: self.cut.reset())
        on("ask_view", lambda _: self.views.ask_name())
        on("save_view", self.views.save, events.text())
        on("fly_view", self.views.fly, events.whole_number(1, 2**53))
        on("remove_view", self.views.remove, events.whole_number(1, 2**53))
        add("Measure a distance", "T", self.tape.toggle)
        add("Cut the map on / off", "C", self.cut.toggle)
        add("Save this view", "Y", self.views.ask_name)

    def _mover(self, face: str) -> Callable[[float], None]:
        return lambda value: self.cut.move(face, value)

    def _step_back(self, _: None) -> None:
        self.tape.back()

    def open(self) -> None:
        """Fill the Map tab."""
        self.views.open()
        self.tape.open()
        self.cut.open()

    def close(self) -> None:
        """The tab is gone."""
        self.cut.close()
        self.views.close()
