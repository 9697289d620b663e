"""Masks of single keyframes become objects."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.mapping.merging import ObjectMerger
from pipeline.settings import MergeSettings

SETTINGS = MergeSettings(min_overlap=0.3, min_similarity=0.6, min_image_overlap=0.5)
CUP, BOOK = np.array([1.0, 0.0]), np.array([0.0, 1.0])


def image(values: list[int]) -> np.ndarray:
    return np.array([values], np.int32)


def merged(count: int, *keyframes: tuple[list[int], list[int], dict[int, np.ndarray]]) -> list[int]:
    merger = ObjectMerger(count, SETTINGS, masks_are_tracks=False)
    for masks, voxels, tokens in keyframes:
        merger.add(image(masks), image(voxels), tokens)
    return merger.finish().tolist()


def test_masks_merge_when_they_overlap_and_look_alike() -> None:
    owners = merged(8, ([1] * 6, [0, 1, 2, 3, 4, 5], {1: CUP}), ([7] * 6, [2, 3, 4, 5, 6, 7], {7: CUP}))

    assert owners == [1] * 8


def test_overlapping_masks_that_look_different_stay_apart() -> None:
    owners = merged(8, ([1] * 6, [0, 1, 2, 3, 4, 5], {1: CUP}), ([7] * 6, [2, 3, 4, 5, 6, 7], {7: BOOK}))

    assert owners[0] == 1
    assert owners[7] == 2


def test_masks_that_look_alike_but_hardly_overlap_stay_apart() -> None:
    owners = merged(11, ([1] * 6, [0, 1, 2, 3, 4, 5], {1: CUP}), ([7] * 6, [5, 6, 7, 8, 9, 10], {7: CUP}))

    assert owners[0] == 1
    assert owners[10] == 2


@pytest.mark.parametrize(("shared", "expected"), [(3, 1), (2, 2)])
def test_overlap_threshold_is_a_share_of_the_smaller_set(shared: int, expected: int) -> None:
    # Ten voxels each; three in common are 30 %.
    first, second = list(range(10)), list(range(10 - shared, 20 - shared))

    owners = merged(20, ([1] * 10, first, {1: CUP}), ([1] * 10, second, {1: CUP}))

    assert owners[second[-1]] == expected


def test_mask_joins_the_object_whose_projection_covers_it_where_3d_overlap_is_small() -> None:
    # One voxel of five is shared (3D overlap 0.2), but the object's points project onto eight of the mask's
    # twelve pixels (2D overlap 0.67).
    merger = ObjectMerger(14, SETTINGS, masks_are_tracks=False)
    merger.add(np.array([[1] * 6]), np.array([[0, 1, 2, 3, 4, 5]]), {1: CUP})
    mask, voxels = np.array([[1] * 12]), np.array([[0] * 8 + [10, 11, 12, 13]])
    projected = np.array([[0, 1, 2, 3, 4, 5, 0, 1, -1, -1, -1, -1]])
    merger.add(mask, voxels, {1: CUP}, projected)

    assert merger.finish()[13] == 1


def test_mask_beside_the_projection_of_an_object_stays_apart() -> None:
    merger = ObjectMerger(14, SETTINGS, masks_are_tracks=False)
    merger.add(np.array([[1] * 6]), np.array([[0, 1, 2, 3, 4, 5]]), {1: CUP})
    mask, voxels = np.array([[1] * 12]), np.array([[0] * 8 + [10, 11, 12, 13]])
    projected = np.array([[0, 1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1]])
    merger.add(mask, voxels, {1: CUP}, projected)

    assert merger.finish()[13] == 2


def test_two_masks_of_one_keyframe_are_two_objects() -> None:
    owners = merged(4, ([1, 1, 2, 2], [0, 1, 2, 3], {1: CUP, 2: CUP}))

    assert owners == [1, 1, 2, 2]


def test_pixels_without_voxel_or_mask_lift_nothing() -> None:
    assert merged(2, ([1, 1, 0], [-1, -1, 1], {1: CUP})) == [0, 0]


def tracks(count: int, *keyframes: tuple[list[int], list[int]]) -> list[int]:
    merger = ObjectMerger(count, SETTINGS, masks_are_tracks=True)
    for masks, voxels in keyframes:
        merger.add(image(masks), image(voxels))
    return merger.finish().tolist()


def test_tracks_are_taken_as_they_are() -> None:
    assert tracks(4, ([5, 5, 9], [0, 1, 3]), ([9], [2])) == [5, 5, 9, 9]


def test_voxel_belongs_to_the_majority_of_the_keyframes_that_claim_it() -> None:
    assert tracks(1, ([5], [0]), ([5], [0]), ([9], [0])) == [5]
    assert tracks(1, ([9], [0]), ([5], [0]), ([5], [0]), ([5], [0])) == [5]
