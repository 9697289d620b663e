"""How alike each object's place looks in the other visit, patch by patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass
class PlaceSimilarity:
    """Sums of the best nearby correlation over the patches of every instance of one visit.

    Attributes:
        total: (K + 1,) sum over patches and compared pairs; entry 0 is background.
        count: (K + 1,) patches that went into it.
    """

    total: NDArray[np.float64]
    count: NDArray[np.int64]

    @classmethod
    def empty(cls, instances: int) -> PlaceSimilarity:
        """Nothing compared yet for K instances."""
        return cls(np.zeros(instances + 1), np.zeros(instances + 1, np.int64))

    def add(self, owners: NDArray[np.int32], similarity: NDArray[np.float32]) -> None:
        """Add one keyframe of one pair.

        Args:
            owners: (N,) instance of each patch, 0 = background.
            similarity: (N,) best correlation near the expected place, NaN = not visible there.
        """
        seen = np.isfinite(similarity)
        size = len(self.total)
        self.total += np.bincount(owners[seen], similarity[seen], size)
        self.count += np.bincount(owners[seen], minlength=size)

    def merge(self, other: PlaceSimilarity) -> None:
        """Add the sums of another submap."""
        self.total += other.total
        self.count += other.count

    @property
    def mean(self) -> NDArray[np.float64]:
        """(K + 1,) mean correlation; NaN where nothing was compared."""
        return np.where(self.count > 0, self.total / np.maximum(self.count, 1), np.nan)
