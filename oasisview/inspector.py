"""One connected person: what they selected, where they are in the keyframes, which layers they see.

Handlers run on worker threads, one after the other for a tab; clicks in the map and other people's
decisions arrive on other threads, so everything that touches the state holds the inspector's lock.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from typing import Any

import viser

from oasisview import events, wording
from oasisview.downloads import make_download
from oasisview.page import Choices, Page
from oasisview.panels import queue
from oasisview.panels.export import DOWNLOADS
from oasisview.panels.hud import COLOURS, LAYER_WORDS, MODES, legend_html
from oasisview.panels.matrix import KINDS, cell_at
from oasisview.review import ConflictError
from oasisview.scene import viewpoints
from oasisview.scene.map_points import LABEL_RGB
from oasisview.scene.map_view import PAST_LABELS, MapView
from oasisview.shell import Shell
from oasisview.wording import LABEL_NAMES
from oasisview.workbench import Workbench
from pipeline.errors import OasisError
from pipeline.result import ChangeLabel, MapObject

_LABEL_OF_NAME = {name: label for label, name in LABEL_NAMES.items()}
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
        self._map = MapView(
            client,
            self._catalogue,
            bench.points,
            self._decisions.label_of,
            LABEL_RGB,
            on_object=self.select,
            on_keyframe=self.show_keyframe,
        )

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
            self._listen()
            choices = self.choices
            self._map.build(choices.mode, choices.colours, choices.layers, dark=choices.dark)
            # After the map: the up direction turns the world, and a camera set before with it.
            home = self._bench.points.home
            self._client.camera.position = home.position
            self._client.camera.look_at = home.target
            self._page.show_hud()
            self._page.show_queue()
            self._page.show_journal()
            self._page.show_export()
            wanted = hello.object_id if hello is not None else None
            if wanted in self._catalogue.objects:
                self.select(wanted, fly=True)
            else:
                self._page.show_evidence()
                self._page.show_matrix()
                self._show_band(whole=True)
                self._fly(home)
        self._decisions.subscribe(self._on_decisions)
        self._bench.enter(self._client.client_id, self.user, self._on_presence)

    def close(self) -> None:
        """The tab is gone."""
        self._closed = True
        self._map.close()
        self._decisions.unsubscribe(self._on_decisions)
        self._bench.leave(self._client.client_id, self._on_presence)

    def _listen(self) -> None:
        on = self._shell.on_event
        labels = events.choice(*_LABEL_OF_NAME)
        big = events.whole_number(0, 10_000_000)
        on("select", lambda object_id: self.select(object_id, fly=True), events.object_id)
        on("pixel", self._click_picture, events.pixel_click)
        on("matrix", self._click_matrix, events.pixel_click)
        on("matrix_kind", self._set_matrix_kind, events.choice(*KINDS))
        on("filter", self._toggle_filter, labels)
        on("decide", lambda name: self.ask(_LABEL_OF_NAME[name]), labels)
        on("reason", self._decide_pending, events.text())
        on("accept", lambda _: self.accept())
        on("note", self._note, events.text())
        on("undo", lambda _: self.undo())
        on("redo", lambda _: self.redo())
        on("swipe", lambda _: self._toggle_swipe())
        on("mode", self.set_mode, events.choice(*MODES))
        on("colours", self._set_colours, events.choice(*COLOURS))
        on("layer", self._set_layer, events.record(key=events.choice(*LAYER_WORDS), value=events.flag))
        on("theme", self._set_theme, events.flag)
        on("overview", lambda _: self._fly(self._bench.points.home))
        on("scrub", lambda k: self.show_keyframe(self.choices.session, k), big, latest_only=True)
        on("jump", lambda k: self.show_keyframe(self.choices.session, k - 1), big, latest_only=True)
        on("step_keyframe", self._step_keyframe, events.whole_number(-1, 1))
        on("visit", self._set_visit, events.whole_number(0, 1))
        on("keyframe", self._jump, events.record(session=events.whole_number(0, 1), keyframe=big))
        on("best_view", lambda _: self._best_view())
        on("fly_keyframe", lambda _: self._fly_keyframe())
        on("export", self._download, events.choice(*(d.format for d in DOWNLOADS)))
        self._add_commands()

    def _add_commands(self) -> None:
        add = self._shell.add_command
        add("Next object in the queue", "J", lambda: self.step(1))
        add("Previous object in the queue", "K", lambda: self.step(-1))
        for number, label in enumerate(queue.LABEL_ORDER, start=1):
            add(f"Set label: {LABEL_NAMES[label]}", str(number), self._asker(label))
        add("Undo", "U", self.undo)
        add("Redo", "R", self.redo)
        add("Before / after in the map", "B", self._flip_mode)
        add("Next keyframe", "N", lambda: self._step_keyframe(1))
        add("Previous keyframe", "P", lambda: self._step_keyframe(-1))
        add("Fly to the selected object", "F", self._fly_selected)
        add("Fly to the keyframe", "V", self._fly_keyframe)

    def _asker(self, label: ChangeLabel) -> Callable[[], None]:
        return lambda: self.ask(label)

    # Selection and keyframes

    def select(self, object_id: int | None, *, fly: bool = False, keep_keyframe: bool = False) -> None:
        """Show an object everywhere; the keyframe stays if it shows the object well enough."""
        with self._lock:
            item = self._catalogue.objects.get(object_id) if object_id is not None else None
            if item is None or self._closed:
                return
            choices = self.choices
            choices.selected, choices.conflict = item.object_id, ""
            self._show_where_visible(item)
            if not keep_keyframe:
                self._choose_keyframe(item)
            self._page.show_evidence()
            self._shell.set_selection(item.object_id)
            self._show_band()
            self._map.marks.select(item)
            if fly:
                self._fly_selected()
            self._page.show_matrix()

    def step(self, by: int) -> None:
        """Select the object ``by`` rows further down the queue."""
        order = queue.queue_order(self._catalogue, self._decisions.verdicts, self.choices.shown)
        self.select(queue.step(order, self.choices.selected, by), fly=True)

    def show_keyframe(self, session: int, keyframe: int) -> None:
        """Show a keyframe in the band; numbers beyond the ends mean the ends."""
        with self._lock:
            count = len(self._catalogue.session(session).keyframes)
            if count == 0 or self._closed:
                return
            self.choices.session = session
            self.choices.keyframe = min(max(keyframe, 0), count - 1)
            self._show_band()

    def _show_where_visible(self, item: MapObject) -> None:
        """An object that is not in the map of the visit shown brings the other visit in."""
        visits = {sighting.session for sighting in item.sightings}
        mode = self.choices.wanted_mode
        gone = self._decisions.label_of(item.object_id) in PAST_LABELS
        if mode != "before" and 1 not in visits:
            mode = "both" if gone else "before"
        elif mode == "before" and 0 not in visits:
            mode = "after"
        if mode != self.choices.mode:
            self._apply_mode(mode)

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

    def _step_keyframe(self, by: int) -> None:
        self.show_keyframe(self.choices.session, self.choices.keyframe + by)

    def _jump(self, place: dict[str, int]) -> None:
        self.show_keyframe(place["session"], place["keyframe"])

    def _set_visit(self, session: int) -> None:
        """Scrub the other visit, starting at the keyframe that shares most with the present one."""
        with self._lock:
            choices = self.choices
            if session == choices.session or not self._catalogue.session(session).keyframes:
                return
            pair = self._catalogue.covisible(choices.session, choices.keyframe)
            self.show_keyframe(session, pair.other_keyframe if pair is not None else 0)

    def _best_view(self) -> None:
        item = self._selected()
        if item is None:
            return
        keyframe = self._catalogue.best_keyframe(item, self.choices.session)
        if keyframe is None:
            self._shell.toast(f"No keyframe of this visit shows {wording.object_name(item.object_id)}.")
        else:
            self.show_keyframe(self.choices.session, keyframe)

    def _click_picture(self, click: events.PixelClick) -> None:
        if click.session > 1 or click.keyframe >= len(self._catalogue.session(click.session).keyframes):
            return
        from oasisview.crops import object_at

        found = object_at(self._catalogue.mask(click.session, click.keyframe), click.u, click.v)
        if found in self._catalogue.objects:
            self.select(found, keep_keyframe=True)
        else:
            self._shell.toast("No object there.")

    def _selected(self) -> MapObject | None:
        chosen = self.choices.selected
        return self._catalogue.objects.get(chosen) if chosen is not None else None

    # Decisions

    def ask(self, label: ChangeLabel) -> None:
        """Set a label: the machine's own is accepted at once, another one asks why."""
        with self._lock:
            item = self._selected()
            if item is None:
                self._shell.toast("Select an object first: click one, or press J.")
                return
            if label is item.label:
                self._decide(item.object_id, label, "")
                return
            self.choices.pending_label = (item.object_id, label)
            title = f"Why is {wording.object_name(item.object_id)} {LABEL_NAMES[label]}?"
            self._shell.ask_reason(title, "reason")

    def accept(self) -> None:
        """Confirm the machine's label of the selected object."""
        item = self._selected()
        if item is not None:
            self.ask(item.label)

    def undo(self) -> None:
        """Take back this person's latest decision."""
        self._turn(self._decisions.undo(self.user), "Undone", "Nothing to undo.")

    def redo(self) -> None:
        """Restore what was taken back last."""
        self._turn(self._decisions.redo(self.user), "Redone", "Nothing to redo.")

    def _turn(self, decision: Any, done: str, nothing: str) -> None:
        if decision is None:
            self._shell.toast(nothing)
            return
        label = LABEL_NAMES[self._decisions.label_of(decision.object_id)]
        self._shell.toast(f"{done}: {wording.object_name(decision.object_id)} is {label}.")
        self.select(decision.object_id, fly=decision.object_id != self.choices.selected)

    def _decide_pending(self, reason: str) -> None:
        with self._lock:
            pending, self.choices.pending_label = self.choices.pending_label, None
            if pending is not None:
                self._decide(*pending, reason)

    def _decide(self, object_id: int, label: ChangeLabel, reason: str) -> None:
        try:
            decision = self._decisions.decide(
                object_id, label, who=self.user, reason=reason, seen_event_id=self._page.seen_event_id
            )
        except ConflictError as conflict:
            self._decisions.refresh()
            self.choices.conflict = str(conflict)
            self._page.show_evidence()
            return
        order = queue.queue_order(self._catalogue, self._decisions.verdicts, self.choices.shown)
        did = "accepted as" if label is self._catalogue.objects[object_id].label else "set to"
        name = wording.object_name(object_id).capitalize()
        self._shell.toast(f"Saved: {name} {did} {LABEL_NAMES[decision.new_label]}.", undo=True)
        following = queue.next_to_review(order, self._decisions.verdicts, None)
        if following is not None:
            self.select(following, fly=True)
        else:
            self._page.show_evidence()

    def _note(self, text: str) -> None:
        item = self._selected()
        if item is None or not text:
            return
        self._decisions.note(item.object_id, text, who=self.user)
        self._shell.toast("Note saved.")

    def _on_decisions(self, changed: frozenset[int]) -> None:
        """Called by whoever noticed; their thread must not wait for this page."""
        self._later(lambda: self._follow(changed))

    def _follow(self, changed: frozenset[int]) -> None:
        with self._lock:
            if self._closed:
                return
            self._page.show_queue()
            self._map.recolour()
            self._page.show_journal()
            self._page.show_export()
            if self.choices.selected is not None:
                self._page.show_evidence()
                if self.choices.selected in changed:
                    self._map.marks.select(self._selected())
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

    # Map

    def set_mode(self, mode: str) -> None:
        """Before, after or both in the map."""
        with self._lock:
            self.choices.wanted_mode = mode
            self._apply_mode(mode)
            self._map.marks.select(self._selected())

    def _apply_mode(self, mode: str) -> None:
        self.choices.mode = mode
        self._map.set_mode(mode)
        self._page.show_hud()

    def _flip_mode(self) -> None:
        self.set_mode("after" if self.choices.mode == "before" else "before")

    def _set_colours(self, colours: str) -> None:
        with self._lock:
            self.choices.colours = colours
            self._map.set_colours(colours)
            self._shell.set_html("legend", legend_html(colours, self.choices.mode))

    def _set_layer(self, switch: dict[str, Any]) -> None:
        with self._lock:
            self.choices.layers = self.choices.layers.switched(switch["key"], switch["value"])
            self._map.set_layers(self.choices.layers)

    def _set_theme(self, dark: bool) -> None:
        with self._lock:
            self.choices.dark = dark
            self._shell.set_theme(dark)
            self._map.set_theme(dark)
            self._map.marks.select(self._selected())
            self._page.show_hud()
            self._show_band()

    def _fly(self, viewpoint: viewpoints.Viewpoint) -> None:
        self._shell.fly_to(viewpoint.position, viewpoint.target)

    def _fly_keyframe(self) -> None:
        choices = self.choices
        keyframes = self._catalogue.session(choices.session).keyframes
        if keyframes:
            self._fly(viewpoints.at_keyframe(keyframes[choices.keyframe].T_world_camera, back_off_m=0.3))

    def _fly_selected(self) -> None:
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
        self._fly(
            viewpoints.towards_object(
                sighting.box_min_world_m, sighting.box_max_world_m, up, seen_from, other
            )
        )

    # What is shown

    def _toggle_filter(self, name: str) -> None:
        with self._lock:
            self.choices.shown = self.choices.shown ^ {_LABEL_OF_NAME[name]}
            self._page.show_queue()

    def _toggle_swipe(self) -> None:
        with self._lock:
            self.choices.swipe = not self.choices.swipe
            self._page.show_evidence()

    def _set_matrix_kind(self, kind: str) -> None:
        with self._lock:
            self.choices.matrix_kind = kind
            self._page.show_matrix()

    def _click_matrix(self, click: events.PixelClick) -> None:
        with self._lock:
            self.choices.cell = cell_at(self._catalogue.result.score_matrix.sigma.shape, click.u, click.v)
            self._page.show_matrix()

    def _show_band(self, *, whole: bool = False) -> None:
        self._page.show_band(whole=whole)
        if self._catalogue.session(self.choices.session).keyframes:
            self._map.marks.show_keyframe(self.choices.session, self.choices.keyframe)

    def _download(self, format_name: str) -> None:
        download = next(d for d in DOWNLOADS if d.format == format_name)
        self._say_export(f"Preparing {download.title} \u2026")
        try:
            name, content = make_download(self._bench.result.path, download)
        except OasisError as error:
            self._say_export(str(error))
            return
        self._client.send_file_download(name, content, save_immediately=True)
        self._say_export(f"{name} was sent to your browser ({len(content) / 1e6:.1f} MB).")

    def _say_export(self, status: str) -> None:
        with self._lock:
            self.choices.export_status = status
            self._page.show_export()
