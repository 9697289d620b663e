"""What one person does with patches in the band: pick one, show those of the selected object."""

from __future__ import annotations

import threading
from collections.abc import Callable

from oasisview.events import PixelClick
from oasisview.page import Page
from oasisview.patch_links import PatchPick
from oasisview.shell import Shell
from oasisview.workbench import Workbench


class PatchActions:
    """Patch matches in the band of one page.

    Args:
        shell, page, bench: the tab, its panels and the open result.
        lock: held while the page's choices change.
        show_band: draws the band anew.
    """

    def __init__(
        self, shell: Shell, page: Page, bench: Workbench, lock: threading.RLock, show_band: Callable[[], None]
    ) -> None:
        self._shell = shell
        self._page = page
        self._catalogue = bench.catalogue
        self._lock = lock
        self._show_band = show_band

    def bind(self) -> None:
        """Connect the band's switch and the mark that hides a match."""
        self._shell.on_event("patch_clear", lambda _: self.clear())
        self._shell.on_event("links", lambda _: self.toggle())

    def pick(self, click: PixelClick) -> None:
        """Remember the patch under a click for when the band is drawn; the caller draws it."""
        choices = self._page.choices
        shown = self._catalogue.covisible(choices.session, choices.keyframe)
        if shown is None:
            choices.patch = None
            return
        pair = (choices.keyframe, shown.other_keyframe)
        pair = pair if choices.session == 0 else (pair[1], pair[0])
        if click.keyframe == pair[click.session]:
            choices.patch = PatchPick(click.session, pair, click.u, click.v)

    def clear(self) -> None:
        """Show no patch."""
        with self._lock:
            self._page.choices.patch = None
            self._show_band()

    def toggle(self) -> None:
        """Show or hide the matches of the selected object."""
        with self._lock:
            self._page.choices.links = not self._page.choices.links
            self._show_band()
