"""What one person decides: labels with a reason, acceptances, notes, undo and redo."""

from __future__ import annotations

import threading

from oasisview import wording
from oasisview.correction_words import event_words
from oasisview.page import Page
from oasisview.queue_actions import SelectObject
from oasisview.queue_filter import next_to_review
from oasisview.review import CORRECTIONS, ConflictError, CorrectedMap, Decision, Kind
from oasisview.shell import Shell
from oasisview.wording import LABEL_NAMES
from oasisview.workbench import Workbench
from pipeline.result import ChangeLabel, MapObject


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
        before = self._decisions.corrected
        self._turn(self._decisions.undo(self._shell.user), before, "Undone", "Nothing to undo.")

    def redo(self) -> None:
        """Restore what was taken back last."""
        before = self._decisions.corrected
        self._turn(self._decisions.redo(self._shell.user), before, "Redone", "Nothing to redo.")

    def note(self, text: str) -> None:
        """Write something down about the selected object."""
        item = self._selected()
        if item is None or not text:
            return
        self._decisions.note(item.object_id, text, who=self._shell.user)
        self._shell.toast("Note saved.")

    def _selected(self) -> MapObject | None:
        chosen = self._choices.selected
        return self._catalogue.objects.get(chosen) if chosen is not None else None

    def _turn(self, decision: Decision | None, before: CorrectedMap, done: str, nothing: str) -> None:
        if decision is None:
            self._shell.toast(nothing)
            return
        state = self._decisions.corrected
        object_id = state.present_id(decision.object_id)
        same = decision.kind is not Kind.NOTE and state.objects == before.objects
        rest = " What others decided since still counts." if same else ""
        if decision.kind in (*CORRECTIONS, Kind.RESTORE):
            event = self._decisions.history()[decision.event_id - 1]
            self._shell.toast(f"{done}: {event_words(event, state.machine)}.{rest}")
        else:
            label = LABEL_NAMES[self._decisions.label_of(object_id or 0)]
            name = wording.object_name(object_id or decision.object_id)
            self._shell.toast(f"{done}: {name} is {label}.{rest}")
        if object_id is not None:
            self._select(object_id, fly=object_id != self._choices.selected)

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
        order = self._page.queue_order()
        item = self._catalogue.objects.get(object_id)
        did = "accepted as" if item is not None and label is item.label else "set to"
        name = wording.object_name(object_id).capitalize()
        self._shell.toast(f"Saved: {name} {did} {LABEL_NAMES[decision.new_label]}.", undo=True)
        following = next_to_review(order, self._decisions.verdicts, None)
        if following is not None:
            self._select(following, fly=True)
        else:
            self._page.show_evidence()
