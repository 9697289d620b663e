"""Equations 1 to 4 against a pair of two-dimensional feature maps worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.correspondence.matching import best_of_both, match, nearby
from pipeline.perception.protocols import PatchWarp

# p0 = e_x, p1 = e_y, p2 in between; q2 equals p2.
F0 = np.array([[1, 0], [0, 1], [0.6, 0.8]], np.float32)
F1 = np.array([[1, 0], [0.8, 0.6], [0.6, 0.8]], np.float32)


def test_eq1_correlation_is_the_inner_product_of_every_pair_of_patches() -> None:
    expected = [[1.0, 0.8, 0.6], [0.0, 0.6, 0.8], [0.6, 0.96, 1.0]]

    assert match(F0, F1).correlation == pytest.approx(np.array(expected), abs=1e-6)


def test_eq2_best_matches_run_over_rows_forwards_and_over_columns_backwards() -> None:
    matches = match(F0, F1)

    assert matches.forward.tolist() == [0, 2, 2]
    assert matches.backward.tolist() == [0, 2, 2]
    # Transposed features exchange the two directions.
    swapped = match(F1, F0)
    assert (swapped.forward.tolist(), swapped.backward.tolist()) == ([0, 2, 2], [0, 2, 2])


def test_eq2_directions_differ_where_the_best_match_is_not_mutual() -> None:
    matches = match(F0, F1[:2])

    assert matches.forward.tolist() == [0, 1, 1]
    assert matches.backward.tolist() == [0, 2]


def test_eq3_confidence_is_the_correlation_of_the_match() -> None:
    matches = match(F0, F1)

    assert matches.forward_score == pytest.approx([1.0, 0.8, 1.0], abs=1e-6)
    assert matches.backward_score == pytest.approx([1.0, 0.96, 1.0], abs=1e-6)


def test_eq4_correspondences_are_a_union_in_which_a_mutual_pair_counts_once() -> None:
    p, q, score = match(F0, F1).correspondences()

    # Forward (0,0) (1,2) (2,2); backward (0,0) (2,1) (2,2): four elements, not six.
    assert sorted(zip(p.tolist(), q.tolist(), strict=True)) == [(0, 0), (1, 2), (2, 1), (2, 2)]
    by_pair = dict(zip(zip(p.tolist(), q.tolist(), strict=True), score.tolist(), strict=True))
    assert by_pair[2, 1] == pytest.approx(0.96)
    assert by_pair[1, 2] == pytest.approx(0.8)


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 1000))
def test_eq4_union_equals_the_set_of_both_directions(count0: int, count1: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    f0, f1 = (rng.normal(size=(count, 4)).astype(np.float32) for count in (count0, count1))
    matches = match(f0, f1)
    p, q, score = matches.correspondences()

    pairs = list(zip(p.tolist(), q.tolist(), strict=True))
    assert len(pairs) == len(set(pairs))
    correlation = f0 @ f1.T
    expected = {(i, int(row.argmax())) for i, row in enumerate(correlation)}
    expected |= {(int(column.argmax()), j) for j, column in enumerate(correlation.T)}
    assert set(pairs) == expected
    assert score == pytest.approx(correlation[p, q], abs=1e-5)


def test_links_keep_both_directions_and_both_grids() -> None:
    links = match(F0, F1[:2]).links((1, 3), (2, 1))

    assert (links.previous_shape, links.current_shape) == ((1, 3), (2, 1))
    assert links.forward.tolist() == [0, 1, 1]
    assert links.backward.tolist() == [0, 2]
    assert links.backward_score[1] == pytest.approx(0.96, abs=1e-3)


def _warp(positions: list[list[tuple[float, float]]], visible: list[list[bool]]) -> PatchWarp:
    return PatchWarp(np.array(positions, np.float32), np.array(visible))


def test_best_nearby_looks_only_around_the_expected_place() -> None:
    # One row of five patches in the other image; the look-alike stands at its far end.
    correlation = np.array([[0.2, 0.5, 0.3, 0.1, 0.99]], np.float32)
    warp = _warp([[(1.2, 0.0)]], [[True]])

    assert nearby(warp, (1, 5), 0).best(correlation)[0, 0] == pytest.approx(0.5)
    assert nearby(warp, (1, 5), 1).best(correlation)[0, 0] == pytest.approx(0.5)
    assert nearby(warp, (1, 5), 3).best(correlation)[0, 0] == pytest.approx(0.99)


def test_best_nearby_stays_inside_the_other_image_and_in_two_dimensions() -> None:
    # A 2x3 grid, numbered row by row; the expected place is its lower right corner.
    correlation = np.array([[0.9, 0.1, 0.2, 0.8, 0.3, 0.4]], np.float32)
    warp = _warp([[(2.0, 1.0)]], [[True]])

    assert nearby(warp, (2, 3), 1).best(correlation)[0, 0] == pytest.approx(0.4)
    assert nearby(warp, (2, 3), 2).best(correlation)[0, 0] == pytest.approx(0.9)


def test_best_nearby_knows_nothing_of_places_that_are_not_visible() -> None:
    correlation = np.ones((2, 2), np.float32)
    warp = _warp([[(0.0, 0.0), (np.nan, np.nan)]], [[True, False]])

    best = nearby(warp, (1, 2), 4).best(correlation)

    assert best[0, 0] == 1
    assert np.isnan(best[0, 1])
    hidden = _warp([[(0.0, 0.0), (0.0, 0.0)]], [[False, False]])
    assert np.isnan(nearby(hidden, (1, 2), 4).best(correlation)).all()


@given(st.integers(0, 1000), st.integers(0, 2))
def test_best_of_both_is_the_best_of_the_whole_correlation_both_ways(seed: int, radius: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = ((3, 5), (4, 3))
    features0, features1 = (
        rng.normal(size=(rows * columns, 4)).astype(np.float32) for rows, columns in shapes
    )
    windows = [
        nearby(
            PatchWarp(rng.uniform(-1, 5, (*own, 2)).astype(np.float32), rng.random(own) < 0.5), other, radius
        )
        for own, other in (shapes, shapes[::-1])
    ]

    best = best_of_both(features0, features1, windows[0], windows[1])

    correlation = match(features0, features1).correlation
    for found, expected in zip(
        best, (windows[0].best(correlation), windows[1].best(correlation.T)), strict=True
    ):
        assert found == pytest.approx(expected, abs=1e-5, nan_ok=True)
