"""How likely a label is right: what people read as its confidence, and what orders the review queue.

The log odds that decide are not calibrated for this: a thing that left may have moved rather than
disappeared, a small one is judged by a few pixels, and two rules may err together. So the chance to be right
is a logistic model of its own for each sort of label (Platt, 1999; ``benchmarks/fit_confidence.py``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.result import ChangeLabel
from pipeline.settings import ConfidenceSettings

_LOG_ODDS_LIMIT = 8.0
_MOVE_LIMIT = 4.0
# Objects that were laid over no other have no better chance to have moved than this.
NO_MOVE_LOG_ODDS = -4.0
FEATURES = ("bias", "change", "coverage", "voxels", "move")
GROUPS = ("static", "changed", "moved")


def group_of(labels: NDArray[np.integer]) -> NDArray[np.int64]:
    """Row of the weights for each label; unknown objects are judged like static ones."""
    group = np.zeros(len(labels), np.int64)
    group[np.isin(labels, (ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED))] = 1
    group[np.asarray(labels) == ChangeLabel.MOVED] = 2
    return group


def confidence_features(
    log_odds: NDArray[np.floating],
    coverage: NDArray[np.floating],
    voxel_count: NDArray[np.integer],
    move_log_odds: NDArray[np.floating],
) -> NDArray[np.float64]:
    """(K, 5) what the weights apply to.

    Args:
        log_odds: (K,) of a change at the object's place.
        coverage: (K,) nu.
        voxel_count: (K,) voxels of the object.
        move_log_odds: (K,) of the chosen move, or of the likeliest one that was not chosen.
    """
    return np.stack(
        [
            np.ones(len(log_odds)),
            np.minimum(np.abs(log_odds), _LOG_ODDS_LIMIT),
            np.minimum(coverage, 1.0),
            np.log10(np.maximum(voxel_count, 1)),
            np.clip(move_log_odds, NO_MOVE_LOG_ODDS, _MOVE_LIMIT),
        ],
        axis=1,
    ).astype(np.float64)


def label_confidence(
    labels: NDArray[np.integer], features: NDArray[np.float64], settings: ConfidenceSettings
) -> NDArray[np.float64]:
    """(K,) probability that each label is right.

    Args:
        labels: (K,) ``ChangeLabel`` codes.
        features: as ``confidence_features`` gives them.
    """
    weights = np.array([[getattr(settings, f"{group}_{name}") for name in FEATURES] for group in GROUPS])
    score = (features * weights[group_of(labels)]).sum(axis=1)
    return 1.0 / (1.0 + np.exp(-np.clip(score, -30, 30)))
