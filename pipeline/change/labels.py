"""Change labels from the association alone (paper, Eq. 8)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from pipeline.result import ChangeLabel


def labels_from_association(
    pairs: Iterable[tuple[int, int]],
    centroids0_world: NDArray[np.floating],
    centroids1_world: NDArray[np.floating],
    coverage0: NDArray[np.floating],
    coverage1: NDArray[np.floating],
    tau_d_m: float,
    nu_min: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Labels of the previous and the current objects.

    Args:
        pairs: A, (previous, current) counted from 0.
        centroids0_world, centroids1_world: (n, 3), (m, 3) metres.
        coverage0, coverage1: nu of each object, in [0, 1].
        tau_d_m: displacement threshold, metres.
        nu_min: least coverage of appeared and disappeared.

    Returns:
        (n,), (m,) ``ChangeLabel`` codes.
    """
    labels0 = np.where(coverage0 >= nu_min, ChangeLabel.DISAPPEARED, ChangeLabel.UNKNOWN)
    labels1 = np.where(coverage1 >= nu_min, ChangeLabel.APPEARED, ChangeLabel.UNKNOWN)
    for previous, current in pairs:
        displacement_m = np.linalg.norm(centroids1_world[current] - centroids0_world[previous])
        label = ChangeLabel.STATIC if displacement_m <= tau_d_m else ChangeLabel.MOVED
        labels0[previous] = labels1[current] = label
    return labels0.astype(np.int64), labels1.astype(np.int64)
