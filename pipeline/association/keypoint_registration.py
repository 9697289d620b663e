"""Which objects of two visits carry the same print, and the rigid motion that their keypoints agree on.

What all cartons of a kind or all cars of a model show, such as a barcode or a wheel, tells none of them
apart. So a pair of keypoints counts as far as it is more alike than either of them is to any other object of
its own visit (the ratio test of Lowe, 2004, against the place instead of the image). Every pair proposes the
motion that carries one keypoint's frame onto the other's; motions are ranked by the distinct places that
agree, and the best are fitted to all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.association.object_keypoints import ObjectKeypoints, no_keypoints
from pipeline.association.object_registration import best_motions
from pipeline.camera import rotation_angle_rad, transform_points

_LEAST_SIMILARITY = 0.8
_SIZE_RATIO = 1.6
# Where a rival is alike to the last bit, rounding must not decide.
_LEAST_MARGIN = 0.01
# Two keypoints are at one place within so many spacings of the cloud, and their axes within 37 degrees.
_REACH_SPACINGS = 2.5
_SAME_AXIS = 0.8
# Keypoints within a cell of so many spacings are one place: several views see each.
_PLACE_SPACINGS = 2.0
# The direction of a keypoint errs by some degrees: the farther another one, the farther off it lands.
_LEVER_SLACK = 0.1
_HYPOTHESES = 150
_FITTED = 8
_ROUNDS = 3
_AXES_WEIGHT = 0.3
# Fewer pairs, or a smaller sum of their weights, are not worth a look.
_LEAST_PAIRS = 3
_LEAST_WEIGHT = 0.6


@dataclass(frozen=True)
class KeypointRegistration:
    """What the keypoints of two objects agree on.

    Attributes:
        T_world_motion: (4, 4), p_current = T p_previous, world frame.
        displacement_m: how far it carries the places that agree, on average.
        support: distinct places that agree, each weighted in [0, 1] by how far its likeness stands out.
    """

    T_world_motion: NDArray[np.float64]
    displacement_m: float
    support: float

    def is_still(self, tau_d_m: float, max_rotation_deg: float) -> bool:
        """Whether the object stayed where and as it was."""
        turn_deg = np.degrees(rotation_angle_rad(np.eye(3), self.T_world_motion[:3, :3]))
        return self.displacement_m <= tau_d_m and float(turn_deg) <= max_rotation_deg


def register_by_keypoints(
    previous: Sequence[ObjectKeypoints], current: Sequence[ObjectKeypoints], spacing_m: float
) -> dict[tuple[int, int], KeypointRegistration]:
    """Lay objects over each other by their keypoints.

    Args:
        previous, current: all objects of either visit; the more, the better is known what is common.
        spacing_m: distance of neighbouring points of the objects' clouds.

    Returns:
        By the positions of a previous and a current object; pairs without agreement are left out.
    """
    all0, all1 = _Pool(previous), _Pool(current)
    if not all0.count or not all1.count:
        return {}
    rival0, rival1 = all0.rival_similarities(), all1.rival_similarities()
    found = {}
    for position, keypoints in enumerate(previous):
        if not len(keypoints):
            continue
        similarity = all1.similarity_to(keypoints)
        rival = np.maximum(rival0[all0.owner == position][:, None], rival1[None])
        row, column = np.nonzero(similarity > rival)
        margin = np.maximum(1 - rival[row, column], _LEAST_MARGIN)
        weight = (similarity[row, column] - rival[row, column]) / margin
        owner = all1.owner[column]
        for other in np.unique(owner):
            mine = owner == other
            if int(mine.sum()) < _LEAST_PAIRS or weight[mine].sum() < _LEAST_WEIGHT:
                continue
            own_column = column[mine] - all1.first[other]
            pairs = _Pairs.of(keypoints, current[other], row[mine], own_column, weight[mine], spacing_m)
            registration = pairs.register()
            if registration is not None:
                found[position, int(other)] = registration
    return found


def print_places(keypoints: ObjectKeypoints, spacing_m: float) -> NDArray[np.float64]:
    """(p, 3) where an object has keypoints, metres; those within a place are one."""
    if not len(keypoints):
        return np.zeros((0, 3))
    place = _place(keypoints.points_world, _PLACE_SPACINGS * spacing_m)
    sums = np.stack([np.bincount(place, keypoints.points_world[:, axis]) for axis in range(3)], axis=1)
    return sums / np.bincount(place)[:, None]


class _Pool:
    """The keypoints of all objects of a visit, one after the other."""

    def __init__(self, objects: Sequence[ObjectKeypoints]) -> None:
        counts = [len(keypoints) for keypoints in objects]
        self._objects = objects
        self.owner = np.repeat(np.arange(len(objects)), counts)
        self.first = np.cumsum([0, *counts])
        self.count = int(self.first[-1])
        everything = [no_keypoints(), *objects]
        self._descriptors = np.concatenate([keypoints.descriptors for keypoints in everything])
        self._log_sizes = np.log(np.concatenate([keypoints.sizes_m for keypoints in everything]))
        self._log_sizes = self._log_sizes.astype(np.float32)

    def similarity_to(self, keypoints: ObjectKeypoints) -> NDArray[np.float32]:
        """(n, count) cosine of the descriptors, 0 between keypoints of other sizes."""
        similarity = keypoints.descriptors @ self._descriptors.T
        ratio = np.log(keypoints.sizes_m).astype(np.float32)[:, None] - self._log_sizes[None]
        similarity[np.abs(ratio, out=ratio) > np.log(_SIZE_RATIO)] = 0
        return similarity

    def rival_similarities(self) -> NDArray[np.float32]:
        """(count,) likeness of every keypoint to the likest one of another object, never below the least."""
        rivals = np.full(self.count, _LEAST_SIMILARITY, np.float32)
        for position, keypoints in enumerate(self._objects):
            own = slice(self.first[position], self.first[position + 1])
            if len(keypoints):
                similarity = self.similarity_to(keypoints)
                similarity[:, own] = 0
                rivals[own] = np.maximum(rivals[own], similarity.max(axis=1))
        return rivals


@dataclass(frozen=True)
class _Pairs:
    """Like keypoints of two objects, n of them; ``spacing_m`` as in ``register_by_keypoints``."""

    points0: NDArray[np.float64]
    points1: NDArray[np.float64]
    axes0: NDArray[np.float64]
    axes1: NDArray[np.float64]
    place0: NDArray[np.int64]
    place1: NDArray[np.int64]
    weight: NDArray[np.float64]
    spacing_m: float

    @classmethod
    def of(
        cls,
        previous: ObjectKeypoints,
        current: ObjectKeypoints,
        row: NDArray[np.integer],
        column: NDArray[np.integer],
        weight: NDArray[np.floating],
        spacing_m: float,
    ) -> _Pairs:
        order = np.argsort(-weight, kind="stable")
        row, column = row[order], column[order]
        points0, points1 = previous.points_world[row], current.points_world[column]
        return cls(
            points0,
            points1,
            previous.R_world_keypoint[row],
            current.R_world_keypoint[column],
            _place(points0, _PLACE_SPACINGS * spacing_m),
            _place(points1, _PLACE_SPACINGS * spacing_m),
            weight[order].astype(np.float64),
            spacing_m,
        )

    def register(self) -> KeypointRegistration | None:
        """The motion of the greatest support."""
        top = slice(0, _HYPOTHESES)
        rotations = self.axes1[top] @ self.axes0[top].transpose(0, 2, 1)
        translations = self.points1[top] - (rotations @ self.points0[top][..., None])[..., 0]
        lever = np.linalg.norm(self.points0[None] - self.points0[top][:, None], axis=2)
        agreeing = self._agreeing(rotations, translations, _LEVER_SLACK * lever)
        support = np.array([self._support(pairs) for pairs in agreeing])
        best: KeypointRegistration | None = None
        for number in np.argsort(-support, kind="stable")[:_FITTED]:
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = rotations[number], translations[number]
            agrees = agreeing[number]
            for _ in range(_ROUNDS):
                if agrees.any():
                    T = self._fitted(agrees)
                    agrees = self._agreeing(T[None, :3, :3], T[None, :3, 3], 0.0)[0]
            fitted = self._support(agrees)
            if fitted > (best.support if best is not None else 0.0):
                shift = transform_points(T, self.points0[agrees]) - self.points0[agrees]
                displacement_m = float(np.linalg.norm(shift.mean(axis=0)))
                best = KeypointRegistration(T, displacement_m, fitted)
        return best

    def _agreeing(
        self,
        rotations: NDArray[np.float64],
        translations: NDArray[np.float64],
        slack_m: NDArray[np.float64] | float,
    ) -> NDArray[np.bool_]:
        """(h, n) which pairs of keypoints each of h motions carries onto each other."""
        turns = rotations.transpose(0, 2, 1)
        moved = self.points0 @ turns + translations[:, None]
        reach_m = _REACH_SPACINGS * self.spacing_m + slack_m
        agrees = np.linalg.norm(moved - self.points1, axis=2) < reach_m
        for axis in (0, 2):
            cosine = ((self.axes0[:, :, axis] @ turns) * self.axes1[:, :, axis]).sum(axis=2)
            agrees &= cosine > _SAME_AXIS
        return agrees

    def _support(self, agrees: NDArray[np.bool_]) -> float:
        """Every place counts once, with its likest pair; of the two objects, the one with less of it."""
        weight = np.where(agrees, self.weight, 0)
        sums = []
        for place in (self.place0, self.place1):
            likest = np.zeros(int(place.max()) + 1)
            np.maximum.at(likest, place, weight)
            sums.append(float(likest.sum()))
        return min(sums)

    def _fitted(self, agrees: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(4, 4) least-squares motion of the pairs' points and axes."""
        arm_m = 2 * _REACH_SPACINGS * self.spacing_m
        before, after = (
            np.concatenate([points, points + arm_m * axes[:, :, 0], points + arm_m * axes[:, :, 2]])
            for points, axes in (
                (self.points0[agrees], self.axes0[agrees]),
                (self.points1[agrees], self.axes1[agrees]),
            )
        )
        weight = np.outer([1, _AXES_WEIGHT, _AXES_WEIGHT], self.weight[agrees] + 1e-3).ravel()
        rotations, translations = best_motions(before[None], after[None], weight[None], None)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotations[0], translations[0]
        return T


def _place(points: NDArray[np.float64], cell_m: float) -> NDArray[np.int64]:
    """(n,) number of the cell that each point lies in."""
    cells = np.floor(points / cell_m).astype(np.int64)
    return np.unique(cells, axis=0, return_inverse=True)[1].ravel()
