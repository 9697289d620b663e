"""What stands beside the map in one tab: panels of viser and regions of the shell, filled from the state.

Callers hold the inspector's lock.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import viser

from oasisview.catalogue import changed_labels
from oasisview.map_tools_panel import MapToolsPanel
from oasisview.matrix_window import MatrixWindow
from oasisview.panels import journal, queue
from oasisview.panels.band import band_html
from oasisview.panels.evidence import evidence_html
from oasisview.panels.export import export_html
from oasisview.panels.hud import Layers, hud_html, legend_html, who_html
from oasisview.panels.map_tools import tools_html
from oasisview.panels.matrix import matrix_html
from oasisview.panels.queue_tools import queue_tools_html
from oasisview.patch_links import PatchPick
from oasisview.queue_filter import QueueFilter, queue_order
from oasisview.shell import Shell
from oasisview.what_if_panel import WhatIfPanel
from oasisview.workbench import Workbench
from pipeline.result import ChangeLabel, MapObject


@dataclass
class Choices:
    """What one inspector chose; nothing here is shared."""

    selected: int | None = None
    session: int = 1
    keyframe: int = 0
    mode: str = "after"
    wanted_mode: str = "after"  # what the person chose; a selection may need another one for a while
    colours: str = "label"
    layers: Layers = field(default_factory=Layers)
    dark: bool = False
    shown: frozenset[ChangeLabel] = field(default_factory=changed_labels)
    swipe: bool = False
    matrix_kind: str = "sigma"
    cell: tuple[int, int] | None = None
    matrix_window: MatrixWindow = field(default_factory=MatrixWindow)
    patch: PatchPick | None = None
    links: bool = False  # the selected object's patch matches are drawn in the band
    belief: int | None = None  # the moment of the later visit that is looked back at
    queue: QueueFilter = field(default_factory=QueueFilter)
    skipped: tuple[int, ...] = ()
    journal_mine: bool = False
    journal_length: int = journal.PAGE_LENGTH
    pending_label: tuple[int, ChangeLabel] | None = None
    conflict: str = ""
    measuring: bool = False  # clicks in the map measure
    tape_hint: str = ""
    cut: bool = False  # parts of the map are not drawn
    export_status: str = ""
    export_share: float | None = None  # of an export that is being made


class Page:
    """Panels and regions of a tab.

    Attributes:
        seen_event_id: the last decision of anybody that the shown evidence includes.
    """

    def __init__(self, client: viser.ClientHandle, shell: Shell, bench: Workbench, choices: Choices) -> None:
        self._client = client
        self._shell = shell
        self._bench = bench
        self._catalogue = bench.catalogue
        self._decisions = bench.decisions
        self.choices = choices
        self.seen_event_id = bench.decisions.last_event_id

    def build(self, *, wide: bool) -> None:
        """Make the docked panels, empty."""
        gui = self._client.gui
        evidence = gui.add_panel()
        with evidence.add_tab("Evidence"):
            self._evidence = gui.add_html("")
        with evidence.add_tab("Matrix"):
            self._matrix = gui.add_html("")
        self.tools = MapToolsPanel(gui, evidence.add_tab("Map"))
        evidence.dock_right()
        evidence.set_width(420 if wide else 344)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(292 if wide else 240)
        gui.set_panel_label(self._bench.name)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Queue"):
            self._queue_tools = gui.add_html("")
            self._queue = gui.add_html("")
        self.what_if = WhatIfPanel(gui, tabs.add_tab("What-if"))
        with tabs.add_tab("Journal"):
            self._journal = gui.add_html("")
        with tabs.add_tab("Export"):
            self._export = gui.add_html("")

    def show_hud(self) -> None:
        """Switches and legend over the map."""
        choices = self.choices
        hud = hud_html(
            choices.mode, choices.colours, choices.layers, dark=choices.dark, measuring=choices.measuring
        )
        tools = tools_html(choices.tape_hint, cut=choices.cut)
        self._shell.set_html("hud", hud + tools)
        self._shell.set_html("legend", legend_html(choices.colours, choices.mode))

    def show_who(self) -> None:
        """Whose page this is, and who else is looking."""
        others = self._bench.others(self._client.client_id)
        self._shell.set_html("who", who_html(self._shell.user, others, self._bench.name))
        self._shell.set_cursors([(name, number) for name, number in others if number is not None])

    def show_queue(self) -> None:
        """The list of objects."""
        decisions = self._decisions
        self._queue.content = queue.queue_html(
            self._catalogue,
            decisions.verdicts,
            replace(self.choices.queue, labels=self.choices.shown),
            skipped=self.choices.skipped,
            disputed=decisions.disagreements.keys(),
            dropped=decisions.corrected.dropped,
        )

    def show_queue_tools(self) -> None:
        """Search and filters of the queue, as they are chosen."""
        self._queue_tools.content = queue_tools_html(self.choices.queue)

    def queue_order(self) -> list[MapObject]:
        """The objects that the queue lists, from top to bottom."""
        return queue_order(
            self._catalogue.by_doubt(),
            self._decisions.verdicts,
            replace(self.choices.queue, labels=self.choices.shown),
            skipped=self.choices.skipped,
            disputed=self._decisions.disagreements.keys(),
        )

    def show_evidence(self) -> None:
        """Why the selected object has its label; what is shown counts as seen."""
        choices = self.choices
        # What is on the screen is what a decision is based on: newer ones of others are a conflict.
        self.seen_event_id = self._decisions.last_event_id
        selected = choices.selected
        entry = self._decisions.corrected.objects.get(selected) if selected is not None else None
        self._evidence.content = evidence_html(
            self._catalogue,
            selected,
            self._decisions.verdicts.get(selected) if selected is not None else None,
            swipe=choices.swipe,
            belief=choices.belief,
            can_undo=self._decisions.can_undo(self._shell.user),
            can_redo=self._decisions.can_redo(self._shell.user),
            pieces=len(entry.machine_ids) if entry is not None else 1,
            conflict=choices.conflict or self._decisions.disagreement(selected),
        )

    def show_matrix(self) -> None:
        """The score matrix."""
        choices = self.choices
        self._matrix.content = matrix_html(
            self._catalogue, choices.matrix_kind, choices.selected, choices.cell, choices.matrix_window
        )

    def show_journal(self) -> None:
        """The list of decisions."""
        choices, decisions = self.choices, self._decisions
        self._journal.content = journal.journal_html(
            decisions.history(),
            decisions.corrected.machine,
            decisions.undone,
            user=self._shell.user,
            mine=choices.journal_mine,
            shown=choices.journal_length,
        )

    def show_export(self) -> None:
        """What can be downloaded."""
        listed = [i for i in self._catalogue.objects.values() if i.label in changed_labels()]
        reviewed = sum(item.object_id in self._decisions.verdicts for item in listed)
        choices = self.choices
        self._export.content = export_html(reviewed, len(listed), choices.export_status, choices.export_share)

    def show_band(self, *, whole: bool = False) -> None:
        """The band of keyframes; only what differs is swapped unless the whole is asked for."""
        choices = self.choices
        content = band_html(
            self._catalogue,
            choices.session,
            choices.keyframe,
            choices.selected,
            self._decisions.label_of,
            dark=choices.dark,
            pick=choices.patch,
            with_links=choices.links,
            swipe=choices.swipe,
        )
        if whole:
            self._shell.set_html("band", content)
        else:
            self._shell.swap_band(content)
