"""Stationarity, and what wanders between the libraries."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.baselines.persistence import Candidate, ObjectLibrary
from pipeline.settings import BaselineSettings

SETTINGS = BaselineSettings()
MIN_SIMILARITY = 0.9
EAST, NORTH = np.array([1.0, 0.0]), np.array([0.0, 1.0])
# Two objects, 10 m apart: the first looks east, the second north.
PLACES = np.array([[0.0, 0, 0], [0.0, 0, 0], [10.0, 0, 0]])
NOT_EXPECTED, BOTH_EXPECTED = np.zeros(3), np.array([1.0, 1.0, 1.0])


def library(embeddings: tuple[np.ndarray, np.ndarray] = (EAST, NORTH), current: int = 2) -> ObjectLibrary:
    vectors = np.stack([np.zeros(2), *embeddings])
    return ObjectLibrary(vectors, PLACES - 0.5, PLACES + 0.5, current, MIN_SIMILARITY, SETTINGS)


def at(x: float, embedding: np.ndarray) -> Candidate:
    return Candidate(embedding, np.array([x, 0.0, 0.0]))


def test_object_seen_in_its_place_grows_more_stationary() -> None:
    objects = library()
    before = objects.stationarity[1]
    for _ in range(3):
        objects.observe({1: at(0.2, EAST)}, NOT_EXPECTED)
    assert objects.identity.tolist() == [0, 1, 0]
    assert objects.partner.tolist() == [0, 1, 0]
    assert objects.stationarity[1] > before
    assert objects.was_observed.tolist() == [False, True, False]
    assert objects.similarity[1] == pytest.approx(1.0)


def test_object_never_expected_keeps_its_state() -> None:
    objects = library()
    before = objects.stationarity.copy()
    for share in (0.0, 0.19):
        objects.observe({}, np.full(3, share))
    assert objects.stationarity.tolist() == before.tolist()
    assert not objects.was_observed.any()
    assert not objects.is_missing.any()


def test_expected_but_not_seen_goes_missing_once_its_stationarity_is_too_low() -> None:
    objects = library()
    objects.observe({}, BOTH_EXPECTED)
    assert objects.stationarity[1] == pytest.approx(3 / 6)
    assert not objects.is_missing.any()
    objects.observe({}, BOTH_EXPECTED)
    assert objects.stationarity[1] == pytest.approx(3 / 7)
    assert objects.is_missing.tolist() == [False, True, True]


def test_many_sightings_outweigh_a_few_misses() -> None:
    objects = library()
    for _ in range(5):
        objects.observe({1: at(0.0, EAST)}, NOT_EXPECTED)
    for _ in range(3):
        objects.observe({}, BOTH_EXPECTED)
    assert objects.is_missing.tolist() == [False, False, True]


def test_missing_object_is_found_again_wherever_it_is() -> None:
    objects = library()
    for _ in range(2):
        objects.observe({}, BOTH_EXPECTED)
    objects.observe({2: at(55.0, NORTH)}, NOT_EXPECTED)
    assert objects.identity.tolist() == [0, 0, 2]
    assert objects.is_missing.tolist() == [False, True, False]


def test_object_seen_in_its_new_place_first_is_found_when_the_old_one_is_empty() -> None:
    objects = library()
    objects.observe({1: at(55.0, NORTH)}, NOT_EXPECTED)
    assert objects.identity.tolist() == [0, 0, 0]  # nothing is missing yet: it is new
    for _ in range(2):
        objects.observe({}, np.array([0.0, 0.0, 1.0]))
    assert objects.identity.tolist() == [0, 2, 0]


def test_look_alike_in_place_of_another_is_taken_for_it() -> None:
    # The weakness the paper reports: one embedding cannot tell a replaced car from the old one.
    objects = library()
    objects.observe({1: at(0.4, np.array([0.95, np.sqrt(1 - 0.95**2)]))}, NOT_EXPECTED)
    assert objects.identity[1] == 1


def test_unlike_object_in_the_same_place_is_not_taken_for_it() -> None:
    objects = library()
    for _ in range(2):
        objects.observe({1: at(0.0, NORTH)}, np.array([0.0, 1.0, 0.0]))
    assert objects.identity[1] == 0
    assert objects.is_missing.tolist() == [False, True, False]


def test_gate_keeps_an_object_that_stayed_from_being_found_elsewhere() -> None:
    objects = library()
    objects.observe({1: at(2.0, EAST)}, NOT_EXPECTED)
    assert objects.identity[1] == 0
    objects.observe({1: at(1.3, EAST)}, NOT_EXPECTED)  # half its size and 0.9 m around it
    assert objects.identity[1] == 1


def test_candidates_are_paired_one_to_one_by_cosine() -> None:
    near = np.array([0.96, np.sqrt(1 - 0.96**2)])
    objects = library()
    objects.observe({1: at(0.1, near), 2: at(-0.1, EAST)}, NOT_EXPECTED)
    assert objects.identity.tolist() == [0, 0, 1]


def test_partner_of_an_object_gone_missing_is_released() -> None:
    objects = library()
    objects.observe({1: at(0.0, EAST)}, NOT_EXPECTED)
    for _ in range(3):
        objects.observe({2: at(5.0, NORTH)}, np.array([0.0, 1.0, 0.0]))
    # Released, it is at once the most similar thing to what is missing: found again where it was.
    assert objects.identity[1] == 1
    assert not objects.is_missing[1]


def test_best_similarity_of_a_visit_without_objects_is_zero() -> None:
    empty = ObjectLibrary(np.zeros((1, 2)), np.zeros((1, 3)), np.zeros((1, 3)), 1, MIN_SIMILARITY, SETTINGS)
    empty.observe({1: at(0.0, EAST)}, np.zeros(1))
    assert empty.best_similarity().tolist() == [0.0, 0.0]
    assert empty.identity.tolist() == [0, 0]
