"""One connected person: what they selected, where they are in the keyframes, which layers they see.

Handlers run on worker threads, one after the other for a tab; clicks in the map and other people's
decisions arrive on other threads, so everything that touches the state holds the inspector's lock.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable

import viser

from oasisview import events, memory, wording
from oasisview.belief_actions import BeliefActions
from oasisview.bindings import bind
from oasisview.correction_actions import CorrectionActions
from oasisview.crops import object_at
from oasisview.export_actions import ExportActions
from oasisview.map_controls import MapControls
from oasisview.map_tools import MapTools
from oasisview.matrix_actions import MatrixActions
from oasisview.page import Choices, Page
from oasisview.patch_actions import PatchActions
from oasisview.preview import Preview
from oasisview.queue_actions import QueueActions
from oasisview.scene.map_points import LABEL_RGB
from oasisview.scene.map_view import PAST_LABELS, MapView
from oasisview.shell import Shell
from oasisview.verdict_actions import VerdictActions
from oasisview.what_if_actions import WhatIfActions
from oasisview.workbench import Workbench
from pipeline.result import MapObject

WIDE_WINDOW_PX = 1600
_log = logging.getLogger(__name__)


class Inspector:
    """The panels, the band and the map of one tab, in step with each other.

    Args:
        client, shell: the tab.
        bench: the open result.
        loop: the server's event loop, on which work of other threads is handed over.
    """

    def __init__(
        self, client: viser.ClientHandle, shell: Shell, bench: Workbench, loop: asyncio.AbstractEventLoop
    ) -> None:
        self._client = client
        self._shell = shell
        self._bench = bench
        self._catalogue = bench.catalogue
        self._decisions = bench.decisions
        self._loop = loop
        self._lock = threading.RLock()
        self._closed = False
        self.choices = Choices()
        if not self._catalogue.session(1).keyframes:
            self.choices.session = 0
        self._page = Page(client, shell, bench, self.choices)
        self.verdicts = VerdictActions(shell, self._page, bench, self._lock, self.select)
        self.exports = ExportActions(client, self._page, bench, self._lock)
        self._map = MapView(
            client,
            self._catalogue,
            bench.points,
            self._decisions.label_of,
            LABEL_RGB,
            on_object=lambda found: None if self.tools.tape.active else self.pick(found),
            on_keyframe=lambda *place: None if self.tools.tape.active else self.show_keyframe(*place),
        )
        self.controls = MapControls(shell, self._page, bench, self._map, self._lock, self._show_band)
        self.tools = MapTools(
            client, shell, self._page, bench, self._map, self.controls, self.select, self._lock
        )
        self.corrections = CorrectionActions(shell, self._page, bench, self._lock, self.select)
        self.queue = QueueActions(shell, self._page, bench, self._lock, self.select)
        self.matrix = MatrixActions(shell, self._page, bench, self._lock)
        self.patches = PatchActions(shell, self._page, bench, self._lock, self._show_band)
        self.preview = Preview(shell, self._map, self._lock)
        self.belief = BeliefActions(shell, self._page, bench, self.preview, self._lock, self.show_keyframe)
        self.what_if = WhatIfActions(shell, self._page, bench, self.preview, self._lock)

    @property
    def client_id(self) -> int:
        """Viser's number of the tab."""
        return self._client.client_id

    @property
    def user(self) -> str:
        """Who decides in this tab."""
        return self._shell.user

    def open(self, hello: events.Hello | None) -> None:
        """Send the whole page; ``hello`` is what the page's address asked for."""
        with self._lock:
            self._page.build(wide=hello is not None and hello.width_px >= WIDE_WINDOW_PX)
            bind(self, self._shell)
            choices = self.choices
            if hello is not None:
                self._recall(hello)
            self._map.build(choices.mode, choices.colours, choices.layers, dark=choices.dark)
            # After the map: the up direction turns the world, and a camera set before with it.
            home = self._bench.points.home
            self._client.camera.position = home.position
            self._client.camera.look_at = home.target
            self._page.show_hud()
            self._page.show_queue_tools()
            self._page.show_queue()
            self._page.show_journal()
            self._page.show_export()
            self.tools.open()
            self.what_if.open()
            linked = hello.object_id if hello is not None else None
            wanted = self._decisions.corrected.present_id(linked) if linked is not None else None
            if wanted in self._catalogue.objects:
                # A keyframe in the address was being looked at together with the object.
                self.select(wanted, fly=True, keep_keyframe=hello is not None and "keyframe" in hello.address)
            else:
                self._page.show_evidence()
                self._page.show_matrix()
                self._show_band(whole=True)
                self.controls.fly(home)
        self._decisions.subscribe(self._on_decisions)
        self._bench.enter(self._client.client_id, self.user, self._on_presence)

    def _recall(self, hello: events.Hello) -> None:
        counts = (len(self._catalogue.session(0).keyframes), len(self._catalogue.session(1).keyframes))
        memory.recall_tastes(self.choices, hello.remembered)
        memory.recall_places(self.choices, hello.address, counts)
        if self.choices.dark:
            self._shell.set_theme(True)

    def close(self) -> None:
        """The tab is gone."""
        self._closed = True
        self.exports.close()
        self.tools.close()
        self._map.close()
        self._decisions.unsubscribe(self._on_decisions)
        self._bench.leave(self._client.client_id, self._on_presence)

    # Selection and keyframes

    def pick(self, object_id: int, *, fly: bool = False, keep_keyframe: bool = False) -> None:
        """An object was clicked somewhere: it is selected, or completes a correction that waits for it."""
        present = self._decisions.corrected.present_id(object_id)
        if present is not None and not self.corrections.picked(present):
            self.select(present, fly=fly, keep_keyframe=keep_keyframe)

    def select(self, object_id: int | None, *, fly: bool = False, keep_keyframe: bool = False) -> None:
        """Show an object everywhere; the keyframe stays if it shows the object well enough."""
        with self._lock:
            item = self._catalogue.objects.get(object_id) if object_id is not None else None
            if item is None or self._closed:
                return
            choices = self.choices
            choices.selected, choices.conflict = item.object_id, ""
            self.matrix.forget_pair_without(item.object_id)
            self._show_where_visible(item)
            if not keep_keyframe:
                self._choose_keyframe(item)
            self._page.show_evidence()
            self._shell.set_selection(item.object_id)
            self._bench.look_at(self.client_id, item.object_id)
            self._show_band()
            self._map.marks.select(item)
            if fly:
                self.controls.fly_selected()
            self._page.show_matrix()

    def show_keyframe(self, session: int, keyframe: int) -> None:
        """Show a keyframe in the band; numbers beyond the ends mean the ends."""
        with self._lock:
            count = len(self._catalogue.session(session).keyframes)
            if count == 0 or self._closed:
                return
            self.choices.session = session
            self.choices.keyframe = min(max(keyframe, 0), count - 1)
            self._show_band()
            self.belief.follow_keyframe()

    def _show_where_visible(self, item: MapObject) -> None:
        """An object that is not in the map of the visit shown brings the other visit in."""
        visits = {sighting.session for sighting in item.sightings}
        mode = self.choices.wanted_mode
        # A gone object whose place is taken would only speckle the points of what stands there now.
        gone = self._decisions.label_of(item.object_id) in PAST_LABELS and item.replaced_by is None
        if mode != "before" and 1 not in visits:
            mode = "both" if gone else "before"
        elif mode == "before" and 0 not in visits:
            mode = "after"
        if mode != self.choices.mode:
            self.controls.apply_mode(mode)

    def _choose_keyframe(self, item: MapObject) -> None:
        choices = self.choices
        if self._catalogue.session(choices.session).keyframes and (
            item.sighting(choices.session) is not None
            and self._catalogue.sees_well(choices.session, choices.keyframe, item.object_id)
        ):
            return
        pair = self._catalogue.before_after(item.object_id)
        view = pair.after if choices.session == 1 else pair.before
        if view is not None:
            choices.keyframe = view.keyframe

    def step_keyframe(self, by: int) -> None:
        """The next keyframe, or the one before."""
        self.show_keyframe(self.choices.session, self.choices.keyframe + by)

    def set_visit(self, session: int) -> None:
        """Scrub the other visit, starting at the keyframe that shares most with the present one."""
        with self._lock:
            choices = self.choices
            if session == choices.session or not self._catalogue.session(session).keyframes:
                return
            pair = self._catalogue.covisible(choices.session, choices.keyframe)
            self.show_keyframe(session, pair.other_keyframe if pair is not None else 0)

    def best_view(self) -> None:
        """The keyframe of this visit that shows the selected object best."""
        item = self._selected()
        if item is None:
            return
        keyframe = self._catalogue.best_keyframe(item, self.choices.session)
        if keyframe is None:
            self._shell.toast(f"No keyframe of this visit shows {wording.object_name(item.object_id)}.")
        else:
            self.show_keyframe(self.choices.session, keyframe)

    def click_picture(self, click: events.PixelClick) -> None:
        """Select the object under a click in one of the band's pictures."""
        if click.session > 1 or click.keyframe >= len(self._catalogue.session(click.session).keyframes):
            return
        found = object_at(self._catalogue.mask(click.session, click.keyframe), click.u, click.v)
        with self._lock:
            self.patches.pick(click)
            if found in self._catalogue.objects:
                self.pick(found, keep_keyframe=True)
            else:
                self._show_band()
                self._shell.toast(
                    "No object there: its patch is shown." if self.choices.patch else "No object there."
                )

    def _selected(self) -> MapObject | None:
        chosen = self.choices.selected
        return self._catalogue.objects.get(chosen) if chosen is not None else None

    # What others do

    def _on_decisions(self, changed: frozenset[int]) -> None:
        """Called by whoever noticed; their thread must not wait for this page."""
        self._later(lambda: self._follow(changed))

    def _follow(self, changed: frozenset[int]) -> None:
        with self._lock:
            if self._closed:
                return
            chosen = self.choices.selected
            if chosen is not None and chosen not in self._catalogue.objects:
                self._follow_selection(self._decisions.corrected.present_id(chosen))
            self._page.show_queue()
            self._map.follow(self._bench.points)
            self._page.show_journal()
            self._page.show_export()
            self.what_if.follow()
            if self.choices.selected is not None:
                self._page.show_evidence()
                if self.choices.selected in changed:
                    self._map.marks.select(self._selected())
                    self._show_band()

    def _follow_selection(self, object_id: int | None) -> None:
        """The selected object became part of another one, or is none any more."""
        self.choices.selected = None
        self._shell.set_selection(None)
        self._map.marks.select(None)
        if object_id is not None:
            self.select(object_id)
        else:
            self._page.show_evidence()
            self._show_band()

    def _on_presence(self) -> None:
        self._later(self._page.show_who)

    def _later(self, work: Callable[[], None]) -> None:
        if self._closed or self._loop.is_closed():
            return

        async def run() -> None:
            try:
                await asyncio.to_thread(work)
            except Exception:
                if not self._closed:
                    _log.exception("a page could not be brought up to date")

        asyncio.run_coroutine_threadsafe(run(), self._loop)

    # What is shown

    def set_theme(self, dark: bool) -> None:
        """Light or dark page."""
        self.controls.set_theme(dark)
        self.tools.tape.redraw()

    def toggle_swipe(self) -> None:
        """Before over after, or side by side."""
        with self._lock:
            self.choices.swipe = not self.choices.swipe
            self._page.show_evidence()
            self._show_band()

    def _show_band(self, *, whole: bool = False) -> None:
        self._page.show_band(whole=whole)
        if self._catalogue.session(self.choices.session).keyframes:
            place = (self.choices.session, self.choices.keyframe)
            self._map.marks.show_keyframe(*place)
            self._shell.set_address(keyframe=memory.keyframe_address(*place))
