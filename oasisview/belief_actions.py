"""Looking back at what was believed: the map as it was after a submap, in step with the band."""

from __future__ import annotations

import threading
from collections.abc import Callable

from oasisview import events
from oasisview.belief import labels_after, moments, row_at
from oasisview.page import Page
from oasisview.panels.belief_strip import slider_html
from oasisview.preview import Preview
from oasisview.shell import Shell
from oasisview.workbench import Workbench


class BeliefActions:
    """The belief of one page: off, or at a moment.

    Args:
        shell, page, bench: the tab, its panels and the open result.
        preview: colours of the map.
        lock: held while the page's choices change.
        show_keyframe: shows a keyframe of a visit in the band.
    """

    def __init__(
        self,
        shell: Shell,
        page: Page,
        bench: Workbench,
        preview: Preview,
        lock: threading.RLock,
        show_keyframe: Callable[[int, int], None],
    ) -> None:
        self._shell = shell
        self._page = page
        self._catalogue = bench.catalogue
        self._preview = preview
        self._lock = lock
        self._show_keyframe = show_keyframe
        self._moments = moments(bench.catalogue)

    def bind(self) -> None:
        """Connect the strip, the slider and the switch over the map."""
        step = events.whole_number(-1, 1_000_000)
        self._shell.on_event("belief_moment", self.go_to, step, latest_only=True)
        self._shell.on_event("belief", lambda _: self.toggle())

    def toggle(self) -> None:
        """Look back from the keyframe in the band, or stop looking back."""
        with self._lock:
            choices = self._page.choices
            if choices.belief is not None:
                self._preview.end()
            elif not self._moments:
                self._shell.toast("The later visit holds no keyframe: there is nothing to look back at.")
            elif choices.session == 1:
                self._show(row_at(self._moments, choices.keyframe))
            else:
                self.go_to(len(self._moments) - 1)

    def go_to(self, number: int) -> None:
        """Show a moment, and its keyframe in the band; -1 is before the first."""
        with self._lock:
            if number >= len(self._moments):
                return
            self._show(number, from_slider=self._page.choices.belief is not None)
            self._show_keyframe(1, self._moments[number].keyframe if number >= 0 else 0)

    def follow_keyframe(self) -> None:
        """The band shows another keyframe; the lock is held."""
        choices = self._page.choices
        if choices.belief is not None and choices.session == 1:
            number = row_at(self._moments, choices.keyframe)
            if number != choices.belief:
                self._show(number)

    def _show(self, number: int, *, from_slider: bool = False) -> None:
        self._page.choices.belief = number
        labels = labels_after(self._catalogue, self._moments[number].row if number >= 0 else None)
        count = len(self._catalogue.session(1).keyframes)
        bar = slider_html(self._moments, number, count)
        self._preview.show(bar, labels, self._ended, keep_bar=from_slider)
        self._page.show_evidence()

    def _ended(self) -> None:
        self._page.choices.belief = None
        self._page.show_evidence()
