from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview.matrix_window import SPANS, MatrixWindow, display_order, shown_part
from pipeline.result import ScoreMatrix


def matrix(row_ids: list[int], column_ids: list[int], seed: int = 0) -> ScoreMatrix:
    sigma = np.random.default_rng(seed).random((len(row_ids), len(column_ids))).astype(np.float32)
    rows, columns = np.array(row_ids, np.int32), np.array(column_ids, np.int32)
    return ScoreMatrix(sigma, sigma, sigma, (9 * sigma).astype(np.int32), rows, columns, 0.3, 0.85)


BIG = matrix(list(range(1, 171)), [*range(60, 171), *range(200, 260)])


def test_partners_stand_on_the_diagonal_and_everything_once() -> None:
    rows, columns = display_order(BIG)

    assert sorted(rows) == list(range(170)) and sorted(columns) == list(range(171))
    assert (BIG.row_object_ids[rows[:111]] == BIG.column_object_ids[columns[:111]]).all()


def test_merged_and_dropped_objects_do_not_upset_the_order() -> None:
    corrected = matrix([1, 2, 2, 0, 0, 3], [2, 0, 3, 3])
    rows, columns = display_order(corrected)

    assert sorted(rows) == list(range(6)) and sorted(columns) == list(range(4))
    assert corrected.row_object_ids[rows[:2]].tolist() == [2, 3]
    assert corrected.column_object_ids[columns[:2]].tolist() == [2, 3]


@pytest.mark.parametrize("span", SPANS)
@pytest.mark.parametrize(("selected", "cell"), [(70, None), (3, None), (230, None), (None, (5, 100))])
def test_rivals_hold_what_they_start_from(span: int, selected: int | None, cell) -> None:
    rows, columns = shown_part(BIG, MatrixWindow(span=span), selected, cell)

    assert len(rows) == len(columns) == span
    if cell is not None:
        assert cell[0] in rows and cell[1] in columns
        best = BIG.sigma[cell[0]].argmax()
        assert best in columns
    else:
        assert selected in [*BIG.row_object_ids[rows], *BIG.column_object_ids[columns]]


def test_nothing_to_start_from_shows_nothing() -> None:
    assert [len(part) for part in shown_part(BIG, MatrixWindow(), None, None)] == [0, 0]


@given(
    steps=st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9), st.sampled_from(SPANS)), max_size=8),
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
)
def test_a_piece_never_leaves_the_matrix(steps: list, shape: tuple[int, int]) -> None:
    small = matrix(list(range(1, shape[0] + 1)), list(range(1, shape[1] + 1)))
    window = MatrixWindow().centred(0, 0, shape)
    for rows, columns, span in steps:
        window = window.moved(rows, columns, shape).zoomed(span, shape)
        part = shown_part(small, window, None, None)
        assert [len(indices) for indices in part] == [min(window.span, count) for count in shape]


def test_a_piece_is_what_the_picture_shows_there() -> None:
    window = MatrixWindow().centred(100, 50, BIG.sigma.shape)
    order = display_order(BIG)

    rows, columns = shown_part(BIG, window, None, None)

    assert rows.tolist() == order[0][97:104].tolist()
    assert columns.tolist() == order[1][47:54].tolist()
