"""What leaving the least certain objects undecided would buy: coverage against precision.

Objects are decided from the most to the least certain; at each coverage (share of the decided objects of
``verdicts``) stand the precision (share right) of what is decided so far and the confidence that it takes.
The area under the risk-coverage curve is the mean error rate over all coverages 1/N, 2/N, ... 1 (Geifman and
El-Yaniv, NeurIPS 2017); equally certain objects come in random order, in expectation. What the result itself
left *unknown* is told apart: it is no point of the curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.evaluation.verdicts import Verdicts


@dataclass(frozen=True)
class AbstentionPoint:
    """Deciding only objects of at least this confidence."""

    coverage: float
    precision: float
    least_confidence: float


@dataclass(frozen=True)
class AbstentionScores:
    """Abstention curves of one pair, or of several pooled.

    Attributes:
        curve: one point per distinct confidence, growing coverage; all decided objects.
        change_curve: the same of the objects labelled as changed only.
        area_under_risk_coverage: of ``curve``, 0 is best; None without objects.
        change_area_under_risk_coverage: of ``change_curve``.
        unknown, unknown_rate: objects that the result left unknown, and their share of all matched objects.
        unknown_changed: those of them that truly changed.
        unmatched: objects of the result without a scored unit, in no number above.
    """

    curve: tuple[AbstentionPoint, ...]
    change_curve: tuple[AbstentionPoint, ...]
    area_under_risk_coverage: float | None
    change_area_under_risk_coverage: float | None
    unknown: int
    unknown_rate: float | None
    unknown_changed: int
    unmatched: int

    def precision_at(self, coverage: float) -> float | None:
        """Precision at the first point of the curve that covers at least this share."""
        return next((point.precision for point in self.curve if point.coverage >= coverage - 1e-12), None)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            **vars(self),
            "curve": [dict(vars(point)) for point in self.curve],
            "change_curve": [dict(vars(point)) for point in self.change_curve],
        }


def abstention_scores(verdicts: Verdicts) -> AbstentionScores:
    """Curves and areas."""
    changes = verdicts.changes()
    matched = len(verdicts) + verdicts.unknown
    return AbstentionScores(
        curve=abstention_curve(verdicts),
        change_curve=abstention_curve(changes),
        area_under_risk_coverage=area_under_risk_coverage(verdicts),
        change_area_under_risk_coverage=area_under_risk_coverage(changes),
        unknown=verdicts.unknown,
        unknown_rate=verdicts.unknown / matched if matched else None,
        unknown_changed=verdicts.unknown_changed,
        unmatched=verdicts.unmatched,
    )


def abstention_curve(verdicts: Verdicts) -> tuple[AbstentionPoint, ...]:
    """Coverage and precision at every distinct confidence, the most certain first."""
    points = []
    for value in np.unique(verdicts.confidence)[::-1].tolist():
        decided = verdicts.confidence >= value
        points.append(
            AbstentionPoint(float(decided.mean()), float(verdicts.is_right[decided].mean()), float(value))
        )
    return tuple(points)


def area_under_risk_coverage(verdicts: Verdicts) -> float | None:
    """Mean error rate over coverages 1/N ... 1; None without objects."""
    count = len(verdicts)
    if count == 0:
        return None
    values, group = np.unique(-verdicts.confidence, return_inverse=True)
    sizes = np.bincount(group, minlength=len(values))
    wrong = np.bincount(group, weights=~verdicts.is_right, minlength=len(values))
    # Within a group of equal confidence errors come evenly, in expectation.
    errors = np.cumsum(np.repeat(wrong / sizes, sizes))
    return float(np.mean(errors / np.arange(1, count + 1)))
