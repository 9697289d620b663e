"""Which object that left is which that took a place: prefilter, score, one-to-one choice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.association import moves as module
from pipeline.association.cloud_agreement import ObjectCloud, ObjectRegistration
from pipeline.association.keypoint_registration import KeypointRegistration
from pipeline.association.moves import (
    FEATURES,
    Candidate,
    ScoredMove,
    choose_moves,
    moves_table,
    score_moves,
    size_m,
)
from pipeline.settings import MoveSettings

UP = np.array([0.0, 0.0, 1.0])
SPACING_M = 0.03
SETTINGS = MoveSettings()
AROUND = np.array([[3, 0, 2], [-3, 0, 2], [0, 3, 2], [0, -3, 2]], float)
RED, BLUE, GREY = np.log([180.0, 60, 60]), np.log([60.0, 60, 180]), np.log([110.0, 110, 110])


def cloud(colour: np.ndarray, size: tuple = (0.4, 0.3, 0.5), at: tuple = (0, 0, 0), print_seed: int = 0):
    """The four sides of a box of one colour with a print of brightness on it, its corner at ``at``."""
    rng = np.random.default_rng(print_seed)
    points, normals = [], []
    for axis, other in ((0, 1), (1, 0)):
        a, z = np.meshgrid(np.arange(0, size[other], SPACING_M), np.arange(0, size[2], SPACING_M))
        for side in (0, 1):
            face = np.zeros((a.size, 3))
            face[:, other], face[:, 2], face[:, axis] = a.ravel(), z.ravel(), side * size[axis]
            points.append(face)
            normals.append(np.tile((2 * side - 1) * np.eye(3)[axis], (a.size, 1)))
    placed = np.concatenate(points)
    cells = np.floor(placed / 0.1).astype(int) + 1
    brightness = rng.choice([-0.25, 0.25], size=(12, 12, 12))[cells[:, 0], cells[:, 1], cells[:, 2]]
    return ObjectCloud(placed + at, np.concatenate(normals), colour + brightness[:, None], AROUND + at)


def candidate(instance: int, of: ObjectCloud, seen_through: float = 0.9, voxels: int = 400) -> Candidate:
    return Candidate(instance, of, np.zeros((0, 3)), seen_through, voxels)


def pairs(scored: list[ScoredMove]) -> set[tuple[int, int]]:
    return {(move.previous, move.current) for move in scored}


def test_objects_of_one_print_are_laid_over_each_other_by_it_whatever_their_colours() -> None:
    T = np.eye(4)
    T[:3, 3] = [2.0, 1.0, 0.0]
    left = candidate(1, cloud(RED))
    taken = [candidate(1, cloud(BLUE, at=(2, 1, 0))), candidate(2, cloud(BLUE, at=(4, 1, 0)))]
    agreed = KeypointRegistration(T, 2.2, 6.0)

    (move,) = score_moves([left], taken, UP, SPACING_M, {(1, 1): agreed}, SETTINGS)

    assert (move.previous, move.current) == (1, 1)
    assert move.registration.T_world_motion.tolist() == T.tolist()
    assert move.features[FEATURES.index("print")] == pytest.approx(np.log(7))
    chance = {(1, 1): replace(agreed, support=1.0)}
    assert not score_moves([left], taken, UP, SPACING_M, chance, SETTINGS)


def test_a_print_that_both_should_show_and_do_not_counts_against_a_move() -> None:
    there = cloud(RED, at=(2, 1, 0))
    left = replace(candidate(1, cloud(RED)), print_places=cloud(RED).points_world[::40])
    taken = replace(candidate(1, there), print_places=there.points_world[::40])
    plain = replace(taken, print_places=np.zeros((0, 3)))

    expected, unexpected = (
        score_moves([left], [other], UP, SPACING_M, {}, SETTINGS)[0] for other in (taken, plain)
    )

    assert expected.features[FEATURES.index("print_expected")] > np.log(len(taken.print_places) / 2)
    assert unexpected.features[FEATURES.index("print_expected")] == 0
    assert expected.log_odds < unexpected.log_odds


def test_objects_of_other_colours_or_sizes_are_not_laid_over_each_other() -> None:
    red = cloud(RED)
    left = [candidate(1, red), candidate(2, cloud(BLUE)), candidate(3, cloud(RED, size=(0.1, 0.08, 0.5)))]
    taken = [candidate(1, cloud(RED, at=(2, 0, 0))), candidate(4, cloud(RED, size=(0.4, 0.3, 0.12)))]

    scored = score_moves(left, taken, UP, SPACING_M, {}, SETTINGS)

    # Blue is not red; what is 4 times as small in one direction is another thing.
    assert pairs(scored) == {(1, 1)}


def test_brightness_alone_does_not_rule_a_pair_out() -> None:
    darker = cloud(RED - 0.5, at=(2, 0, 0))

    assert pairs(score_moves([candidate(1, cloud(RED))], [candidate(1, darker)], UP, SPACING_M, {}, SETTINGS))


def test_nobody_left_or_nothing_taken_scores_nothing() -> None:
    one = [candidate(1, cloud(RED))]

    assert score_moves([], one, UP, SPACING_M, {}, SETTINGS) == []
    assert score_moves(one, [], UP, SPACING_M, {}, SETTINGS) == []


def test_log_odds_are_the_weighted_features_and_the_table_keeps_both() -> None:
    left = [candidate(1, cloud(RED)), candidate(2, cloud(RED, print_seed=5))]
    scored = score_moves(left, [candidate(1, cloud(RED, at=(2, 1, 0)))], UP, SPACING_M, {}, SETTINGS)
    table = moves_table(scored, np.array([0, 11, 12]), np.array([0, 31]))

    assert table.dtype.names == ("previous_object_id", "current_object_id", *FEATURES, "log_odds")
    assert table["previous_object_id"].tolist() == [10 + move.previous for move in scored]
    assert table["current_object_id"].tolist() == [31, 31]
    weights = [getattr(SETTINGS, f"{name}_weight") for name in FEATURES]
    again = SETTINGS.bias + sum(w * table[name] for w, name in zip(weights, FEATURES, strict=True))
    assert again == pytest.approx(table["log_odds"], abs=1e-4)
    assert table["log_odds"] == pytest.approx([move.log_odds for move in scored], abs=1e-5)
    assert len(moves_table([], np.zeros(1, int), np.zeros(1, int))) == 0


def test_what_moved_scores_above_a_look_alike_and_seeing_both_places_empty_speaks_for_it() -> None:
    taken = [candidate(1, cloud(RED, at=(2, 1, 0)))]
    left = [candidate(1, cloud(RED)), candidate(2, cloud(RED, print_seed=5))]

    same, other = score_moves(left, taken, UP, SPACING_M, {}, SETTINGS)
    taken_over = [candidate(1, cloud(RED), seen_through=0.0), left[1]]
    kept = score_moves(taken_over, taken, UP, SPACING_M, {}, SETTINGS)[0]

    assert (same.previous, other.previous) == (1, 2)
    assert same.log_odds > other.log_odds
    assert same.log_odds - kept.log_odds == pytest.approx(0.9 * SETTINGS.vacated_weight)
    shift = same.registration.T_world_motion @ [0.2, 0.15, 0.25, 1] - [0.2, 0.15, 0.25, 1]
    assert shift[:3] == pytest.approx([2, 1, 0], abs=SPACING_M)


@pytest.fixture
def laid_over(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Counts registrations, and saves their time."""
    calls: list[int] = []

    def instead(previous: ObjectCloud, *_: object) -> ObjectRegistration:
        calls.append(len(previous))
        return ObjectRegistration(np.eye(4), 0.9, 0.9, 0.9, 0.5, 0.1, 0.1, 0.9, 0.2, 0.0)

    monkeypatch.setattr(module, "register_objects", instead)
    return calls


def test_each_object_is_laid_over_its_likest_partners_only(laid_over: list[int]) -> None:
    rng = np.random.default_rng(0)
    left = [candidate(i, cloud(GREY + rng.normal(0, 0.01, 3))) for i in range(1, 9)]
    taken = [candidate(i, cloud(GREY + rng.normal(0, 0.01, 3))) for i in range(1, 9)]

    scored = score_moves(left, taken, UP, SPACING_M, {}, replace(SETTINGS, partners_per_object=1))

    assert 8 <= len(laid_over) < 40
    # Nobody goes without: every object is laid over its likest partner at least.
    assert {move.previous for move in scored} == {move.current for move in scored} == set(range(1, 9))


def test_no_more_registrations_than_allowed_and_the_likest_first(laid_over: list[int]) -> None:
    left = [candidate(1, cloud(RED))]
    taken = [candidate(i, cloud(RED + 0.02 * i * np.array([1, 0, 0]))) for i in range(5)]

    scored = score_moves(left, taken, UP, SPACING_M, {}, replace(SETTINGS, max_registrations=2))

    assert [move.current for move in scored] == [0, 1]
    assert len(laid_over) == 2


def scored_move(previous: int, current: int, log_odds: float) -> ScoredMove:
    registration = ObjectRegistration(np.eye(4), 1, 1, 1, 0, 0, 0, 0, 0, 0)
    return ScoredMove(previous, current, registration, np.zeros(len(FEATURES)), log_odds)


def choose(*moves: tuple[int, int, float], is_possible=lambda move: True) -> set[tuple[int, int]]:
    return pairs(choose_moves([scored_move(*move) for move in moves], is_possible, SETTINGS))


def test_moves_are_one_to_one_and_of_the_greatest_total() -> None:
    # Greedy would take (1, 1) and be left with (2, 2).
    assert choose((1, 1, 3.0), (1, 2, 2.8), (2, 1, 2.9), (2, 2, 0.4)) == {(1, 2), (2, 1)}


def test_twins_are_both_found_and_neither_twice() -> None:
    chosen = choose((1, 1, 2.0), (1, 2, 2.0), (2, 1, 2.0), (2, 2, 2.0))

    assert {previous for previous, _ in chosen} == {current for _, current in chosen} == {1, 2}


def test_a_move_needs_its_least_log_odds_and_to_be_possible() -> None:
    least = SETTINGS.min_log_odds

    assert choose((1, 1, least)) == set()
    assert choose((1, 1, least + 0.01)) == {(1, 1)}
    assert choose((1, 1, 5.0), (1, 2, 1.0), is_possible=lambda move: move.current == 2) == {(1, 2)}
    assert choose() == set()


@given(
    st.dictionaries(
        st.tuples(st.integers(1, 6), st.integers(1, 6)), st.floats(-5, 5, allow_nan=False), max_size=20
    )
)
def test_chosen_moves_are_possible_one_to_one_and_cannot_be_added_to(odds: dict) -> None:
    chosen = choose(*((*pair, value) for pair, value in odds.items()))

    assert all(odds[pair] > SETTINGS.min_log_odds for pair in chosen)
    assert len({p for p, _ in chosen}) == len({c for _, c in chosen}) == len(chosen)
    for (p, c), value in odds.items():
        is_free = p not in {a for a, _ in chosen} and c not in {b for _, b in chosen}
        assert not (is_free and value > SETTINGS.min_log_odds)


@given(st.floats(-3.1, 3.1), st.tuples(*[st.floats(-5, 5)] * 3))
def test_size_is_that_of_the_object_wherever_it_stands_and_however_it_is_turned(
    yaw: float, shift: tuple
) -> None:
    points = cloud(RED).points_world
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])

    size = size_m(points, UP, 0.01)

    assert size_m(points @ turn.T + shift, UP, 0.01) == pytest.approx(size, abs=1e-6)
    assert size == pytest.approx([0.5, 0.5], abs=0.06)  # diagonal of the footprint, height
    assert size_m(points[:1], UP, 0.01).tolist() == [0.01, 0.01]
