"""Finding an object again elsewhere, by the tokens of its views."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.association.reassociation import FoundAgain, find_again
from pipeline.association.tokens import VIEWS_PER_OBJECT, ObjectTokens
from pipeline.perception.protocols import SimilarityScale
from pipeline.settings import AssociationSettings

GATES = AssociationSettings(tau_sigma=0.3, tau_s=0.85)


class PlainFeatures:
    """Features that are compared as they are."""

    name, weights_hash = "plain", None
    similarity = SimilarityScale(0.9, 0.02)

    def comparable(self, previous, current, light):
        return previous.astype(np.float32), current.astype(np.float32)


class Tokens:
    def __init__(self, of: dict[int, list[list[float]]]) -> None:
        self._of = of

    def of(self, instance: int) -> np.ndarray:
        return np.array(self._of[instance], np.float32).reshape(-1, 3)


RED, GREEN, BLUE = [1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]


def find(left, taken, tokens0, tokens1, sizes0=None, sizes1=None) -> list[FoundAgain]:
    sizes = (
        np.ones((len(left), 2)) if sizes0 is None else np.array(sizes0, float),
        np.ones((len(taken), 2)) if sizes1 is None else np.array(sizes1, float),
    )
    return find_again(left, taken, Tokens(tokens0), Tokens(tokens1), sizes, PlainFeatures(), None, GATES, 2.0)


def test_object_is_found_again_by_its_own_patches() -> None:
    found = find([3, 7], [2, 5], {3: [RED, RED], 7: [GREEN]}, {2: [GREEN], 5: [RED]})

    assert [(f.previous, f.current) for f in found] == [(3, 5), (7, 2)]
    assert found[0].s_bar == pytest.approx(1.0)


def test_nothing_is_found_where_nothing_looks_alike() -> None:
    assert find([1], [1], {1: [RED]}, {1: [BLUE]}) == []


@pytest.mark.parametrize(("height", "is_found"), [(1.9, True), (2.1, False)])
def test_object_of_another_size_is_not_the_same(height: float, is_found: bool) -> None:
    found = find([1], [1], {1: [RED]}, {1: [RED]}, [[1, 1]], [[1, height]])

    assert bool(found) is is_found


def test_one_previous_object_is_found_once_only() -> None:
    found = find([1], [1, 2], {1: [RED, RED]}, {1: [RED], 2: [RED]})

    assert len(found) == 1


@pytest.mark.parametrize(("left", "taken"), [([], [1]), ([1], []), ([], [])])
def test_nobody_left_or_nothing_taken_finds_nothing(left: list[int], taken: list[int]) -> None:
    assert find(left, taken, {1: [RED]}, {1: [RED]}) == []


def test_objects_without_any_token_are_left_alone() -> None:
    assert find([1, 2], [1], {1: [], 2: [RED]}, {1: [RED]}) == [FoundAgain(2, 1, 1.0, 1.0)]
    assert find([1], [1], {1: []}, {1: [RED]}) == []


def test_tokens_come_from_the_best_views_and_are_never_averaged() -> None:
    # Six keyframes of 2 patches; the object fills the left one and has most pixels in the later keyframes.
    pixels = np.array([[0, n] for n in (0, 1, 2, 3, 4, 5)])
    masks = np.zeros((4, 8), np.int32)
    masks[:, :4] = 1
    features = [np.full((1, 2, 3), k, np.float16) for k in range(6)]

    tokens = ObjectTokens(pixels, lambda k: features[k], lambda k: masks).of(1)

    assert tokens[:, 0].tolist() == [5, 4, 3, 2]
    assert len(tokens) == VIEWS_PER_OBJECT


def test_object_that_no_keyframe_sees_has_no_tokens() -> None:
    tokens = ObjectTokens(np.zeros((3, 2), int), lambda k: None, lambda k: None).of(1)

    assert len(tokens) == 0
