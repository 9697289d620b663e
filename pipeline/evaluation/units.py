"""Evaluation units: what is counted, and what the result says at each of them.

A unit is one occupied voxel of the ground truth, per visit, object and label: points of the ground truth
are binned at ``UNIT_SIZE_M`` so that a densely sampled surface does not outvote a sparse one. It stands at
the mean of its points. The prediction at a unit is that of the nearest map point of the same visit
within the match radius; without one the unit is *missed*.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.errors import InputError
from pipeline.ply import NOT_SCORED, LabelledPoints
from pipeline.result import ChangeLabel, Result

UNIT_SIZE_M = 0.05
MATCH_RADIUS_M = 0.1
# A map sampled coarser than this share of the radius would miss surfaces that it does hold.
RADIUS_PER_SPACING = 1.5
MISSED = 254  # predicted label of a unit without any map point in reach
SCORED_LABELS = (ChangeLabel.STATIC, ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED, ChangeLabel.MOVED)

_SPACING_SAMPLE = 20_000


@dataclass(frozen=True)
class Units:
    """Voxels of the ground truth with what is true and what was predicted there.

    Attributes:
        points_world: (N, 3) float64 metres.
        session: (N,) visit.
        true_label: (N,) ``ChangeLabel`` code, or ``NOT_SCORED``.
        true_object: (N,) object of the ground truth, 0 = background.
        predicted_label: (N,) ``ChangeLabel`` code, or ``MISSED``.
        predicted_object: (N,) object of the result, 0 = background or missed.
    """

    points_world: NDArray[np.float64]
    session: NDArray[np.int64]
    true_label: NDArray[np.int64]
    true_object: NDArray[np.int64]
    predicted_label: NDArray[np.int64]
    predicted_object: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.session)

    @property
    def scored(self) -> NDArray[np.bool_]:
        """(N,) units with one of the four labels that are scored; 255 and 0 (unknowable) are not."""
        return np.isin(self.true_label, SCORED_LABELS)


@dataclass(frozen=True)
class MapPoints:
    """The points of one visit of a result with the labels that are evaluated.

    Attributes:
        points_world: (N, 3) metres. label: (N,) ``ChangeLabel`` codes. object_id: (N,), 0 = background.
    """

    points_world: NDArray[np.float32]
    label: NDArray[np.int64]
    object_id: NDArray[np.int64]


def predicted_points(
    result: Result, labels: Mapping[int, ChangeLabel] | None = None
) -> tuple[MapPoints, ...]:
    """Labelled map points of every visit; ``labels`` replaces the machine's label of those objects."""
    final = {item.object_id: int(item.label) for item in result.objects}
    final.update({object_id: int(label) for object_id, label in (labels or {}).items()})
    size = max(final, default=0) + 1
    for session in result.sessions:
        size = max(size, int(np.max(session.object_ids, initial=0)) + 1)
    label_of_object = np.full(size, int(ChangeLabel.STATIC), dtype=np.int64)
    for object_id, label in final.items():
        label_of_object[object_id] = label
    return tuple(
        MapPoints(
            np.asarray(session.points_world),
            label_of_object[np.asarray(session.object_ids)],
            np.asarray(session.object_ids, dtype=np.int64),
        )
        for session in result.sessions
    )


def match_radius_m(visits: tuple[MapPoints, ...]) -> float:
    """Default match radius: 0.1 m, or 1.5 times the spacing of the coarser map if that is more.

    The spacing is the median distance from a map point to its nearest neighbour.
    """
    spacings = []
    for visit in visits:
        if len(visit.points_world) < 2:
            continue
        step = max(1, len(visit.points_world) // _SPACING_SAMPLE)
        tree = cKDTree(visit.points_world)
        distances, _ = tree.query(visit.points_world[::step], k=2)
        spacings.append(float(np.median(distances[:, 1])))
    return max([MATCH_RADIUS_M, *(RADIUS_PER_SPACING * spacing for spacing in spacings)])


def match_units(truth: LabelledPoints, visits: tuple[MapPoints, ...], radius_m: float) -> Units:
    """Bin the ground truth into units and look up the prediction at each.

    Raises:
        InputError: the ground truth is empty, holds unknown codes, or a visit that the result lacks.
    """
    _check(truth, len(visits))
    points, session, label, object_id = _bin(truth)
    predicted_label = np.full(len(session), MISSED, dtype=np.int64)
    predicted_object = np.zeros(len(session), dtype=np.int64)
    for index, visit in enumerate(visits):
        chosen = np.flatnonzero(session == index)
        if len(chosen) == 0 or len(visit.points_world) == 0:
            continue
        distance, nearest = cKDTree(visit.points_world).query(points[chosen], distance_upper_bound=radius_m)
        hit = np.isfinite(distance)
        predicted_label[chosen[hit]] = visit.label[nearest[hit]]
        predicted_object[chosen[hit]] = visit.object_id[nearest[hit]]
    return Units(points, session, label, object_id, predicted_label, predicted_object)


def invented_labels(units: Units, visits: tuple[MapPoints, ...], radius_m: float) -> NDArray[np.int64]:
    """Labels of predicted voxels that have no ground truth (scored or not) of their visit in reach.

    Map points are binned at ``UNIT_SIZE_M`` like the ground truth; returns one label code per voxel.
    """
    found = []
    for index, visit in enumerate(visits):
        if len(visit.points_world) == 0:
            continue
        points, (label,) = voxel_means(visit.points_world, [visit.label])
        truth = units.points_world[units.session == index]
        if len(truth):
            distance, _ = cKDTree(truth).query(points, distance_upper_bound=radius_m)
            label = label[~np.isfinite(distance)]
        found.append(label)
    return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)


def _check(truth: LabelledPoints, session_count: int) -> None:
    if len(truth) == 0:
        raise InputError("the ground truth holds no points", "generate it again")
    if not np.isfinite(truth.points_world).all():
        raise InputError("the ground truth holds points that are not finite", "generate it again")
    codes = set(np.unique(truth.label).tolist())
    if strange := codes - {int(label) for label in ChangeLabel} - {NOT_SCORED}:
        raise InputError(f"the ground truth holds the unknown label {min(strange)}", "labels are 0-4 and 255")
    if int(truth.object_id.min()) < 0:
        raise InputError("the ground truth holds a negative object_id", "background is 0, objects 1, 2, ...")
    last = int(truth.session.max())
    if last >= session_count:
        raise InputError(
            f"the ground truth speaks of visit {last}, the result has {session_count} visits (from 0)",
            "evaluate a result with the ground truth of the same recordings",
        )


def _bin(
    truth: LabelledPoints,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    points, (session, label, object_id) = voxel_means(
        truth.points_world, [truth.session, truth.label, truth.object_id]
    )
    return points, session, label, object_id


def voxel_means(
    points_world: NDArray[np.floating], keys: list[NDArray]
) -> tuple[NDArray[np.float64], list[NDArray[np.int64]]]:
    """Mean position of the points that share a voxel and every key, and those keys."""
    cells = np.floor(np.asarray(points_world, dtype=np.float64) / UNIT_SIZE_M).astype(np.int64)
    rows = [*keys, *cells.T]
    order = np.lexsort(rows)
    ordered = [np.asarray(row)[order] for row in rows]
    first = np.zeros(len(order), dtype=bool)
    first[0] = True
    for row in ordered:
        first[1:] |= row[1:] != row[:-1]
    starts = np.flatnonzero(first)
    sizes = np.diff(np.append(starts, len(order)))
    sums = np.add.reduceat(np.asarray(points_world, dtype=np.float64)[order], starts, axis=0)
    return sums / sizes[:, None], [row[starts].astype(np.int64) for row in ordered[: len(keys)]]
