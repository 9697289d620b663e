"""A result against its ground truth: every metric over one set of evaluation units."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pipeline.evaluation.abstention import abstention_scores
from pipeline.evaluation.association import association_scores
from pipeline.evaluation.background import background_scores
from pipeline.evaluation.calibration import calibration_scores
from pipeline.evaluation.detection import all_detection_scores
from pipeline.evaluation.displacement import displacement_scores
from pipeline.evaluation.ground_truth import GroundTruth, read_ground_truth
from pipeline.evaluation.identity import identity_scores
from pipeline.evaluation.matched import Matched, match
from pipeline.evaluation.pointwise import pointwise_scores
from pipeline.evaluation.replaced import replaced_scores
from pipeline.evaluation.report import Report
from pipeline.evaluation.rotation import RotationScores, rotation_scores
from pipeline.evaluation.units import invented_labels
from pipeline.evaluation.verdicts import verdicts
from pipeline.ply import LabelledPoints
from pipeline.result import ChangeLabel, Result


def evaluate(
    result_path: Path | str,
    ground_truth: Path | str,
    radius_m: float | None = None,
    labels: Mapping[int, ChangeLabel] | None = None,
) -> Report:
    """Score the result in a folder against a ground-truth PLY (schema of ``pipeline.ply``).

    Args:
        result_path: the result folder.
        ground_truth: exact labels, objects and visits; label 255 = not scored. Motions are read from
            the JSON beside it, if there is one (see ``ground_truth``).
        radius_m: how far a map point may be from the ground truth it speaks for, metres; None = 0.1 m,
            or 1.5 times the spacing of the map's points where that is more.
        labels: labels to score in place of the machine's (inspectors' overrides), by object id; the
            confidence stays the machine's.

    Raises:
        ResultError: the result cannot be opened.
        InputError: the ground truth cannot be read, or speaks of a visit that the result lacks.
    """
    from pipeline.store import open_result

    return evaluate_result(open_result(Path(result_path)), read_ground_truth(ground_truth), radius_m, labels)


def evaluate_result(
    result: Result,
    truth: GroundTruth | LabelledPoints,
    radius_m: float | None = None,
    labels: Mapping[int, ChangeLabel] | None = None,
) -> Report:
    """Like :func:`evaluate`, for a result and a ground truth already in memory."""
    if isinstance(truth, LabelledPoints):
        truth = GroundTruth(truth)
    return report_of(match(result, truth, radius_m, labels))


def report_of(matched: Matched) -> Report:
    """Every metric of a matched result."""
    units, overlaps, motions = matched.units, matched.overlaps, matched.truth.motions
    identity, association, displacement, rotation = [], [], [], []
    for pair in matched.pairs:
        sides = (overlaps[pair[0]], overlaps[pair[1]])
        scores = identity_scores(units, *sides, pair, matched.labels)
        moved = scores[ChangeLabel.MOVED].pairs
        identity.append(scores)
        association.append(association_scores(units, *sides, pair, matched.labels))
        displacement.append(displacement_scores(units, moved, matched.objects, pair, motions))
        rotation.append(
            rotation_scores(moved, matched.objects, motions, matched.result.sessions[pair[0]].up_world)
            if motions
            else RotationScores(0, 0, 0, None, None, None)
        )
    found = verdicts(units, matched.result.objects, matched.labels)
    return Report(
        radius_m=matched.radius_m,
        overridden=matched.overridden,
        pointwise=pointwise_scores(units, invented_labels(units, matched.visits, matched.radius_m)),
        replaced=replaced_scores(units, matched.result.replaced),
        detection=all_detection_scores(overlaps, matched.predicted_counts),
        identity=tuple(identity),
        association=tuple(association),
        displacement=tuple(displacement),
        rotation=tuple(rotation),
        background=background_scores(units, matched.visits),
        verdicts=found,
        calibration=calibration_scores(found),
        abstention=abstention_scores(found),
    )
