"""Patch-to-mask aggregation and mask scores (paper, Eq. 5 and 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MIN_PATCH_SHARE = 24 / 64


@dataclass(frozen=True)
class PatchShares:
    """Which objects the patches of a keyframe show; one entry per patch and object that meet.

    Attributes:
        patch: (E,) patch number, row by row.
        instance: (E,) object, counted from 1.
        share: (E,) part of the patch that the object covers, in (0, 1].
    """

    patch: NDArray[np.int64]
    instance: NDArray[np.int64]
    share: NDArray[np.float64]


def patch_shares(mask: NDArray[np.integer], grid: tuple[int, int]) -> PatchShares:
    """How much of each patch each object covers.

    Args:
        mask: (h, w) object number of each strided pixel, 0 = none.
        grid: (H_f, W_f).
    """
    rows, columns = grid
    height, width = mask.shape
    row = np.arange(height) * rows // height
    column = np.arange(width) * columns // width
    patch = (row[:, None] * columns + column[None, :]).reshape(-1)
    owner = mask.reshape(-1).astype(np.int64)
    count = int(owner.max(initial=0)) + 1
    pairs, pixels = np.unique(patch * count + owner, return_counts=True)
    patch_of, object_of = np.divmod(pairs, count)
    area = np.bincount(patch, minlength=rows * columns)
    inside = object_of > 0
    return PatchShares(patch_of[inside], object_of[inside], (pixels / area[patch_of])[inside])


def patch_owners(shares: PatchShares, patch_count: int) -> NDArray[np.int32]:
    """(patch_count,) the object that covers most of each patch, if it covers at least ``MIN_PATCH_SHARE``
    of it; else 0."""
    enough = shares.share >= MIN_PATCH_SHARE
    patch, instance, share = shares.patch[enough], shares.instance[enough], shares.share[enough]
    # Written in ascending order of the share, so that the object with the largest one stays.
    order = np.lexsort((-instance, share))
    owners = np.zeros(patch_count, np.int32)
    owners[patch[order]] = instance[order]
    return owners


@dataclass
class MatchEvidence:
    """Sums over correspondences between the objects of two visits, from which the scores follow.

    Objects are numbered from 0 here (instance numbers). Evidence adds up over pairs of keyframes.

    Attributes:
        link_count: (n, m) |C_lk|.
        link_score: (n, m) sum of s(p, q) over C_lk.
        leaving_count: (n,) |C_l|, matches with their previous patch in object l.
        arriving_count: (m,) |C_k|, matches with their current patch in object k.
    """

    link_count: NDArray[np.int64]
    link_score: NDArray[np.float64]
    leaving_count: NDArray[np.int64]
    arriving_count: NDArray[np.int64]

    @classmethod
    def empty(cls, previous_objects: int, current_objects: int) -> MatchEvidence:
        """No evidence yet between n and m objects."""
        shape = (previous_objects, current_objects)
        return cls(
            np.zeros(shape, np.int64),
            np.zeros(shape, np.float64),
            np.zeros(previous_objects, np.int64),
            np.zeros(current_objects, np.int64),
        )

    def add(
        self,
        owner0: NDArray[np.integer],
        owner1: NDArray[np.integer],
        score: NDArray[np.floating],
    ) -> None:
        """Add correspondences (Eq. 5).

        Args:
            owner0, owner1: (P,) the objects at both ends of each match, counted from 1; 0 = no object.
            score: (P,) s(p, q).
        """
        leaves, arrives = owner0 > 0, owner1 > 0
        np.add.at(self.leaving_count, owner0[leaves] - 1, 1)
        np.add.at(self.arriving_count, owner1[arrives] - 1, 1)
        both = leaves & arrives
        pairs = (owner0[both] - 1, owner1[both] - 1)
        np.add.at(self.link_count, pairs, 1)
        np.add.at(self.link_score, pairs, score[both])

    def merge(self, other: MatchEvidence) -> None:
        """Add the evidence of another submap."""
        self.link_count += other.link_count
        self.link_score += other.link_score
        self.leaving_count += other.leaving_count
        self.arriving_count += other.arriving_count

    @property
    def sigma(self) -> NDArray[np.float64]:
        """(n, m) match proportion |C_lk| / |C_l| (Eq. 6); 0 for an object without matches."""
        return self.link_count / np.maximum(self.leaving_count, 1)[:, None]

    @property
    def sigma_backward(self) -> NDArray[np.float64]:
        """(n, m) |C_lk| / |C_k|, the proportion seen from the current object."""
        return self.link_count / np.maximum(self.arriving_count, 1)[None, :]

    @property
    def s_bar(self) -> NDArray[np.float64]:
        """(n, m) mean confidence of C_lk (Eq. 6); 0 where it is empty."""
        return self.link_score / np.maximum(self.link_count, 1)
