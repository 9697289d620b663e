"""How far moved objects moved: the result's displacement against the ground truth's.

Compared for true moved objects whose identity was kept. The true displacement joins the centres of the
object's visible ground-truth units in the two visits, which is what a map can know.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.units import Units
from pipeline.result import MapObject


@dataclass(frozen=True)
class DisplacementScores:
    """Errors over compared objects, in metres; None without any.

    Attributes:
        compared: moved objects with a kept identity and a predicted displacement.
        mean_error_m, median_error_m, largest_error_m: of | predicted length - true length |.
        mean_vector_error_m: of the distance between predicted and true displacement vector.
    """

    compared: int
    mean_error_m: float | None
    median_error_m: float | None
    largest_error_m: float | None
    mean_vector_error_m: float | None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(vars(self))


def displacement_scores(
    units: Units,
    kept: tuple[tuple[int, int], ...],
    objects: Mapping[int, MapObject],
    sessions: tuple[int, int],
) -> DisplacementScores:
    """Errors of the (true object, predicted object) pairs in ``kept``."""
    length_errors, vector_errors = [], []
    for true_id, predicted_id in kept:
        predicted = objects[predicted_id]
        before, after = (predicted.sighting(session) for session in sessions)
        if before is None or after is None or predicted.displacement_m is None:
            continue
        true_vector = _centre(units, true_id, sessions[1]) - _centre(units, true_id, sessions[0])
        vector = np.subtract(after.centroid_world_m, before.centroid_world_m)
        length_errors.append(abs(predicted.displacement_m - float(np.linalg.norm(true_vector))))
        vector_errors.append(float(np.linalg.norm(vector - true_vector)))
    if not length_errors:
        return DisplacementScores(0, None, None, None, None)
    return DisplacementScores(
        compared=len(length_errors),
        mean_error_m=float(np.mean(length_errors)),
        median_error_m=float(np.median(length_errors)),
        largest_error_m=float(np.max(length_errors)),
        mean_vector_error_m=float(np.mean(vector_errors)),
    )


def _centre(units: Units, object_id: int, session: int) -> NDArray[np.float64]:
    return units.points_world[(units.true_object == object_id) & (units.session == session)].mean(axis=0)
