"""How far moved objects moved: the result's displacement against the ground truth's.

Compared for true moved objects whose identity was kept, in two ways. The *visible* displacement joins the
centres of the object's visible ground-truth units in the two visits: what two partial views show. The
displacement *at the centroid*, for objects whose true motion is known, is that of the centroid of all
that either visit saw: partial views do not distort it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import invert_rigid, transform_points
from pipeline.evaluation.ground_truth import Motion
from pipeline.evaluation.units import UNIT_SIZE_M, Units, voxel_means
from pipeline.result import MapObject


@dataclass(frozen=True)
class DisplacementScores:
    """Errors over compared objects, in metres; None without any.

    Attributes:
        compared: moved objects with a kept identity and a predicted displacement.
        mean_error_m, median_error_m, largest_error_m: of | predicted length - visible true length |.
        mean_vector_error_m: of the distance between predicted and visible true displacement vector.
        centroid_compared: those of the compared ones whose true motion is known.
        mean_centroid_error_m, median_centroid_error_m, largest_centroid_error_m: of the distance between
            predicted and true displacement vector at the true centroid.
    """

    compared: int
    mean_error_m: float | None = None
    median_error_m: float | None = None
    largest_error_m: float | None = None
    mean_vector_error_m: float | None = None
    centroid_compared: int = 0
    mean_centroid_error_m: float | None = None
    median_centroid_error_m: float | None = None
    largest_centroid_error_m: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(vars(self))


def displacement_scores(
    units: Units,
    kept: tuple[tuple[int, int], ...],
    objects: Mapping[int, MapObject],
    sessions: tuple[int, int],
    motions: Mapping[int, Motion] | None = None,
) -> DisplacementScores:
    """Errors of the (true object, predicted object) pairs in ``kept``."""
    motions = motions or {}
    length_errors, vector_errors, centroid_errors = [], [], []
    for true_id, predicted_id in kept:
        predicted = objects[predicted_id]
        before, after = (predicted.sighting(session) for session in sessions)
        if before is None or after is None or predicted.displacement_m is None:
            continue
        true_vector = _centre(units, true_id, sessions[1]) - _centre(units, true_id, sessions[0])
        vector = np.subtract(after.centroid_world_m, before.centroid_world_m)
        length_errors.append(abs(predicted.displacement_m - float(np.linalg.norm(true_vector))))
        vector_errors.append(float(np.linalg.norm(vector - true_vector)))
        if true_id in motions:
            T_true = motions[true_id].T_world_motion
            centroid = true_centroid(units, true_id, sessions, T_true)
            at_centroid = _displacement(predicted_motion(predicted, sessions), centroid)
            centroid_errors.append(float(np.linalg.norm(at_centroid - _displacement(T_true, centroid))))
    if not length_errors:
        return DisplacementScores(0)
    return DisplacementScores(
        compared=len(length_errors),
        mean_error_m=float(np.mean(length_errors)),
        median_error_m=float(np.median(length_errors)),
        largest_error_m=float(np.max(length_errors)),
        mean_vector_error_m=float(np.mean(vector_errors)),
        centroid_compared=len(centroid_errors),
        mean_centroid_error_m=float(np.mean(centroid_errors)) if centroid_errors else None,
        median_centroid_error_m=float(np.median(centroid_errors)) if centroid_errors else None,
        largest_centroid_error_m=float(np.max(centroid_errors)) if centroid_errors else None,
    )


def predicted_motion(predicted: MapObject, sessions: tuple[int, int]) -> NDArray[np.float64]:
    """(4, 4) motion that the result says: the registered one, else the shift of the centroid."""
    if predicted.T_world_motion is not None:
        return np.asarray(predicted.T_world_motion, dtype=np.float64)
    before, after = (predicted.sighting(session) for session in sessions)
    if before is None or after is None:
        raise ValueError(f"object {predicted.object_id} is not in both visits")
    motion = np.eye(4)
    motion[:3, 3] = np.subtract(after.centroid_world_m, before.centroid_world_m)
    return motion


def true_centroid(
    units: Units, object_id: int, sessions: tuple[int, int], T_world_motion: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(3,) centroid, where the object stood in the previous visit, of all that either visit saw."""
    points = points_of_both_visits(units, object_id, sessions, T_world_motion)
    occupied, _ = voxel_means(points, [np.zeros(len(points), dtype=np.int64)])
    # Voxel centres, so that what both visits saw does not weigh more than what one saw.
    return ((np.floor(occupied / UNIT_SIZE_M) + 0.5) * UNIT_SIZE_M).mean(axis=0)


def points_of_both_visits(
    units: Units, object_id: int, sessions: tuple[int, int], T_world_motion: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 3) units of a true object from both visits, where it stood in the previous one."""
    mine = units.true_object == object_id
    before = units.points_world[mine & (units.session == sessions[0])]
    after = units.points_world[mine & (units.session == sessions[1])]
    return np.concatenate([before, transform_points(invert_rigid(T_world_motion), after)])


def _displacement(T_world_motion: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    return T_world_motion[:3, :3] @ point + T_world_motion[:3, 3] - point


def _centre(units: Units, object_id: int, session: int) -> NDArray[np.float64]:
    return units.points_world[(units.true_object == object_id) & (units.session == session)].mean(axis=0)
