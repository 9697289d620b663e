"""One-to-one association by the Hungarian algorithm on the score matrix (paper, Eq. 7)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment


def assign(sigma: NDArray[np.floating]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the one-to-one assignment of the greatest total sigma; pairs without any are left
    out, although the Hungarian algorithm gives every row a column."""
    if not sigma.size:
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    rows, columns = linear_sum_assignment(-sigma)
    matched = sigma[rows, columns] > 0
    return rows[matched], columns[matched]


def associate(
    sigma: NDArray[np.floating], s_bar: NDArray[np.floating], tau_sigma: float, tau_s: float
) -> list[tuple[int, int]]:
    """Pairs of the one-to-one assignment that pass both gates: case 1 only.

    Args:
        sigma: S, (n, m) match proportions; s_bar: (n, m) mean confidences.
        tau_sigma, tau_s: the gates.

    Returns:
        (previous, current) pairs in ascending order. An object without any match is never assigned.
    """
    rows, columns = assign(sigma)
    passes = (sigma[rows, columns] >= tau_sigma) & (s_bar[rows, columns] >= tau_s)
    return list(zip(rows[passes].tolist(), columns[passes].tolist(), strict=True))
