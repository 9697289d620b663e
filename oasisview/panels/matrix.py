"""The whole score matrix: objects of the earlier visit against objects of the later one."""

from __future__ import annotations

import numpy as np

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import CIVIDIS, gradient_css
from oasisview.panels.markup import empty, picture, section, sends
from oasisview.shell import escape
from pipeline.result import MatchCase

KINDS = {"sigma": "matching patches \u03c3", "s_bar": "match quality s\u0304"}


def cell_at(shape: tuple[int, int], u: float, v: float) -> tuple[int, int] | None:
    """Row and column under a place (u, v) in [0, 1] of the picture; None for an empty matrix."""
    rows, columns = shape
    if rows == 0 or columns == 0:
        return None
    return min(int(v * rows), rows - 1), min(int(u * columns), columns - 1)


def pair_case(sigma: float, s_bar: float, limits: wording.Limits) -> MatchCase:
    """Which of the four cases a pair of objects is (paper, Sec. III-C.2)."""
    if s_bar >= limits.tau_s:
        return MatchCase.CONFIDENT if sigma >= limits.tau_sigma else MatchCase.PARTIAL
    return MatchCase.LOOKALIKE if sigma >= limits.tau_sigma else MatchCase.NONE


def matrix_html(catalogue: Catalogue, kind: str, selected: int | None, cell: tuple[int, int] | None) -> str:
    """The panel; a click in the picture arrives as the pixel event ``matrix``."""
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
    return (
        '<div class="oa oa-matrix">'
        f'<div class="oa-segments" role="group" aria-label="What is shown">{switch}</div>'
        f'<div class="oa-note">Rows: {rows} objects before. Columns: {columns} objects after. '
        "Framed: chosen partners. Click a cell to see the pair.</div>"
        f'<div class="oa-grid" style="aspect-ratio:{columns}/{rows}" '
        'data-pixel="matrix" data-session="0" data-keyframe="0">'
        f'<img src="{url}" alt="score matrix: {KINDS[kind]}" draggable="false">'
        f"{_marks(catalogue, selected, cell)}</div>"
        f'<div class="oa-colours"><span>0</span><i style="background:{gradient_css(CIVIDIS)}"></i>'
        "<span>1</span></div>"
        f"{_pair(catalogue, cell)}</div>"
    )


def _marks(catalogue: Catalogue, selected: int | None, cell: tuple[int, int] | None) -> str:
    matrix = catalogue.result.score_matrix
    rows, columns = matrix.sigma.shape
    marks = []
    chosen = np.argwhere(matrix.row_object_ids[:, None] == matrix.column_object_ids[None, :])
    for row, column in chosen:
        marks.append(f'<rect class="oa-partner" x="{column}" y="{row}" width="1" height="1"/>')
    if selected is not None:
        for row in np.flatnonzero(matrix.row_object_ids == selected):
            marks.append(f'<rect class="oa-own" x="0" y="{row}" width="{columns}" height="1"/>')
        for column in np.flatnonzero(matrix.column_object_ids == selected):
            marks.append(f'<rect class="oa-own" x="{column}" y="0" width="1" height="{rows}"/>')
    if cell is not None:
        marks.append(f'<rect class="oa-picked" x="{cell[1]}" y="{cell[0]}" width="1" height="1"/>')
    return f'<svg viewBox="0 0 {columns} {rows}" preserveAspectRatio="none">{"".join(marks)}</svg>'


def _pair(catalogue: Catalogue, cell: tuple[int, int] | None) -> str:
    if cell is None:
        return ""
    matrix = catalogue.result.score_matrix
    row, column = cell
    before, after = int(matrix.row_object_ids[row]), int(matrix.column_object_ids[column])
    sigma, s_bar = float(matrix.sigma[row, column]), float(matrix.s_bar[row, column])
    if before == after:
        verdict = "Chosen partners: one object, seen on both visits."
    elif matrix.match_count[row, column] == 0:
        verdict = "No patch of one finds its match on the other."
    else:
        verdict = wording.CASE_WORDS[pair_case(sigma, s_bar, catalogue.limits)].capitalize() + "."
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
