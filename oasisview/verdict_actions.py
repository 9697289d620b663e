"""What one person decides: labels with a reason, acceptances, notes, undo and redo."""

from __future__ import annotations

import threading
from typing import Protocol

from oasisview import wording
from oasisview.page import Page
from oasisview.panels import queue
from oasisview.review import ConflictError, Decision
from oasisview.shell import Shell
from oasisview.wording import LABEL_NAMES
from oasisview.workbench import Workbench
from pipeline.result import ChangeLabel, MapObject


class SelectObject(Protocol):
    """Shows an object everywhere (``Inspector.select``)."""

    def __call__(self, object_id: int | None, *, fly: bool = False) -> None:
        """Show it; ``fly`` moves the camera there."""


class VerdictActions:
    """The decisions of one tab, on the object that is selected there.

    Args:
        shell, page, bench: the tab, its panels and the open result.
        lock: held while the page's choices change.
        select: moves on to the next object.
    """

    def __init__(
        self, shell: Shell, page: Page, bench: Workbench, lock: threading.RLock, select: SelectObject
    ) -> None:
        self._shell = shell
        self._page = page
        self._objects = bench.catalogue.objects
        self._catalogue = bench.catalogue
        self._decisions = bench.decisions
        self._choices = page.choices
        self._lock = lock
        self._select = select

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
            self._choices.pending_label = (item.object_id, label)
            self._shell.ask_reason(
                f"Why is {wording.object_name(item.object_id)} {LABEL_NAMES[label]}?",
                f"The machine said {LABEL_NAMES[item.label]}. {wording.REASON_HINT}",
            )

    def accept(self) -> None:
        """Confirm the machine's label of the selected object."""
        item = self._selected()
        if item is not None:
            self.ask(item.label)

    def give_reason(self, reason: str) -> None:
        """Store the label that was asked about; an empty reason is refused and the question stays open."""
        with self._lock:
            if self._choices.pending_label is None:
                return
            if not reason:
                self._shell.toast("Not saved: write a reason, or choose \u201cNo reason\u201d.")
                return
            self._store_pending(reason)

    def give_no_reason(self) -> None:
        """Store the label that was asked about, and that the person would not say why."""
        with self._lock:
            self._store_pending(wording.NO_REASON)

    def undo(self) -> None:
        """Take back this person's latest decision."""
        self._turn(self._decisions.undo(self._shell.user), "Undone", "Nothing to undo.")

    def redo(self) -> None:
        """Restore what was taken back last."""
        self._turn(self._decisions.redo(self._shell.user), "Redone", "Nothing to redo.")

    def note(self, text: str) -> None:
        """Write something down about the selected object."""
        item = self._selected()
        if item is None or not text:
            return
        self._decisions.note(item.object_id, text, who=self._shell.user)
        self._shell.toast("Note saved.")

    def _selected(self) -> MapObject | None:
        chosen = self._choices.selected
        return self._objects.get(chosen) if chosen is not None else None

    def _turn(self, decision: Decision | None, done: str, nothing: str) -> None:
        if decision is None:
            self._shell.toast(nothing)
            return
        label = LABEL_NAMES[self._decisions.label_of(decision.object_id)]
        self._shell.toast(f"{done}: {wording.object_name(decision.object_id)} is {label}.")
        self._select(decision.object_id, fly=decision.object_id != self._choices.selected)

    def _store_pending(self, reason: str) -> None:
        pending, self._choices.pending_label = self._choices.pending_label, None
        if pending is not None:
            self._decide(*pending, reason)

    def _decide(self, object_id: int, label: ChangeLabel, reason: str) -> None:
        try:
            decision = self._decisions.decide(
                object_id,
                label,
                who=self._shell.user,
                reason=reason,
                seen_event_id=self._page.seen_event_id,
            )
        except ConflictError as conflict:
            self._decisions.refresh()
            self._choices.conflict = str(conflict)
            self._page.show_evidence()
            return
        order = queue.queue_order(self._catalogue, self._decisions.verdicts, self._choices.shown)
        did = "accepted as" if label is self._objects[object_id].label else "set to"
        name = wording.object_name(object_id).capitalize()
        self._shell.toast(f"Saved: {name} {did} {LABEL_NAMES[decision.new_label]}.", undo=True)
        following = queue.next_to_review(order, self._decisions.verdicts, None)
        if following is not None:
            self._select(following, fly=True)
        else:
            self._page.show_evidence()
