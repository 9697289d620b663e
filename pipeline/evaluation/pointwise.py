"""Change labels point by point (paper, Sec. IV: precision, recall and F1 per change label).

Every scored unit gives one entry of a confusion matrix: its true label against the predicted one. A unit
is a true positive of its label when both agree; otherwise it is a false negative of the true label
(also when it was missed or left unknown) and a false positive of the predicted label (missed and unknown
are no label, so they invent nothing). Predictions near unscored ground truth count nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.counts import Counts, mean_defined, pooled
from pipeline.evaluation.units import MISSED, SCORED_LABELS, Units
from pipeline.result import ChangeLabel

CHANGES = (ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED, ChangeLabel.MOVED)


@dataclass(frozen=True)
class PointwiseScores:
    """Agreement of labels over scored units.

    Attributes:
        per_label: counts of static, appeared, disappeared, moved.
        invented: per label, predicted voxels far from any ground truth of their visit; not among the FP.
        scored, unscored: units that count and units that do not.
        unknown, missed: scored units left unknown, and scored units without a map point in reach.
        changed, changed_unknown: scored units that truly changed, and those of them left unknown.
    """

    per_label: dict[ChangeLabel, Counts]
    invented: dict[ChangeLabel, int]
    scored: int
    unscored: int
    unknown: int
    missed: int
    changed: int
    changed_unknown: int

    @property
    def appeared_disappeared(self) -> Counts:
        """Appeared and disappeared pooled, as the paper reports them."""
        return self.per_label[ChangeLabel.APPEARED] + self.per_label[ChangeLabel.DISAPPEARED]

    @property
    def micro(self) -> Counts:
        """All four labels pooled."""
        return pooled(self.per_label.values())

    @property
    def macro_f1(self) -> float | None:
        """Mean F1 of the labels that occur in the truth or in the prediction."""
        return mean_defined(counts.f1 for counts in self.per_label.values())

    @property
    def mean_change_f1(self) -> float | None:
        """Mean F1 of those of appeared, disappeared and moved that occur; None if nothing changed."""
        return mean_defined(self.per_label[label].f1 for label in CHANGES)

    def precision_with_invented(self, label: ChangeLabel) -> float | None:
        """Precision when predictions far from all ground truth also count as false positives."""
        counts = self.per_label[label]
        return Counts(counts.tp, counts.fp + self.invented[label], counts.fn).precision

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "units_scored": self.scored,
            "units_not_scored": self.unscored,
            "missed_rate": self.missed / self.scored if self.scored else None,
            "unknown_rate": self.unknown / self.scored if self.scored else None,
            "unknown_rate_of_changed": self.changed_unknown / self.changed if self.changed else None,
            "per_label": {
                label.name.lower(): {
                    **counts.to_dict(),
                    "invented": self.invented[label],
                    "precision_with_invented": self.precision_with_invented(label),
                }
                for label, counts in self.per_label.items()
            },
            "appeared_disappeared": self.appeared_disappeared.to_dict(),
            "micro": self.micro.to_dict(),
            "macro_f1": self.macro_f1,
            "mean_change_f1": self.mean_change_f1,
        }


def pointwise_scores(units: Units, invented: NDArray[np.int64]) -> PointwiseScores:
    """Score the labels of units; ``invented`` as from ``units.invented_labels``."""
    scored = units.scored
    true, predicted = units.true_label[scored], units.predicted_label[scored]
    changed = np.isin(true, CHANGES)
    return PointwiseScores(
        per_label={label: count_class(true, predicted, label) for label in SCORED_LABELS},
        invented={label: int(np.count_nonzero(invented == label)) for label in SCORED_LABELS},
        scored=len(true),
        unscored=len(units) - len(true),
        unknown=int(np.count_nonzero(predicted == ChangeLabel.UNKNOWN)),
        missed=int(np.count_nonzero(predicted == MISSED)),
        changed=int(np.count_nonzero(changed)),
        changed_unknown=int(np.count_nonzero(predicted[changed] == ChangeLabel.UNKNOWN)),
    )


def count_class(true: NDArray[np.int64], predicted: NDArray[np.int64], code: int) -> Counts:
    """One class against all others."""
    is_true, is_predicted = true == code, predicted == code
    return Counts(
        tp=int(np.count_nonzero(is_true & is_predicted)),
        fp=int(np.count_nonzero(~is_true & is_predicted)),
        fn=int(np.count_nonzero(is_true & ~is_predicted)),
    )
