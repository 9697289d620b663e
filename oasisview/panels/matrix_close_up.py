"""A readable part of the score matrix: an object against its rivals, cell by cell, for mouse and keyboard."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import share_colour
from oasisview.panels.markup import section, sends
from oasisview.shell import escape
from pipeline.result import ScoreMatrix

ROWS, COLUMNS = 7, 7


def close_up(
    matrix: ScoreMatrix, selected: int | None, cell: tuple[int, int] | None
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns to show around the picked cell, else around an object: it and its rivals.

    Returns:
        Indices of at most ``ROWS`` rows and ``COLUMNS`` columns in their order in the matrix; none where
        there is nothing to start from.
    """
    none = np.zeros(0, np.intp)
    row, column = cell if cell is not None else _place_of(matrix, selected)
    sigma = np.asarray(matrix.sigma, np.float64)
    if row is None and column is None:
        return none, none
    if row is None:
        assert column is not None
        row = int(np.argmax(sigma[:, column]))
    columns = _best(sigma[row], COLUMNS, column)
    # Whoever else wants the same counterparts: that is what the assignment had to settle.
    rows = _best(sigma[:, columns].max(axis=1), ROWS, row)
    return rows, columns


def _place_of(matrix: ScoreMatrix, object_id: int | None) -> tuple[int | None, int | None]:
    rows = np.flatnonzero(matrix.row_object_ids == object_id)
    columns = np.flatnonzero(matrix.column_object_ids == object_id)
    return (int(rows[0]) if len(rows) else None, int(columns[0]) if len(columns) else None)


def _best(values: NDArray[np.float64], count: int, kept: int | None) -> NDArray[np.intp]:
    order = np.argsort(-values, kind="stable")
    if kept is not None:
        order = np.concatenate([[kept], order[order != kept]])
    return np.sort(order[:count])


def close_up_html(
    catalogue: Catalogue,
    kind: str,
    selected: int | None,
    cell: tuple[int, int] | None,
    describe: Callable[[int, int], str],
) -> str:
    """The part as a table with object numbers; ``describe`` says what a cell (row, column) means."""
    matrix = catalogue.result.score_matrix
    rows, columns = close_up(matrix, selected, cell)
    if len(rows) == 0:
        return '<div class="oa-note">Select an object to see its part of the matrix close up.</div>'
    values = matrix.sigma if kind == "sigma" else matrix.s_bar
    names = matrix.column_object_ids[columns].tolist()
    head = "".join(_number(name, "after", selected, "col") for name in names)
    body = []
    for row in rows.tolist():
        before = int(matrix.row_object_ids[row])
        cells = []
        for column, after in zip(columns.tolist(), names, strict=True):
            value = float(values[row, column])
            words = (
                f"#{before} before, #{after} after: {describe(row, column)}; "
                f"\u03c3 {matrix.sigma[row, column]:.2f}, quality {matrix.s_bar[row, column]:.2f}"
            )
            ground, ink = share_colour(value)
            marks = " oa-chosen" if before == after else ""
            pressed = str(cell == (row, column)).lower()
            cells.append(
                f'<td><button class="oa-cell{marks}" aria-pressed="{pressed}" title="{escape(words)}" '
                f'aria-label="{escape(words)}" style="background:{ground};color:{ink}" '
                f"{sends('matrix_cell', {'before': before, 'after': after})}>{value:.2f}</button></td>"
            )
        body.append(f"<tr>{_number(before, 'before', selected, 'row')}{''.join(cells)}</tr>")
    return (
        section("Close up", "rows before, columns after")
        + f'<table class="oa-heat oa-close-up"><tr><td></td>{head}</tr>{"".join(body)}</table>'
        + '<div class="oa-note">Framed: chosen partners. A cell shows the pair below.</div>'
    )


def _number(object_id: int, when: str, selected: int | None, scope: str) -> str:
    own = ' class="oa-own-number"' if object_id == selected else ""
    return (
        f'<th scope="{scope}"{own}><button title="Select object #{object_id} ({when})" '
        f"{sends('select', object_id)}>{object_id}</button></th>"
    )
