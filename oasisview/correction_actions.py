"""What one person says about identities: same, merged, two, no object; and earlier states brought back.

Every correction is asked about first, in a sentence that says what it will change. What was asked is what is
written: if somebody else decided on any of the objects meanwhile, it is a conflict and nothing is written.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from oasisview import events, wording
from oasisview.correction_words import PICK_WORDS, event_words, restore_words, will_happen
from oasisview.page import Page
from oasisview.panels.journal import PAGE_LENGTH
from oasisview.queue_actions import SelectObject
from oasisview.queue_filter import next_to_review
from oasisview.review import ConflictError, CorrectedMap, Decision, Kind, corrections
from oasisview.review.corrections import Correction
from oasisview.shell import Shell
from oasisview.wording import LABEL_OF_NAME
from oasisview.workbench import Workbench
from pipeline.errors import InputError

_AT_ONCE: dict[str, Callable[[CorrectedMap, int], Correction]] = {
    "split": corrections.split_visits,
    "apart": corrections.take_apart,
    "drop": corrections.drop,
}
_PICKED = {"same": Kind.SAME, "merge": Kind.MERGE}
_TITLES = {
    Kind.SAME: "The same object?",
    Kind.MERGE: "Pieces of one object?",
    Kind.SPLIT: "Not one object?",
    Kind.DROP: "Not an object?",
    Kind.KEEP: "An object after all?",
}


@dataclass(frozen=True)
class _Asked:
    """What a dialog is open about: a correction or an earlier state, as of ``seen_event_id``."""

    seen_event_id: int
    correction: Correction | None = None
    state_after: int = 0


class CorrectionActions:
    """The corrections of one tab.

    Args:
        shell, page, bench: the tab, its panels and the open result.
        lock: held while the page's choices change.
        select: shows an object.
    """

    def __init__(
        self, shell: Shell, page: Page, bench: Workbench, lock: threading.RLock, select: SelectObject
    ) -> None:
        self._shell = shell
        self._page = page
        self._decisions = bench.decisions
        self._choices = page.choices
        self._lock = lock
        self._select = select
        self._picking: tuple[Kind, int] | None = None
        self._asked: _Asked | None = None

    def bind(self) -> None:
        """Connect the events and commands of corrections and of the journal."""
        on = self._shell.on_event
        on("correct", self.begin, events.choice(*_PICKED, *_AT_ONCE))
        on("keep", lambda number: self._ask(lambda state: corrections.keep(state, number)), events.object_id)
        on("end_pick", lambda _: self.end_pick())
        answer = events.record(choice=events.choice("", "static", "moved"), reason=events.text())
        on("confirmed", self.answer, answer)
        on("restore", self.ask_restore, events.whole_number(0, events.OBJECT_ID_MAX))
        on("journal_who", self.show_journal_of, events.choice("mine", "all"))
        on("journal_more", lambda _: self.show_more_journal())
        for name, words in (
            ("same", "Correct: same as another object"),
            ("merge", "Correct: merge with another object"),
            ("split", "Correct: these are two objects"),
            ("drop", "Correct: not an object"),
        ):
            self._shell.add_command(words, None, partial(self.begin, name))

    def begin(self, name: str) -> None:
        """A correction of the selected object was chosen; some ask for the other object first."""
        with self._lock:
            selected = self._choices.selected
            if selected is None:
                self._shell.toast("Select an object first: click one, or press J.")
                return
            if name in _AT_ONCE:
                self._ask(lambda state: _AT_ONCE[name](state, selected))
                return
            self._picking = (_PICKED[name], selected)
            self._shell.set_picking(PICK_WORDS[_PICKED[name]].format(name=wording.object_name(selected)))

    def end_pick(self) -> None:
        """No other object after all."""
        with self._lock:
            self._picking = None
            self._shell.set_picking("")

    def picked(self, object_id: int) -> bool:
        """An object was clicked; whether that was the other one of a correction."""
        with self._lock:
            if self._picking is None:
                return False
            kind, selected = self._picking
            if object_id == selected:
                self._shell.toast("That is this object itself: click the other one, or press Esc.")
                return True
            self.end_pick()
            if kind is Kind.SAME:
                self._ask(lambda state: corrections.same(state, selected, object_id))
            else:
                self._ask(lambda state: corrections.merge(state, (selected, object_id)))
            return True

    def ask_restore(self, event_id: int) -> None:
        """Show what going back to the state after an entry of the journal would do; 0 = before the first."""
        with self._lock:
            seen = self._decisions.last_event_id
            change = self._decisions.restoring(event_id)
            if not change.taken and not change.brought:
                self._shell.toast("That is how things stand now.")
                return
            history = self._decisions.history()
            taken, brought = (
                [history[i - 1] for i in sorted(numbers)] for numbers in (change.taken, change.brought)
            )
            self._asked = _Asked(seen, state_after=event_id)
            self._shell.confirm(
                "Go back to an earlier state?", restore_words(event_id, taken, brought), {"": "Go back"}
            )

    def show_journal_of(self, whose: str) -> None:
        """List everybody's entries or this person's only."""
        with self._lock:
            self._choices.journal_mine = whose == "mine"
            self._page.show_journal()

    def show_more_journal(self) -> None:
        """List older entries too."""
        with self._lock:
            self._choices.journal_length += PAGE_LENGTH
            self._page.show_journal()

    def answer(self, answer: dict[str, Any]) -> None:
        """The dialog was confirmed, with a reason that may be empty."""
        with self._lock:
            asked, self._asked = self._asked, None
            if asked is None:
                return
            try:
                if asked.correction is None:
                    self._restore(asked, answer["reason"])
                else:
                    self._correct(asked, answer)
            except ConflictError as conflict:
                self._decisions.refresh()
                self._choices.conflict = str(conflict)
                self._page.show_evidence()
                self._shell.toast(f"Not saved: {conflict}")

    def _ask(self, make: Callable[[CorrectedMap], Correction]) -> None:
        with self._lock:
            seen = self._decisions.last_event_id
            before = self._decisions.corrected
            try:
                correction = make(before)
                after = self._decisions.preview(correction)
            except InputError as error:
                self._shell.toast(str(error))
                return
            self._asked = _Asked(seen, correction)
            buttons = {"": "Save"}
            if correction.kind is Kind.SAME:
                buttons = {"static": "It stayed", "moved": "It moved", "": "Save"}
            self._shell.confirm(_TITLES[correction.kind], will_happen(correction, before, after), buttons)

    def _correct(self, asked: _Asked, answer: dict[str, Any]) -> None:
        correction = asked.correction
        assert correction is not None
        if answer["choice"] and correction.kind is Kind.SAME:
            said = replace(correction.groups[0], label=LABEL_OF_NAME[answer["choice"]])
            correction = replace(correction, groups=(said, *correction.groups[1:]))
        decision = self._decisions.correct(
            correction, who=self._shell.user, reason=answer["reason"], seen_event_id=asked.seen_event_id
        )
        self._shell.toast(f"Saved: {self._words(decision)}.", undo=True)
        state = self._decisions.corrected
        shown = state.object_of.get(min(correction.groups[0].members), 0)
        if not shown:
            order = self._page.queue_order()
            shown = next_to_review(order, self._decisions.verdicts, None) or 0
        if shown:
            self._select(shown, fly=True)

    def _restore(self, asked: _Asked, reason: str) -> None:
        decision = self._decisions.restore(
            asked.state_after, who=self._shell.user, reason=reason, seen_event_id=asked.seen_event_id
        )
        if decision is not None:
            self._shell.toast(f"Saved: {self._words(decision)}.", undo=True)

    def _words(self, decision: Decision) -> str:
        event = self._decisions.history()[decision.event_id - 1]
        return event_words(event, self._decisions.corrected.machine)
