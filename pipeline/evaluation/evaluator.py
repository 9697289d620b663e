"""A result against its ground truth: every metric over one set of evaluation units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pipeline.errors import InputError
from pipeline.evaluation.detection import THRESHOLDS, detection_scores
from pipeline.evaluation.displacement import displacement_scores
from pipeline.evaluation.identity import identity_scores
from pipeline.evaluation.overlap import object_overlap
from pipeline.evaluation.pointwise import pointwise_scores
from pipeline.evaluation.replaced import replaced_scores
from pipeline.evaluation.report import Report
from pipeline.evaluation.units import invented_labels, match_radius_m, match_units, predicted_points
from pipeline.ply import LabelledPoints, read_ply
from pipeline.result import ChangeLabel, Result


def evaluate(
    result_path: Path | str,
    ground_truth_ply: Path | str,
    radius_m: float | None = None,
    labels: Mapping[int, ChangeLabel] | None = None,
) -> Report:
    """Score the result in a folder against a ground-truth PLY (schema of ``pipeline.ply``).

    Args:
        result_path: the result folder.
        ground_truth_ply: exact labels, objects and visits; label 255 = not scored.
        radius_m: how far a map point may be from the ground truth it speaks for, metres; None = 0.1 m,
            or 1.5 times the spacing of the map's points where that is more.
        labels: labels to score in place of the machine's (inspectors' overrides), by object id.

    Raises:
        ResultError: the result cannot be opened.
        InputError: the ground truth cannot be read, or speaks of a visit that the result lacks.
    """
    from pipeline.store import open_result

    return evaluate_result(open_result(Path(result_path)), read_ply(Path(ground_truth_ply)), radius_m, labels)


def evaluate_result(
    result: Result,
    truth: LabelledPoints,
    radius_m: float | None = None,
    labels: Mapping[int, ChangeLabel] | None = None,
) -> Report:
    """Like :func:`evaluate`, for a result and a ground truth already in memory."""
    if radius_m is not None and not (math.isfinite(radius_m) and radius_m > 0):
        raise InputError(f"a match radius of {radius_m} m is impossible", "give a length above 0, in metres")
    visits = predicted_points(result, labels)
    radius = match_radius_m(visits) if radius_m is None else radius_m
    units = match_units(truth, visits, radius)

    objects = {item.object_id: item for item in result.objects}
    predicted_labels = {object_id: item.label for object_id, item in objects.items()} | dict(labels or {})
    overlaps = [object_overlap(units, session) for session in range(len(visits))]
    detection = []
    for session, (visit, overlap) in enumerate(zip(visits, overlaps, strict=True)):
        predicted_count = int(np.count_nonzero(np.unique(visit.object_id)))
        detection += [
            detection_scores(overlap, session, threshold, predicted_count) for threshold in THRESHOLDS
        ]
    identity, displacement = [], []
    for pair in zip(range(len(visits)), range(1, len(visits)), strict=False):
        scores = identity_scores(units, overlaps[pair[0]], overlaps[pair[1]], pair, predicted_labels)
        identity.append(scores)
        displacement.append(displacement_scores(units, scores[ChangeLabel.MOVED].pairs, objects, pair))
    return Report(
        radius_m=radius,
        overridden=bool(labels),
        pointwise=pointwise_scores(units, invented_labels(units, visits, radius)),
        replaced=replaced_scores(units, result.replaced),
        detection=tuple(detection),
        identity=tuple(identity),
        displacement=tuple(displacement),
    )
