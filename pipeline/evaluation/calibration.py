"""Does confidence mean what it says? Expected calibration error, Brier score, and where the errors are.

Over the decided objects of ``verdicts``, each weighing the same. Confidence is sorted into 15 bins of equal
width over [0, 1] (the last one closed); the expected calibration error is the mean over all objects of
| share that is right - mean confidence | of their bin (Naeini et al., AAAI 2015).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.evaluation.verdicts import Verdicts

BINS = 15
LEAST_CERTAIN = 0.2


@dataclass(frozen=True)
class ConfidenceBin:
    """Objects whose confidence lies in [low, high)."""

    low: float
    high: float
    count: int
    mean_confidence: float
    accuracy: float


@dataclass(frozen=True)
class CalibrationScores:
    """Calibration of the decided objects; None without any.

    Attributes:
        objects: decided objects that were compared; errors: those with a wrong label.
        ece: expected calibration error over ``BINS`` bins of equal width.
        brier: mean of (confidence - right)^2.
        errors_in_least_certain: share of the errors among the ``LEAST_CERTAIN`` share of objects with the
            lowest confidence (equal confidences count in proportion); None without errors.
        bins: the bins that hold objects.
    """

    objects: int
    errors: int
    ece: float | None
    brier: float | None
    errors_in_least_certain: float | None
    bins: tuple[ConfidenceBin, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "weighting": "each object the same",
            "bins_of_equal_width": BINS,
            "least_certain_share": LEAST_CERTAIN,
            **{name: value for name, value in vars(self).items() if name != "bins"},
            "bins": [dict(vars(item)) for item in self.bins],
        }


def calibration_scores(verdicts: Verdicts) -> CalibrationScores:
    """Calibration of one pair, or of several pooled."""
    count = len(verdicts)
    if count == 0:
        return CalibrationScores(0, 0, None, None, None, ())
    confidence, right = verdicts.confidence, verdicts.is_right.astype(np.float64)
    which = np.minimum((confidence * BINS).astype(np.int64), BINS - 1)
    bins = tuple(
        ConfidenceBin(
            low=number / BINS,
            high=(number + 1) / BINS,
            count=int(np.count_nonzero(which == number)),
            mean_confidence=float(confidence[which == number].mean()),
            accuracy=float(right[which == number].mean()),
        )
        for number in np.unique(which).tolist()
    )
    return CalibrationScores(
        objects=count,
        errors=int(np.count_nonzero(~verdicts.is_right)),
        ece=sum(item.count * abs(item.accuracy - item.mean_confidence) for item in bins) / count,
        brier=float(np.mean((confidence - right) ** 2)),
        errors_in_least_certain=errors_in_least_certain(verdicts, LEAST_CERTAIN),
        bins=bins,
    )


def errors_in_least_certain(verdicts: Verdicts, share: float) -> float | None:
    """Share of all errors that the least certain ``share`` of the objects holds; None without errors.

    The expectation over every order of equally certain objects, so that ties neither help nor harm.
    """
    wrong = ~verdicts.is_right
    if not wrong.any():
        return None
    left, held = share * len(verdicts), 0.0
    for value in np.unique(verdicts.confidence):
        group = verdicts.confidence == value
        size = int(np.count_nonzero(group))
        held += min(1.0, left / size) * np.count_nonzero(wrong & group)
        left -= size
        if left <= 0:
            break
    return float(held / np.count_nonzero(wrong))
