"""What the ground truth says at the points of each instance of a result; for the scripts that fit weights."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.ply import LabelledPoints
from pipeline.result import Result

MATCH_RADIUS_M = 0.15


@dataclass(frozen=True)
class InstanceTruth:
    """An instance (counted from 0) of a visit, its object, and the true label near each of its points."""

    session: int
    instance: int
    object_id: int
    labels: NDArray[np.uint8]


def instance_truths(result: Result, truth: LabelledPoints) -> Iterator[InstanceTruth]:
    """All instances of all visits; points without ground truth in reach give no label."""
    scores = result.score_matrix
    for number, session in enumerate(result.sessions):
        mine = truth.session == number
        distance, nearest = cKDTree(truth.points_world[mine]).query(
            np.asarray(session.points_world), distance_upper_bound=MATCH_RADIUS_M
        )
        near, ids = np.isfinite(distance), np.asarray(session.object_ids)
        for instance, object_id in enumerate((scores.row_object_ids, scores.column_object_ids)[number]):
            labels = truth.label[mine][nearest[near & (ids == object_id)]]
            yield InstanceTruth(number, instance, int(object_id), labels)
