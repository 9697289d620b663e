"""Matching and registration of instances as LivingScenes reports them (Zhu et al., CVPR 2024, on 3RScan).

Over the true objects that are in both visits. An object is *dynamic* if it truly turned by more than 1
degree or moved by more than 5 cm, else *static*. It is matched when one object of the result is its majority
in both visits and mostly consists of it. A matched object is registered when the motion that the result says
carries its points to within 0.1 m (root mean square) of where they truly went; its rotation is right when the
error is under 10 degrees; both up to the object's symmetry. A scene is hit at 25, 50 and 75 % when at least
that share of its objects is matched.

What differs here: LivingScenes is given segmented instances, and the published code compares translations of
matrices, which depend on where the origin lies; here instances are found, and the shift is that of the
centroid. Static objects without a stated motion did not move. Of a result without a registered motion, the
shift of the centroid counts (nothing, if it is labelled static).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import rotation_angle_rad
from pipeline.evaluation.displacement import points_of_both_visits, predicted_motion, true_centroid
from pipeline.evaluation.ground_truth import Motion
from pipeline.evaluation.identity import kept_alone, true_labels
from pipeline.evaluation.matched import Matched
from pipeline.evaluation.motion_error import rotation_error_rad, transform_error_m
from pipeline.evaluation.tables import aligned, number
from pipeline.result import ChangeLabel

DYNAMIC_ROTATION_DEG = 1.0
DYNAMIC_TRANSLATION_M = 0.05
REGISTERED_M = 0.1
REGISTERED_DEG = 10.0
HIT_SHARES = (0.25, 0.5, 0.75)


@dataclass(frozen=True)
class InstanceScores:
    """Instances of one kind.

    Attributes:
        present: in both visits; matched: of those.
        registrable: matched ones whose true motion is known; registered: motion within ``REGISTERED_M``;
            rotation_right: rotation within ``REGISTERED_DEG``.
        present_with_motion: present ones whose true motion is known.
    """

    present: int = 0
    matched: int = 0
    registrable: int = 0
    registered: int = 0
    rotation_right: int = 0
    present_with_motion: int = 0

    def __add__(self, other: InstanceScores) -> InstanceScores:
        return InstanceScores(
            *(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True))
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; registration recall over matched and over all present instances."""
        return {
            **vars(self),
            "matching_recall": _share(self.matched, self.present),
            "registration_recall_of_matched": _share(self.registered, self.registrable),
            "registration_recall_of_present": _share(self.registered, self.present_with_motion),
            "rotation_recall_of_matched": _share(self.rotation_right, self.registrable),
        }


@dataclass(frozen=True)
class LivingScenesScores:
    """Static and dynamic instances of a pair of visits."""

    static: InstanceScores
    dynamic: InstanceScores

    @property
    def all(self) -> InstanceScores:
        """Both kinds."""
        return self.static + self.dynamic

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        recall = _share(self.all.matched, self.all.present)
        return {
            "all": self.all.to_dict(),
            "static": self.static.to_dict(),
            "dynamic": self.dynamic.to_dict(),
            "scene_hit": {f"{share:g}": None if recall is None else recall >= share for share in HIT_SHARES},
        }

    def lines(self) -> list[str]:
        """The table."""
        rows = [("instances", "present", "matched", "recall", "with motion", "registered", "recall")]
        for name, scores in (("all", self.all), ("static", self.static), ("dynamic", self.dynamic)):
            rows.append(
                (
                    name,
                    str(scores.present),
                    str(scores.matched),
                    number(_share(scores.matched, scores.present)),
                    str(scores.registrable),
                    str(scores.registered),
                    number(_share(scores.registered, scores.registrable)),
                )
            )
        return aligned(rows)


def livingscenes_scores(matched: Matched) -> LivingScenesScores:
    """Score the first pair of visits."""
    sessions = (0, 1)
    up_world = np.asarray(matched.result.sessions[0].up_world, dtype=np.float64)
    before, after = (true_labels(matched.units, session) for session in sessions)
    matches = kept_alone(matched.overlaps[0], matched.overlaps[1])
    static, dynamic = InstanceScores(), InstanceScores()
    for true_id, label in before.items():
        if label not in (ChangeLabel.STATIC, ChangeLabel.MOVED) or after.get(true_id) != label:
            continue
        motion = matched.truth.motions.get(true_id)
        if motion is None and label == ChangeLabel.STATIC:
            motion = Motion(np.eye(4))
        scores = _instance(matched, true_id, matches.get(true_id), motion, up_world)
        if motion is None or is_dynamic(motion, _centroid(matched, true_id, motion)):
            dynamic += scores
        else:
            static += scores
    return LivingScenesScores(static, dynamic)


def is_dynamic(motion: Motion, centroid_world: NDArray[np.float64]) -> bool:
    """Whether a true motion turns by more than 1 degree, or moves the centroid by more than 5 cm."""
    T = motion.T_world_motion
    shift = T[:3, :3] @ centroid_world + T[:3, 3] - centroid_world
    turn = np.degrees(rotation_angle_rad(np.eye(3), T[:3, :3]))
    return bool(turn > DYNAMIC_ROTATION_DEG or np.linalg.norm(shift) > DYNAMIC_TRANSLATION_M)


def _instance(
    matched: Matched,
    true_id: int,
    predicted_id: int | None,
    motion: Motion | None,
    up_world: NDArray[np.float64],
) -> InstanceScores:
    scores = InstanceScores(present=1, present_with_motion=int(motion is not None))
    if predicted_id is None:
        return scores
    if motion is None:
        return scores + InstanceScores(matched=1)
    T_predicted = _predicted(matched, predicted_id)
    T_true, order = motion.T_world_motion, motion.symmetry_order
    points = points_of_both_visits(matched.units, true_id, (0, 1), T_true)
    error_m = transform_error_m(T_predicted, T_true, points, up_world, order)
    turn = rotation_error_rad(T_predicted[:3, :3], T_true[:3, :3], up_world, order)
    return scores + InstanceScores(
        matched=1,
        registrable=1,
        registered=int(error_m < REGISTERED_M),
        rotation_right=int(np.degrees(turn) < REGISTERED_DEG),
    )


def _predicted(matched: Matched, predicted_id: int) -> NDArray[np.float64]:
    item = matched.objects[predicted_id]
    stays = item.T_world_motion is None and matched.labels[predicted_id] == ChangeLabel.STATIC
    seen_twice = item.sighting(0) is not None and item.sighting(1) is not None
    return np.eye(4) if stays or not seen_twice else predicted_motion(item, (0, 1))


def _centroid(matched: Matched, true_id: int, motion: Motion) -> NDArray[np.float64]:
    return true_centroid(matched.units, true_id, (0, 1), motion.T_world_motion)


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
