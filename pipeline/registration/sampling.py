"""Choosing the points that take part in a registration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_CELLS_PER_UNIT = 3  # normals fall into cells of about 20 degrees


def sample_normal_space(
    normals: NDArray[np.floating], count: int, rng: np.random.Generator
) -> NDArray[np.intp]:
    """Points drawn evenly over the directions of their normals.

    Large planes are many points that all say the same; the few points on other surfaces alone hold the
    directions along the planes (Rusinkiewicz and Levoy, Efficient variants of the ICP algorithm, 2001).

    Args:
        normals: (N, 3) unit vectors.
        count: points wanted.

    Returns:
        (min(count, N),) ascending point numbers.
    """
    if len(normals) <= count:
        return np.arange(len(normals))
    cells = np.rint(normals * _CELLS_PER_UNIT).astype(np.int64) + _CELLS_PER_UNIT
    keys = (cells[:, 0] * (2 * _CELLS_PER_UNIT + 1) + cells[:, 1]) * (2 * _CELLS_PER_UNIT + 1) + cells[:, 2]
    shuffled = rng.permutation(len(normals))
    order = shuffled[np.argsort(keys[shuffled], kind="stable")]
    sizes = np.unique(keys, return_counts=True)[1]
    rank = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    # Every direction gives its first point, then every one its second, until there are enough.
    return np.sort(order[np.argsort(rank, kind="stable")[:count]])
