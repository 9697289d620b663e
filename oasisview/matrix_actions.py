"""What one person does in the score matrix: which numbers, which part of it, which pair."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import cast

from oasisview import events
from oasisview.matrix_window import SPANS, Around, MatrixWindow, display_order, shown_part
from oasisview.page import Page
from oasisview.panels.matrix import KINDS, cell_at
from oasisview.shell import Shell
from oasisview.workbench import Workbench
from pipeline.result import ScoreMatrix

_ANY_INDEX = events.whole_number(0, 1_000_000)


class MatrixActions:
    """The matrix tab of one page.

    Args:
        shell, page, bench: the tab, its panels and the open result.
        lock: held while the page's choices change.
    """

    def __init__(self, shell: Shell, page: Page, bench: Workbench, lock: threading.RLock) -> None:
        self._shell = shell
        self._page = page
        self._bench = bench
        self._lock = lock

    @property
    def _matrix(self) -> ScoreMatrix:
        return self._bench.catalogue.result.score_matrix

    def bind(self) -> None:
        """Connect the tab's events."""
        on = self._shell.on_event
        on("matrix", self.click, events.pixel_click)
        on("matrix_cell", self.show_pair, events.record(row=_ANY_INDEX, column=_ANY_INDEX))
        on("matrix_kind", self.set_kind, events.choice(*KINDS))
        on("matrix_around", self.set_around, events.choice("rivals", "place"))
        on("matrix_move", self.move, events.list_of(events.whole_number(-1, 1), 2))
        on("matrix_span", self.zoom, events.whole_number(min(SPANS), max(SPANS)))

    def set_kind(self, kind: str) -> None:
        """Which numbers the matrix shows."""
        with self._lock:
            self._page.choices.matrix_kind = kind
            self._page.show_matrix()

    def click(self, click: events.PixelClick) -> None:
        """Show the part around a click in the picture of the whole matrix, and the pair under it."""
        with self._lock:
            shape = self._matrix.sigma.shape
            place = cell_at(shape, click.u, click.v)
            if place is None:
                return
            order = display_order(self._matrix)
            self._page.choices.cell = (int(order[0][place[0]]), int(order[1][place[1]]))
            self._look(self._window.centred(*place, shape))

    def show_pair(self, pair: dict[str, int]) -> None:
        """Show the pair of a cell, before and after; the part that is shown stays."""
        with self._lock:
            rows, columns = self._matrix.sigma.shape
            if pair["row"] < rows and pair["column"] < columns:
                self._page.choices.cell = (pair["row"], pair["column"])
                self._page.show_matrix()

    def set_around(self, around: str) -> None:
        """An object with its rivals, or a piece of the picture."""
        with self._lock:
            window = replace(self._window, around=cast(Around, around))
            self._look(window.moved(0, 0, self._matrix.sigma.shape) if around == "place" else window)

    def move(self, by: list[int]) -> None:
        """Another piece of the picture, most of a window further."""
        with self._lock:
            if len(by) == 2:
                step = self._window.span - 2
                self._look(self._window.moved(by[0] * step, by[1] * step, self._matrix.sigma.shape))

    def zoom(self, span: int) -> None:
        """More objects and smaller, or fewer and larger."""
        with self._lock:
            nearest = min(SPANS, key=lambda known: abs(known - span))
            self._look(self._window.zoomed(nearest, self._matrix.sigma.shape))

    @property
    def _window(self) -> MatrixWindow:
        return self._page.choices.matrix_window

    def _look(self, window: MatrixWindow) -> None:
        self._page.choices.matrix_window = window
        self._page.show_matrix()

    def forget_pair_without(self, object_id: int) -> None:
        """A pair or a piece that an object has no part in is no longer looked at; the lock is held."""
        cell, matrix = self._page.choices.cell, self._matrix
        if cell is not None and object_id not in (
            matrix.row_object_ids[cell[0]],
            matrix.column_object_ids[cell[1]],
        ):
            self._page.choices.cell = None
        rows, columns = shown_part(matrix, self._window, object_id, None)
        if (
            object_id not in matrix.row_object_ids[rows]
            and object_id not in matrix.column_object_ids[columns]
        ):
            self._page.choices.matrix_window = replace(self._window, around="rivals")
