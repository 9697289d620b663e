"""How moved objects turned: the result's rotation against the ground truth's.

Compared for true moved objects whose identity was kept, whose true motion is known and whose rotation the
result estimated. Turns that the object's symmetry hides are no error. Of a result that tells only the
angle of a rotation, the error is the difference of the angles, which is a lower bound.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.ground_truth import Motion
from pipeline.evaluation.motion_error import angle_only_error_rad, rotation_error_rad
from pipeline.result import MapObject


@dataclass(frozen=True)
class RotationScores:
    """Errors over compared objects, in degrees; None without any.

    Attributes:
        known: moved objects with a kept identity whose true motion is known.
        compared: those of them with an estimated rotation.
        angle_only: those of the compared ones of which only the angle was known.
    """

    known: int
    compared: int
    angle_only: int
    mean_error_deg: float | None
    median_error_deg: float | None
    largest_error_deg: float | None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return dict(vars(self))


def rotation_scores(
    kept: tuple[tuple[int, int], ...],
    objects: Mapping[int, MapObject],
    motions: Mapping[int, Motion],
    up_world: NDArray[np.float64],
) -> RotationScores:
    """Errors of the (true object, predicted object) pairs in ``kept``; ``up_world`` is a unit vector."""
    errors, angle_only, known = [], 0, 0
    for true_id, predicted_id in kept:
        if true_id not in motions:
            continue
        known += 1
        motion, predicted = motions[true_id], objects[predicted_id]
        true = motion.T_world_motion[:3, :3]
        if predicted.T_world_motion is not None:
            estimated = np.asarray(predicted.T_world_motion, dtype=np.float64)[:3, :3]
            errors.append(rotation_error_rad(estimated, true, up_world, motion.symmetry_order))
        elif predicted.rotation_rad is not None:
            angle_only += 1
            errors.append(angle_only_error_rad(predicted.rotation_rad, true, up_world, motion.symmetry_order))
    if not errors:
        return RotationScores(known, 0, 0, None, None, None)
    degrees = np.degrees(errors)
    return RotationScores(
        known=known,
        compared=len(errors),
        angle_only=angle_only,
        mean_error_deg=float(degrees.mean()),
        median_error_deg=float(np.median(degrees)),
        largest_error_deg=float(degrees.max()),
    )
