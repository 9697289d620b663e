"""Masks of single keyframes become objects as ConceptGraphs joins them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_matrix

from pipeline.baselines.conceptgraphs import match_offline
from pipeline.baselines.confidence import margin_confidence
from pipeline.baselines.object_map import ObjectMap, largest_pieces
from pipeline.settings import BaselineSettings

SETTINGS = dataclasses.replace(BaselineSettings(), min_mask_voxels=2, min_detections=2)
EAST, NORTH = np.array([1.0, 0.0], np.float32), np.array([0.0, 1.0], np.float32)


def line(*voxels: int) -> np.ndarray:
    return np.array([voxels], np.int32)


class Surface:
    """A line of voxels, each the neighbour of the next."""

    def __init__(self, count: int) -> None:
        rows = np.arange(count - 1)
        links = csr_matrix((np.ones(count - 1), (rows, rows + 1)), shape=(count, count))
        self.neighbours = links + links.T


def test_masks_that_overlap_and_look_alike_join_and_mask_numbers_mean_nothing() -> None:
    objects = ObjectMap(10, SETTINGS)
    assert objects.add(line(7, 7, 7, 7), line(0, 1, 2, 3), {7: EAST}) == {7: 1}
    assert objects.add(line(3, 3, 3, 3), line(2, 3, 4, 5), {3: EAST}) == {3: 1}
    assert objects.add(line(7, 7), line(8, 9), {7: EAST}) == {7: 2}  # alike, but elsewhere
    assert objects.detections.tolist() == [0, 2, 1]
    assert objects.finish(Surface(10)).tolist() == [1, 1, 1, 1, 1, 1, 0, 0, 0, 0]  # one mask is too few


def test_sum_of_overlap_and_similarity_decides() -> None:
    # Cosine 0 counts 0.5: overlap has to bring the other 0.6.
    for shared, joins in ((3, True), (2, False)):
        objects = ObjectMap(20, SETTINGS)
        objects.add(line(1, 1, 1, 1, 1), line(0, 1, 2, 3, 4), {1: EAST})
        voxels = [*range(5 - shared, 5), *range(10, 10 + 5 - shared)]
        chosen = objects.add(line(1, 1, 1, 1, 1), line(*voxels), {1: NORTH})
        assert (chosen == {1: 1}) is joins, shared


def test_object_keeps_the_mean_of_its_embeddings() -> None:
    objects = ObjectMap(10, dataclasses.replace(SETTINGS, merge_similarity=0.9))
    objects.add(line(1, 1, 1, 1), line(0, 1, 2, 3), {1: EAST})
    objects.add(line(1, 1, 1, 1), line(0, 1, 2, 3), {1: NORTH})
    # Halfway between both: cosine 0.707 to either, so 0.854 without any overlap; 0.9 needs a little of it.
    assert objects.add(line(1, 1), line(8, 9), {1: EAST}) == {1: 2}
    # A quarter of this mask overlaps it: 0.25 + 0.854 for the old object.
    assert objects.add(line(1, 1, 1, 1), line(3, 4, 5, 6), {1: NORTH}) == {1: 1}


def test_masks_of_one_keyframe_do_not_join_each_other() -> None:
    objects = ObjectMap(10, SETTINGS)
    assert objects.add(line(1, 1, 2, 2), line(0, 1, 2, 3), {1: EAST, 2: EAST}) == {1: 1, 2: 2}


def test_small_masks_and_masks_without_embedding_are_skipped() -> None:
    objects = ObjectMap(10, SETTINGS)
    assert objects.add(line(1, 2, 2, 3, 3), line(0, 1, 2, 3, 3), {1: EAST, 3: EAST}) == {}


def test_voxel_goes_to_the_object_that_most_masks_give_it_to() -> None:
    objects = ObjectMap(6, SETTINGS)
    for _ in range(3):
        objects.add(line(1, 1, 1, 2, 2), line(0, 1, 2, 4, 5), {1: EAST, 2: NORTH})
    objects.add(line(1, 1, 2, 2, 2), line(0, 1, 2, 4, 5), {1: EAST, 2: NORTH})
    assert objects.finish(Surface(6)).tolist() == [1, 1, 1, 0, 2, 2]


def test_each_object_is_cut_to_its_largest_piece() -> None:
    owner = np.array([1, 1, 0, 1, 1, 1, 2, 0, 2], np.int32)
    assert largest_pieces(Surface(9), owner).tolist() == [0, 0, 0, 1, 1, 1, 2, 0, 0]


def test_overlap_tells_look_alikes_apart_and_what_is_left_is_matched_by_looks() -> None:
    cosine = np.array([[0.99, 0.99], [0.99, 0.99]])
    assert match_offline(np.array([[0.0, 0.9], [0.0, 0.0]]), cosine, 0.9) == [(1, 2), (2, 1)]


def test_nothing_is_matched_below_the_threshold() -> None:
    assert match_offline(np.array([[1.0]]), np.array([[0.89]]), 0.9) == []
    assert match_offline(np.zeros((0, 3)), np.zeros((0, 3)), 0.9) == []


@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 2**16))
def test_matching_is_one_to_one_above_the_threshold_and_ignores_the_order(n: int, m: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    overlap, cosine = generator.random((n, m)), generator.random((n, m))
    pairs = match_offline(overlap, cosine, 0.5)
    assert len({p for p, _ in pairs}) == len({c for _, c in pairs}) == len(pairs)
    assert all(cosine[p - 1, c - 1] >= 0.5 for p, c in pairs)
    order = generator.permutation(n)
    again = match_offline(overlap[order], cosine[order], 0.5)
    assert sorted((int(order[p - 1]) + 1, c) for p, c in again) == sorted(pairs)


def test_confidence_is_half_at_the_threshold_and_grows_with_the_margin() -> None:
    values = margin_confidence(np.array([0.9, 0.88, 0.92, 1.0]), 0.9, 0.02)
    assert values[0] == pytest.approx(0.5)
    assert values[1] == pytest.approx(values[2])
    assert 0.7 < values[1] < values[3] < 1.0
