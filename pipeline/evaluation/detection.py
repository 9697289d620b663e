"""Object detection at the end of each visit: one-to-one matching on point IoU.

True and predicted objects of a visit are matched one to one (Hungarian on IoU over evaluation units,
pairs below the threshold not allowed). An object of the result without a partner is a false positive,
also when it lies where the ground truth has nothing; a true object without a partner is a miss. All units
count, scored or not: finding an object does not need the other visit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from pipeline.evaluation.counts import Counts
from pipeline.evaluation.overlap import Overlap

THRESHOLDS = (0.25, 0.5)


@dataclass(frozen=True)
class DetectionScores:
    """Detection of one visit at one IoU threshold; ``mean_iou`` is that of the matched pairs."""

    session: int
    threshold: float
    counts: Counts
    mean_iou: float | None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "session": self.session,
            "iou_threshold": self.threshold,
            **self.counts.to_dict(),
            "mean_iou": self.mean_iou,
        }


def detection_scores(
    overlap: Overlap, session: int, threshold: float, predicted_count: int
) -> DetectionScores:
    """Match the objects of one visit.

    Args:
        overlap: of this visit.
        predicted_count: objects of the result with points in this visit, those far from all ground
            truth included.
    """
    iou = overlap.iou
    allowed = np.where(iou >= threshold, iou, 0.0)
    rows, columns = linear_sum_assignment(-allowed)
    matched = allowed[rows, columns]
    matched = matched[matched > 0]
    return DetectionScores(
        session=session,
        threshold=threshold,
        counts=Counts(
            tp=len(matched), fp=predicted_count - len(matched), fn=len(overlap.true_ids) - len(matched)
        ),
        mean_iou=float(matched.mean()) if len(matched) else None,
    )


def all_detection_scores(
    overlaps: Sequence[Overlap], predicted_counts: Sequence[int]
) -> tuple[DetectionScores, ...]:
    """Every visit at every threshold of ``THRESHOLDS``; arguments per visit, as in ``detection_scores``."""
    return tuple(
        detection_scores(overlap, session, threshold, predicted_counts[session])
        for session, overlap in enumerate(overlaps)
        for threshold in THRESHOLDS
    )
