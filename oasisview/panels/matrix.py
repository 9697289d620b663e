"""The whole score matrix: objects of the earlier visit against objects of the later one."""

from __future__ import annotations

import numpy as np

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import CIVIDIS, gradient_css
from oasisview.matrix_window import MatrixWindow, display_order
from oasisview.panels.markup import empty, picture, section, sends
from oasisview.panels.matrix_close_up import close_up_html
from oasisview.shell import escape
from pipeline.result import ScoreMatrix

MAX_FRAMED = 60
KINDS = {"sigma": "matching patches \u03c3", "s_bar": "match quality s\u0304"}


def cell_at(shape: tuple[int, int], u: float, v: float) -> tuple[int, int] | None:
    """Row and column of the picture under a place (u, v) in [0, 1]; None for an empty matrix."""
    rows, columns = shape
    if rows == 0 or columns == 0:
        return None
    return min(int(v * rows), rows - 1), min(int(u * columns), columns - 1)


def pair_words(catalogue: Catalogue, row: int, column: int) -> str:
    """What the matrix says about a pair of objects, in a sentence without an end."""
    matrix = catalogue.result.score_matrix
    if matrix.row_object_ids[row] == matrix.column_object_ids[column]:
        return "chosen partners: one object, seen on both visits"
    if matrix.match_count[row, column] == 0:
        return "no patch of one finds its match on the other"
    sigma, s_bar = float(matrix.sigma[row, column]), float(matrix.s_bar[row, column])
    return wording.CASE_WORDS[wording.pair_case(sigma, s_bar, catalogue.limits)]


def matrix_html(
    catalogue: Catalogue,
    kind: str,
    selected: int | None,
    cell: tuple[int, int] | None,
    window: MatrixWindow | None = None,
) -> str:
    """The panel; a click in the picture arrives as the pixel event ``matrix``."""
    window = window or MatrixWindow()
    matrix = catalogue.result.score_matrix
    rows, columns = matrix.sigma.shape
    if rows == 0 or columns == 0:
        nothing = empty("There is no score matrix: one of the visits holds no objects.")
        return f'<div class="oa oa-matrix">{nothing}</div>'
    switch = "".join(
        f'<button aria-pressed="{str(kind == k).lower()}" {sends("matrix_kind", k)}>{name}</button>'
        for k, name in KINDS.items()
    )
    url = escape(catalogue.matrix_url(kind))

    def describe(row: int, column: int) -> str:
        return pair_words(catalogue, row, column)

    return (
        '<div class="oa oa-matrix">'
        f'<div class="oa-segments" role="group" aria-label="What is shown">{switch}</div>'
        f'<div class="oa-note">Rows: {rows} objects before. Columns: {columns} objects after. '
        "Chosen partners stand on the diagonal. Click a place to see it close up.</div>"
        f'<div class="oa-grid" style="aspect-ratio:{columns}/{rows}" '
        'data-pixel="matrix" data-session="0" data-keyframe="0">'
        f'<img src="{url}" alt="score matrix: {KINDS[kind]}" draggable="false">'
        f"{_marks(matrix, selected, cell, window)}</div>"
        f'<div class="oa-colours"><span>0</span><i style="background:{gradient_css(CIVIDIS)}"></i>'
        "<span>1</span></div>"
        f"{close_up_html(catalogue, kind, window, selected, cell, describe)}{_pair(catalogue, cell)}</div>"
    )


def _marks(
    matrix: ScoreMatrix, selected: int | None, cell: tuple[int, int] | None, window: MatrixWindow
) -> str:
    rows, columns = matrix.sigma.shape
    order = display_order(matrix)
    row_ids, column_ids = matrix.row_object_ids[order[0]], matrix.column_object_ids[order[1]]
    marks = []
    if max(rows, columns) <= MAX_FRAMED:  # more frames than that would hide what they frame
        for row, column in np.argwhere(row_ids[:, None] == column_ids[None, :]):
            marks.append(f'<rect class="oa-partner" x="{column}" y="{row}" width="1" height="1"/>')
    if selected is not None:
        for row in np.flatnonzero(row_ids == selected):
            marks.append(f'<rect class="oa-own" x="0" y="{row}" width="{columns}" height="1"/>')
        for column in np.flatnonzero(column_ids == selected):
            marks.append(f'<rect class="oa-own" x="{column}" y="0" width="1" height="{rows}"/>')
    if window.around == "place":
        high, wide = min(window.span, rows), min(window.span, columns)
        top, left = window.corner
        marks.append(f'<rect class="oa-window" x="{left}" y="{top}" width="{wide}" height="{high}"/>')
    if cell is not None:
        row, column = (int(np.flatnonzero(o == index)[0]) for o, index in zip(order, cell, strict=True))
        marks.append(f'<rect class="oa-picked" x="{column}" y="{row}" width="1" height="1"/>')
    return f'<svg viewBox="0 0 {columns} {rows}" preserveAspectRatio="none">{"".join(marks)}</svg>'


def _pair(catalogue: Catalogue, cell: tuple[int, int] | None) -> str:
    if cell is None:
        return ""
    matrix = catalogue.result.score_matrix
    row, column = cell
    before, after = int(matrix.row_object_ids[row]), int(matrix.column_object_ids[column])
    sigma, s_bar = float(matrix.sigma[row, column]), float(matrix.s_bar[row, column])
    verdict = pair_words(catalogue, row, column).capitalize() + "."
    tiles = "".join(
        f'<figure role="button" tabindex="0" {sends("select", object_id)} title="Show this object">'
        f"{picture(catalogue.thumbnail_url(object_id, session), wording.object_name(object_id))}"
        f"<figcaption>{word}: #{object_id}</figcaption></figure>"
        for session, (word, object_id) in enumerate((("Before", before), ("After", after)))
    )
    return (
        f'<div class="oa-pair" data-pair="{before}-{after}">{section("This pair")}'
        f'<div class="oa-tiles">{tiles}</div>'
        f"<p>{escape(verdict)}</p>"
        f"<p>{wording.percent(sigma)} of the patches of #{before} match on #{after} "
        f"({wording.percent(float(matrix.sigma_backward[row, column]))} the other way), "
        f"quality {s_bar:.2f}, {int(matrix.match_count[row, column])} matches.</p></div>"
    )
