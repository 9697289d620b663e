"""The four cases and equation 7."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.association.assignment import associate
from pipeline.association.cases import match_case
from pipeline.result import MatchCase


@pytest.mark.parametrize(
    ("sigma", "s_bar", "case"),
    [
        (0.6, 0.95, MatchCase.CONFIDENT),
        (0.1, 0.95, MatchCase.PARTIAL),
        (0.6, 0.50, MatchCase.LOOKALIKE),
        (0.1, 0.50, MatchCase.NONE),
        (0.3, 0.85, MatchCase.CONFIDENT),  # the gates themselves pass
        (0.2999, 0.85, MatchCase.PARTIAL),
        (0.3, 0.8499, MatchCase.LOOKALIKE),
    ],
)
def test_four_cases(sigma: float, s_bar: float, case: MatchCase) -> None:
    assert match_case(sigma, s_bar, 0.3, 0.85) is case


def test_eq7_assignment_maximises_the_sum_of_proportions_one_to_one() -> None:
    # Greedy would take 0.9 and be left with 0.1; the best sum is 0.8 + 0.7.
    sigma = np.array([[0.9, 0.8], [0.7, 0.1]])

    assert associate(sigma, np.ones((2, 2)), 0.05, 0.5) == [(0, 1), (1, 0)]


def test_eq7_keeps_only_pairs_that_pass_both_gates() -> None:
    sigma = np.diag([0.9, 0.2, 0.9])
    s_bar = np.diag([0.9, 0.9, 0.4])

    assert associate(sigma, s_bar, 0.3, 0.85) == [(0, 0)]


def test_eq7_gates_include_their_threshold() -> None:
    assert associate(np.array([[0.3]]), np.array([[0.85]]), 0.3, 0.85) == [(0, 0)]


def test_eq7_rows_without_any_match_stay_unassigned_even_with_open_gates() -> None:
    sigma = np.array([[0.0, 0.0], [0.0, 0.6]])

    assert associate(sigma, np.ones((2, 2)), 0.0, 0.0) == [(1, 1)]
    assert associate(np.zeros((3, 2)), np.zeros((3, 2)), 0.0, 0.0) == []


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (0, 0)])
def test_eq7_without_objects_there_are_no_pairs(shape: tuple[int, int]) -> None:
    assert associate(np.zeros(shape), np.zeros(shape), 0.3, 0.85) == []


@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 10_000))
def test_eq7_total_is_the_best_of_all_one_to_one_choices(n: int, m: int, seed: int) -> None:
    sigma = np.random.default_rng(seed).uniform(0.01, 1, (n, m))
    pairs = associate(sigma, np.ones((n, m)), 0.0, 0.0)

    tall = sigma if n >= m else sigma.T
    best = max(
        sum(tall[row, column] for column, row in enumerate(rows))
        for rows in permutations(range(tall.shape[0]), tall.shape[1])
    )
    assert sum(sigma[pair] for pair in pairs) == pytest.approx(best)
    assert len({row for row, _ in pairs}) == len({column for _, column in pairs}) == min(n, m)
