"""What one person does in the score matrix: which numbers, which pair."""

from __future__ import annotations

import threading

from oasisview import events
from oasisview.page import Page
from oasisview.panels.matrix import KINDS, cell_at, cell_of
from oasisview.shell import Shell
from oasisview.workbench import Workbench


class MatrixActions:
    """The matrix tab of one page.

    Args:
        shell, page, bench: the tab, its panels and the open result.
        lock: held while the page's choices change.
    """

    def __init__(self, shell: Shell, page: Page, bench: Workbench, lock: threading.RLock) -> None:
        self._shell = shell
        self._page = page
        self._matrix = bench.catalogue.result.score_matrix
        self._lock = lock

    def bind(self) -> None:
        """Connect the tab's events."""
        on = self._shell.on_event
        on("matrix", self.click, events.pixel_click)
        on("matrix_cell", self.show_pair, events.record(before=events.object_id, after=events.object_id))
        on("matrix_kind", self.set_kind, events.choice(*KINDS))

    def set_kind(self, kind: str) -> None:
        """Which numbers the matrix shows."""
        with self._lock:
            self._page.choices.matrix_kind = kind
            self._page.show_matrix()

    def click(self, click: events.PixelClick) -> None:
        """Show the pair under a click in the picture of the whole matrix."""
        with self._lock:
            self._page.choices.cell = cell_at(self._matrix.sigma.shape, click.u, click.v)
            self._page.show_matrix()

    def show_pair(self, pair: dict[str, int]) -> None:
        """Show a pair of objects of the matrix, before and after."""
        with self._lock:
            self._page.choices.cell = cell_of(self._matrix, pair["before"], pair["after"])
            self._page.show_matrix()

    def forget_pair_without(self, object_id: int) -> None:
        """A pair that an object has no part in is no longer what is looked at; the lock is held."""
        cell = self._page.choices.cell
        if cell is not None and object_id not in (
            self._matrix.row_object_ids[cell[0]],
            self._matrix.column_object_ids[cell[1]],
        ):
            self._page.choices.cell = None
