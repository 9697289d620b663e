"""Patch-to-mask aggregation and mask scores (paper, Eq. 5 and 6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MIN_PATCH_SHARE = 24 / 64


def patch_owners(mask: NDArray[np.integer], grid: tuple[int, int]) -> NDArray[np.int32]:
    """Which object each patch belongs to.

    Args:
        mask: (h, w) object number of each strided pixel, 0 = none.
        grid: (H_f, W_f).

    Returns:
        (H_f * W_f,) the object that covers most of the patch, if it covers at least ``MIN_PATCH_SHARE``
        of it; else 0.
    """
    rows, columns = grid
    height, width = mask.shape
    row = np.arange(height) * rows // height
    column = np.arange(width) * columns // width
    patch = (row[:, None] * columns + column[None, :]).reshape(-1)
    owner = mask.reshape(-1).astype(np.int64)
    count = int(owner.max()) + 1
    pairs, pixels = np.unique(patch * count + owner, return_counts=True)
    patch_of, object_of = np.divmod(pairs, count)
    area = np.bincount(patch, minlength=rows * columns)
    eligible = (object_of > 0) & (pixels >= MIN_PATCH_SHARE * area[patch_of])
    patch_of, object_of, pixels = patch_of[eligible], object_of[eligible], pixels[eligible]
    # Written in ascending order of pixels, so that the object with most pixels stays.
    order = np.lexsort((-object_of, pixels))
    owners = np.zeros(rows * columns, np.int32)
    owners[patch_of[order]] = object_of[order]
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
