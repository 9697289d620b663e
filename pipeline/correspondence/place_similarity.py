"""How alike each object's place looks in the other visit, patch by patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.association.aggregation import PatchShares

# Patches of which an object covers less show something else.
MIN_SHARE = 0.1


@dataclass
class PlaceSimilarity:
    """Sums of the best nearby correlation over the patches of every instance of one visit.

    Attributes:
        total: (K + 1,) sum over patches and compared pairs, each by the part that the object covers.
        count: (K + 1,) patches that went into it, by the same parts.
    """

    total: NDArray[np.float64]
    count: NDArray[np.float64]

    @classmethod
    def empty(cls, instances: int) -> PlaceSimilarity:
        """Nothing compared yet for K instances."""
        return cls(np.zeros(instances + 1), np.zeros(instances + 1))

    def add(self, shares: PatchShares, similarity: NDArray[np.float32]) -> None:
        """Add one keyframe of one pair.

        Args:
            shares: which objects its patches show; a patch speaks for every object it shows, so that
                things smaller than a patch are compared as well.
            similarity: (N,) best correlation near the expected place, NaN = not visible there.
        """
        values = similarity[shares.patch]
        seen = np.isfinite(values) & (shares.share >= MIN_SHARE)
        instance, weight = shares.instance[seen], shares.share[seen]
        self.total += np.bincount(instance, weight * values[seen], len(self.total))
        self.count += np.bincount(instance, weight, len(self.total))

    def merge(self, other: PlaceSimilarity) -> None:
        """Add the sums of another submap."""
        self.total += other.total
        self.count += other.count

    @property
    def mean(self) -> NDArray[np.float64]:
        """(K + 1,) mean correlation; NaN where nothing was compared."""
        return np.where(self.count > 0, self.total / np.maximum(self.count, 1e-9), np.nan)
