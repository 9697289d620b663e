"""How sure a decision by a threshold is; the publications say nothing about it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def margin_confidence(
    similarity: NDArray[np.floating], threshold: float, softness: float
) -> NDArray[np.float64]:
    """In [0.5, 1], growing with the distance of a similarity from the threshold it was decided by."""
    margin = np.abs(np.asarray(similarity, np.float64) - threshold) / softness
    return 1.0 / (1.0 + np.exp(-np.minimum(margin, 50.0)))
