"""Equations 5 and 6 on the correspondences of test_matching, with masks drawn by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.association.aggregation import MatchEvidence, patch_owners, patch_shares

# C* of three previous and three current patches: (p, q, s).
P, Q = np.array([0, 1, 2, 2]), np.array([0, 2, 2, 1])
S = np.array([1.0, 0.8, 1.0, 0.96])
# Previous object 1 owns p0 and p2, object 2 owns p1. Current object 1 owns q0, object 2 owns q1 and q2.
OWNER0, OWNER1 = np.array([1, 2, 1]), np.array([1, 2, 2])


def _evidence(owner0: np.ndarray, owner1: np.ndarray, counts: tuple[int, int] = (2, 2)) -> MatchEvidence:
    evidence = MatchEvidence.empty(*counts)
    evidence.add(owner0[P], owner1[Q], S)
    return evidence


def test_eq5_matches_are_gathered_by_the_masks_at_both_ends() -> None:
    evidence = _evidence(OWNER0, OWNER1)

    # C_1 = {(0,0), (2,2), (2,1)}, C_2 = {(1,2)}; C_12 = {(2,2), (2,1)}.
    assert evidence.leaving_count.tolist() == [3, 1]
    assert evidence.arriving_count.tolist() == [1, 3]
    assert evidence.link_count.tolist() == [[1, 2], [0, 1]]


def test_eq6_mean_confidence_and_match_proportion() -> None:
    evidence = _evidence(OWNER0, OWNER1)

    assert evidence.s_bar == pytest.approx(np.array([[1.0, 0.98], [0.0, 0.8]]))
    assert evidence.sigma == pytest.approx(np.array([[1 / 3, 2 / 3], [0.0, 1.0]]))
    assert evidence.sigma_backward == pytest.approx(np.array([[1.0, 2 / 3], [0.0, 1 / 3]]))


def test_eq5_matches_into_the_background_count_as_leaving_but_link_nothing() -> None:
    evidence = _evidence(OWNER0, np.array([0, 2, 2]))

    assert evidence.leaving_count.tolist() == [3, 1]
    assert evidence.arriving_count.tolist() == [0, 3]
    assert evidence.sigma[0] == pytest.approx([0, 2 / 3])


def test_objects_without_matches_score_zero_not_nan() -> None:
    evidence = _evidence(np.zeros(3, int), np.zeros(3, int), (3, 2))

    for scores in (evidence.sigma, evidence.sigma_backward, evidence.s_bar):
        assert scores.tolist() == np.zeros((3, 2)).tolist()


def test_evidence_of_several_pairs_of_keyframes_is_pooled_match_by_match() -> None:
    # A second pair adds one weak match 1 -> 2: s-bar is the mean over matches, not over keyframes.
    evidence = _evidence(OWNER0, OWNER1)
    other = MatchEvidence.empty(2, 2)
    other.add(np.array([1]), np.array([2]), np.array([0.5]))
    evidence.merge(other)

    assert evidence.sigma[0, 1] == pytest.approx(3 / 4)
    assert evidence.s_bar[0, 1] == pytest.approx((1.0 + 0.96 + 0.5) / 3)


@given(st.integers(0, 10_000))
def test_proportions_of_an_object_never_exceed_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    evidence = MatchEvidence.empty(3, 4)
    evidence.add(rng.integers(0, 4, 60), rng.integers(0, 5, 60), rng.uniform(-1, 1, 60))

    assert (evidence.sigma.sum(axis=1) <= 1 + 1e-12).all()
    assert (evidence.sigma_backward.sum(axis=0) <= 1 + 1e-12).all()
    assert (np.abs(evidence.s_bar) <= 1).all()


def owners_of(mask: np.ndarray, grid: tuple[int, int]) -> list[int]:
    return patch_owners(patch_shares(mask, grid), grid[0] * grid[1]).tolist()


def test_patch_shares_say_how_much_of_a_patch_each_object_covers() -> None:
    mask = np.zeros((8, 16), np.int32)
    mask[:2, :8] = 1
    mask[4:, :8] = 2
    shares = patch_shares(mask, (1, 2))

    assert shares.patch.tolist() == [0, 0]
    assert shares.instance.tolist() == [1, 2]
    assert shares.share.tolist() == [0.25, 0.5]


def test_patch_owner_is_the_object_with_most_pixels_of_the_patch() -> None:
    # Two patches of 8x8 pixels; 24 of 64 are the least share.
    mask = np.zeros((8, 16), np.int32)
    mask[:3, :8] = 1  # 24 pixels: just enough
    mask[:4, 8:] = 2  # 32 pixels
    mask[4:7, 8:] = 3  # 24 pixels: enough, but fewer

    assert owners_of(mask, (1, 2)) == [1, 2]


def test_patch_with_too_little_of_any_object_has_no_owner() -> None:
    mask = np.zeros((8, 8), np.int32)
    mask.reshape(-1)[:23] = 5

    assert owners_of(mask, (1, 1)) == [0]


def test_patches_are_numbered_row_by_row() -> None:
    mask = np.repeat(np.repeat(np.arange(6).reshape(2, 3), 4, axis=0), 4, axis=1)

    assert owners_of(mask, (2, 3)) == [0, 1, 2, 3, 4, 5]


def test_patches_share_uneven_images_without_losing_a_pixel() -> None:
    assert owners_of(np.full((15, 20), 7), (4, 6)) == [7] * 24
