"""Replaced events: a disappeared and an appeared object that share a place, not an identity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SharedPlace:
    """A disappeared and an appeared object at one place (positions in the given arrays)."""

    disappeared: int
    appeared: int
    overlap: float


def bounds_overlap(
    low0: NDArray[np.floating],
    high0: NDArray[np.floating],
    low1: NDArray[np.floating],
    high1: NDArray[np.floating],
) -> NDArray[np.float64]:
    """(n, m) volume that axis-aligned bounds have in common, as a share of the smaller of the two.

    Args:
        low0, high0: (n, 3) metres; low1, high1: (m, 3).
    """
    common = np.minimum(high0[:, None], high1[None]) - np.maximum(low0[:, None], low1[None])
    volume0 = np.prod(high0 - low0, axis=1)[:, None]
    volume1 = np.prod(high1 - low1, axis=1)[None]
    return np.prod(np.clip(common, 0, None), axis=2) / np.maximum(np.minimum(volume0, volume1), 1e-12)


def find_replaced(
    low0: NDArray[np.floating],
    high0: NDArray[np.floating],
    low1: NDArray[np.floating],
    high1: NDArray[np.floating],
    min_overlap: float,
) -> list[SharedPlace]:
    """One-to-one pairs of a disappeared (0) and an appeared (1) object, largest overlap first."""
    if not len(low0) or not len(low1):
        return []
    overlap = bounds_overlap(low0, high0, low1, high1)
    events: list[SharedPlace] = []
    free0, free1 = np.ones(len(low0), bool), np.ones(len(low1), bool)
    for flat in np.argsort(-overlap, axis=None, kind="stable"):
        disappeared, appeared = np.unravel_index(flat, overlap.shape)
        if overlap[disappeared, appeared] < min_overlap:
            break
        if free0[disappeared] and free1[appeared]:
            free0[disappeared] = free1[appeared] = False
            events.append(SharedPlace(int(disappeared), int(appeared), float(overlap[disappeared, appeared])))
    return events
