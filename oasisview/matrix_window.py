"""Which part of the score matrix is shown close up, and in which order the whole of it is drawn.

In the order of the picture partners stand on the diagonal, so that what is off it catches the eye.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.result import ScoreMatrix

SPANS = (7, 14)  # rows and columns: with numbers, and with colours alone
Around = Literal["rivals", "place"]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class MatrixWindow:
    """What a person looks at.

    Attributes:
        around: ``rivals`` = an object with all that compete with it; ``place`` = a piece of the picture.
        span: most rows and columns.
        corner: first row and column of a piece, in the order of the picture.
    """

    around: Around = "rivals"
    span: int = SPANS[0]
    corner: tuple[int, int] = (0, 0)

    def moved(self, rows: int, columns: int, shape: tuple[int, int]) -> MatrixWindow:
        """A piece further down and right, within the matrix."""
        return self.placed(self.corner[0] + rows, self.corner[1] + columns, shape)

    def placed(self, row: int, column: int, shape: tuple[int, int]) -> MatrixWindow:
        """A piece that starts at a row and column of the picture, or as near as the matrix allows."""
        ends = [max(count - self.span, 0) for count in shape]
        corner = (min(max(row, 0), ends[0]), min(max(column, 0), ends[1]))
        return replace(self, around="place", corner=corner)

    def centred(self, row: int, column: int, shape: tuple[int, int]) -> MatrixWindow:
        """A piece around a row and column of the picture."""
        return self.placed(row - self.span // 2, column - self.span // 2, shape)

    def zoomed(self, span: int, shape: tuple[int, int]) -> MatrixWindow:
        """As much of the matrix as ``span`` says, with the same middle."""
        grown = (span - self.span) // 2
        zoomed = replace(self, span=span)
        if self.around == "rivals":
            return zoomed
        return zoomed.placed(self.corner[0] - grown, self.corner[1] - grown, shape)


def display_order(matrix: ScoreMatrix) -> tuple[Indices, Indices]:
    """Rows and columns in the order of the picture: partners along the diagonal first, then the rest."""
    rows, columns = matrix.row_object_ids.tolist(), matrix.column_object_ids.tolist()
    column_of = {object_id: column for column, object_id in reversed(list(enumerate(columns))) if object_id}
    paired: dict[int, int] = {}
    for row, object_id in enumerate(rows):
        column = column_of.pop(object_id, None)
        if column is not None:
            paired[row] = column
    taken = set(paired.values())
    order0 = [*paired, *(row for row in range(len(rows)) if row not in paired)]
    order1 = [*paired.values(), *(column for column in range(len(columns)) if column not in taken)]
    return np.array(order0, np.intp), np.array(order1, np.intp)


def shown_part(
    matrix: ScoreMatrix, window: MatrixWindow, selected: int | None, cell: tuple[int, int] | None
) -> tuple[Indices, Indices]:
    """Rows and columns (of the matrix) to show close up, in the order of the picture.

    Args:
        selected: object to start from; cell: row and column to start from, rather than the object.

    Returns:
        None of either where there is nothing to start from.
    """
    order = display_order(matrix)
    if window.around == "place":
        row, column = window.corner
        return order[0][row : row + window.span], order[1][column : column + window.span]
    part = _rivals(matrix, window.span, selected, cell)
    return order[0][np.isin(order[0], part[0])], order[1][np.isin(order[1], part[1])]


def _rivals(
    matrix: ScoreMatrix, span: int, selected: int | None, cell: tuple[int, int] | None
) -> tuple[Indices, Indices]:
    none = np.zeros(0, np.intp)
    row, column = cell if cell is not None else _place_of(matrix, selected)
    sigma = np.asarray(matrix.sigma, np.float64)
    if row is None and column is None:
        return none, none
    if row is None:
        assert column is not None
        row = int(np.argmax(sigma[:, column]))
    columns = _best(sigma[row], span, column)
    # Whoever else wants the same counterparts: that is what the assignment had to settle.
    return _best(sigma[:, columns].max(axis=1), span, row), columns


def _place_of(matrix: ScoreMatrix, object_id: int | None) -> tuple[int | None, int | None]:
    rows = np.flatnonzero(matrix.row_object_ids == object_id)
    columns = np.flatnonzero(matrix.column_object_ids == object_id)
    return (int(rows[0]) if len(rows) else None, int(columns[0]) if len(columns) else None)


def _best(values: NDArray[np.float64], count: int, kept: int | None) -> Indices:
    order = np.argsort(-values, kind="stable")
    if kept is not None:
        order = np.concatenate([[kept], order[order != kept]])
    return order[:count].astype(np.intp)
