"""What one person does with the queue: search, filter, put off, go through it."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any, Protocol

from oasisview import events, memory
from oasisview.page import Page
from oasisview.queue_filter import DECIDED, SIZES, VISITS, QueueFilter, next_to_review, step
from oasisview.shell import Shell
from oasisview.wording import LABEL_OF_NAME
from oasisview.workbench import Workbench


class SelectObject(Protocol):
    """Shows an object everywhere (``Inspector.select``)."""

    def __call__(self, object_id: int | None, *, fly: bool = False) -> None:
        """Show it; ``fly`` moves the camera there."""


class QueueActions:
    """The queue of one tab.

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

    def bind(self) -> None:
        """Connect the queue's events and keys."""
        on, percent = self._shell.on_event, events.whole_number(0, 100)
        on("filter", self.toggle_label, events.choice(*LABEL_OF_NAME))
        on("search", lambda text: self._narrow(search=text), events.text(12), latest_only=True)
        on("search_open", self.open_found, events.text(12))
        on("queue_decided", lambda value: self._narrow(decided=value), events.choice(*DECIDED))
        on("queue_visit", lambda value: self._narrow(visit=value), events.choice(*VISITS))
        on("queue_size", lambda value: self._narrow(size=value), events.choice(*SIZES))
        on("queue_low", lambda value: self._narrow(low_percent=value), percent, latest_only=True)
        on("queue_high", lambda value: self._narrow(high_percent=value), percent, latest_only=True)
        on("queue_disagreement", lambda value: self._narrow(disagreement=value), events.flag)
        on("queue_all", lambda _: self.show_all())
        on("skip", lambda _: self.skip())
        self._shell.add_command("Next object in the queue", "J", lambda: self.step(1))
        self._shell.add_command("Previous object in the queue", "K", lambda: self.step(-1))

    def step(self, by: int) -> None:
        """Select the object ``by`` rows further down."""
        self._select(step(self._page.queue_order(), self._choices.selected, by), fly=True)

    def toggle_label(self, name: str) -> None:
        """Show or hide a label."""
        with self._lock:
            self._choices.shown = self._choices.shown ^ {LABEL_OF_NAME[name]}
            self._page.show_queue()
            self._shell.remember(memory.tastes(self._choices))

    def show_all(self) -> None:
        """End search and filter."""
        with self._lock:
            self._choices.queue = QueueFilter()
            self._page.show_queue_tools()
            self._page.show_queue()

    def open_found(self, text: str) -> None:
        """Select what was searched for, also by a number that it had before it was merged."""
        with self._lock:
            self._choices.queue = replace(self._choices.queue, search=text)
            number = self._choices.queue.number
            found = self._decisions.corrected.present_id(int(number)) if number else None
            order = self._page.queue_order()
            self._page.show_queue()
            if found is None and order:
                found = order[0].object_id
            if found is None:
                self._shell.toast(f"No object {text}." if text else "Type an object's number, such as 12.")
                return
        self._select(found, fly=True)

    def skip(self) -> None:
        """Put the selected object off, to the end of what this tab has still to decide."""
        with self._lock:
            chosen = self._choices.selected
            verdicts = self._decisions.verdicts
            if chosen is None:
                self._shell.toast("Select an object first: click one, or press J.")
                return
            if chosen in verdicts:
                self._shell.toast("This object is decided already.")
                return
            following = next_to_review(self._page.queue_order(), verdicts, chosen)
            self._choices.skipped = (*(i for i in self._choices.skipped if i != chosen), chosen)
            self._page.show_queue()
        if following is None or following == chosen:
            self._shell.toast("Nothing else is left to decide.")
        else:
            self._select(following, fly=True)

    def _narrow(self, **changes: Any) -> None:
        with self._lock:
            self._choices.queue = replace(self._choices.queue, **changes)
            self._page.show_queue()
