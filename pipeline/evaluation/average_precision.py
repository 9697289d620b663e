"""Average precision as PASCAL VOC has counted it since 2010: area under the enveloped curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def average_precision(
    confidence: Sequence[float], is_true_positive: Sequence[bool], truth_count: int
) -> float | None:
    """Area under precision (largest at this or any higher recall) over recall.

    Args:
        confidence: of every detection; equal ones keep their order.
        is_true_positive: whether each detection is right; all others are false positives.
        truth_count: what there was to find; None is returned when that is 0.
    """
    if truth_count == 0:
        return None
    order = np.argsort(-np.asarray(confidence, dtype=np.float64), kind="stable")
    right = np.cumsum(np.asarray(is_true_positive, dtype=np.int64)[order])
    precision = right / np.arange(1, len(order) + 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    recall = np.concatenate([[0.0], right / truth_count])
    return float(np.sum(np.diff(recall) * envelope))
