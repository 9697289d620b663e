"""One-to-one association by the Hungarian algorithm on the score matrix (paper, Eq. 7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment


def associate(
    sigma: NDArray[np.floating], s_bar: NDArray[np.floating], tau_sigma: float, tau_s: float
) -> list[tuple[int, int]]:
    """Pairs of the one-to-one assignment that pass both gates: case 1 only.

    Args:
        sigma: S, (n, m) match proportions; s_bar: (n, m) mean confidences.
        tau_sigma, tau_s: the gates.

    Returns:
        (previous, current) pairs in ascending order. An object without any match is never assigned, although
        the Hungarian algorithm gives every row a column.
    """
    if not sigma.size:
        return []
    rows, columns = linear_sum_assignment(-sigma)
    return [
        (int(row), int(column))
        for row, column in zip(rows, columns, strict=True)
        if sigma[row, column] > 0 and sigma[row, column] >= tau_sigma and s_bar[row, column] >= tau_s
    ]
