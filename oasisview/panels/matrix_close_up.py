"""A readable part of the score matrix, cell by cell, with pictures of the objects, for mouse and keyboard."""

from __future__ import annotations

from collections.abc import Callable

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import share_colour
from oasisview.matrix_window import SPANS, MatrixWindow, shown_part
from oasisview.panels.markup import picture, section, sends
from oasisview.shell import escape
from pipeline.result import MatchCase, ScoreMatrix

# A case is told without colour: sure, seen in part, alike but another. No match carries no sign.
CASE_SIGNS = {MatchCase.CONFIDENT: "\u2713", MatchCase.PARTIAL: "\u25d0", MatchCase.LOOKALIKE: "\u2248"}
_AROUND = {"rivals": "rivals", "place": "neighbours"}
_AROUND_TIPS = {
    "rivals": "The selected object or cell with all that compete for the same counterparts",
    "place": "A piece of the picture above; click in it, or use the arrows, to see another one",
}
_STEPS = {"\u25c0": (0, -1), "\u25b2": (-1, 0), "\u25bc": (1, 0), "\u25b6": (0, 1)}
_STEP_WORDS = {"\u25c0": "left", "\u25b2": "up", "\u25bc": "down", "\u25b6": "right"}


def close_up_html(
    catalogue: Catalogue,
    kind: str,
    window: MatrixWindow,
    selected: int | None,
    cell: tuple[int, int] | None,
    describe: Callable[[int, int], str],
) -> str:
    """The part as a table of pictures and values; ``describe`` says what a cell (row, column) means."""
    matrix = catalogue.result.score_matrix
    rows, columns = shown_part(matrix, window, selected, cell)
    tools = _tools(window)
    if len(rows) == 0:
        return tools + '<div class="oa-note">Select an object to see its part of the matrix close up.</div>'
    small = window.span > SPANS[0]
    head = "".join(
        _object(catalogue, matrix, 1, column, selected, small=small) for column in columns.tolist()
    )
    first = (int(rows[0]), int(columns[0]))
    entry = cell if cell is not None and cell[0] in rows and cell[1] in columns else first
    body = []
    for row in rows.tolist():
        cells = "".join(
            _cell(
                catalogue, kind, (row, column), describe(row, column),
                picked=cell == (row, column), reachable=entry == (row, column), small=small,
            )
            for column in columns.tolist()
        )  # fmt: skip
        body.append(f"<tr>{_object(catalogue, matrix, 0, row, selected, small=small)}{cells}</tr>")
    signs = " \u00b7 ".join(f"{sign} {_short(case)}" for case, sign in CASE_SIGNS.items())
    return (
        tools
        + '<div class="oa-cell-words" aria-live="polite">Point at a cell, or reach it by Tab and the arrow '
        "keys: what it says stands here. A click shows the pair.</div>"
        f'<table class="oa-heat oa-close-up{" oa-small" if small else ""}" data-grid>'
        f"<tr><td></td>{head}</tr>{''.join(body)}</table>"
        f'<div class="oa-note">{signs} \u00b7 framed: chosen partners</div>'
    )


def _short(case: MatchCase) -> str:
    return wording.CASE_WORDS[case].partition(": ")[2]


def _tools(window: MatrixWindow) -> str:
    around = "".join(
        f'<button aria-pressed="{str(window.around == name).lower()}" {sends("matrix_around", name)} '
        f'title="{escape(_AROUND_TIPS[name])}">{word}</button>'
        for name, word in _AROUND.items()
    )
    steps = "".join(
        f"<button {sends('matrix_move', list(by))} "
        f'title="Move {_STEP_WORDS[sign]}" aria-label="Move {_STEP_WORDS[sign]}">{sign}</button>'
        for sign, by in _STEPS.items()
    )
    less, more = SPANS[0], SPANS[-1]
    zoom = (
        f'<button {sends("matrix_span", more)} title="More objects, smaller" '
        f'aria-label="More objects, smaller" {"disabled" if window.span == more else ""}>\u2212</button>'
        f'<button {sends("matrix_span", less)} title="Fewer objects, larger" '
        f'aria-label="Fewer objects, larger" {"disabled" if window.span == less else ""}>+</button>'
    )
    return (
        section("Close up", "rows before, columns after")
        + '<div class="oa-matrix-tools">'
        + f'<span class="oa-segments" role="group" aria-label="Which part">{around}</span>'
        + f'<span class="oa-segments">{steps}</span><span class="oa-segments">{zoom}</span></div>'
    )


def _cell(
    catalogue: Catalogue,
    kind: str,
    at: tuple[int, int],
    described: str,
    *,
    picked: bool,
    reachable: bool,
    small: bool,
) -> str:
    matrix = catalogue.result.score_matrix
    row, column = at
    before, after = int(matrix.row_object_ids[row]), int(matrix.column_object_ids[column])
    sigma, s_bar = float(matrix.sigma[at]), float(matrix.s_bar[at])
    value = sigma if kind == "sigma" else s_bar
    words = (
        f"#{before} before, #{after} after: {described}; "
        f"{wording.percent(sigma)} of the patches match, quality {s_bar:.2f}"
    )
    ground, ink = share_colour(value)
    chosen = " oa-chosen" if before == after else ""
    case = wording.pair_case(sigma, s_bar, catalogue.limits) if matrix.match_count[at] else MatchCase.NONE
    sign = CASE_SIGNS.get(case, "")
    text = sign if small else f"{value:.2f}<i>{sign}</i>"
    return (
        f'<td><button class="oa-cell{chosen}" aria-pressed="{str(picked).lower()}" '
        f'tabindex="{0 if reachable else -1}" title="{escape(words)}" aria-label="{escape(words)}" '
        f'data-words="{escape(words)}" style="background:{ground};color:{ink}" '
        f"{sends('matrix_cell', {'row': row, 'column': column})}>{text}</button></td>"
    )


def _object(
    catalogue: Catalogue, matrix: ScoreMatrix, session: int, index: int, selected: int | None, *, small: bool
) -> str:
    ids = (matrix.row_object_ids, matrix.column_object_ids)[session]
    object_id, when, scope = int(ids[index]), ("before", "after")[session], ("row", "col")[session]
    own = ' class="oa-own-number"' if object_id == selected else ""
    tip = f"Select object #{object_id} ({when})"
    thumb = picture(catalogue.thumbnail_url(object_id, session), wording.object_name(object_id))
    number = "" if small else f"<span>{object_id}</span>"
    return (
        f'<th scope="{scope}"{own}><button class="oa-bare" title="{tip}" aria-label="{tip}" '
        f"{sends('select', object_id)}>{thumb}{number}</button></th>"
    )
