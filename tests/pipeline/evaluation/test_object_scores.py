from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.evaluation import evaluate_result
from pipeline.evaluation.counts import Counts
from pipeline.evaluation.replaced import true_replaced_pairs
from pipeline.evaluation.units import match_units, predicted_points
from pipeline.ply import LabelledPoints
from pipeline.result import ChangeLabel, ReplacedEvent

UNKNOWN, STATIC, APPEARED, DISAPPEARED, MOVED = ChangeLabel


def line(session: int, start: int, count: int, *rest: int) -> list[tuple]:
    return [(session, start + i, *rest) for i in range(count)]


def test_detection_counted_by_hand(build) -> None:
    truth = build.truth(
        line(0, 0, 4, STATIC, 1)  # found by 11: 3 shared of 4 + 3 - 3 -> 0.75
        + line(0, 10, 4, STATIC, 2)  # found by 12: 2 shared of 4 + 4 - 2 -> 1/3
        + line(0, 14, 2, STATIC, 0)  # background that 12 spills on
        + line(0, 20, 4, STATIC, 3)  # nobody
    )
    result = build.result(
        line(0, 0, 3, 11)
        + line(0, 3, 1, 0)
        + line(0, 10, 2, 0)
        + line(0, 12, 4, 12)
        + line(0, 40, 5, 13),  # far from all ground truth
        {11: STATIC, 12: STATIC, 13: STATIC},
    )
    report = evaluate_result(result, truth, radius_m=0.1)
    low, high = report.detection[:2]
    assert (low.session, low.threshold, low.counts) == (0, 0.25, Counts(tp=2, fp=1, fn=1))
    assert low.mean_iou == pytest.approx((0.75 + 1 / 3) / 2)
    assert (high.threshold, high.counts, high.mean_iou) == (0.5, Counts(tp=1, fp=2, fn=2), 0.75)
    assert [scores.counts for scores in report.detection[2:]] == [Counts(), Counts()]  # visit 1 is empty


def test_detection_is_one_to_one(build) -> None:
    truth = build.truth(line(0, 0, 6, STATIC, 1))
    result = build.result(line(0, 0, 3, 11) + line(0, 3, 3, 12), {11: STATIC, 12: STATIC})
    assert evaluate_result(result, truth, radius_m=0.1).detection[0].counts == Counts(tp=1, fp=1, fn=0)


def test_detection_counts_unscored_objects_too(build) -> None:
    truth = build.truth(line(0, 0, 3, 255, 1))
    result = build.result(line(0, 0, 3, 11), {11: UNKNOWN})
    assert evaluate_result(result, truth, radius_m=0.1).detection[1].counts == Counts(tp=1)


def test_identity_and_displacement_counted_by_hand(build) -> None:
    truth = build.truth(
        line(0, 0, 4, STATIC, 1)
        + line(1, 0, 4, STATIC, 1)  # keeps its id 11
        + line(0, 10, 4, STATIC, 2)
        + line(1, 10, 4, STATIC, 2)  # 12, then 13: identity lost
        + line(0, 20, 4, MOVED, 3)
        + line(1, 30, 4, MOVED, 3)  # 14 in both, 10 m
        + line(0, 40, 4, MOVED, 4)  # never found again
        + line(1, 50, 4, MOVED, 4)
        + line(0, 60, 4, DISAPPEARED, 5)  # no identity to keep
        + line(0, 70, 4, STATIC, 0)
        + line(1, 70, 4, STATIC, 0)
    )
    result = build.result(
        line(0, 0, 4, 11)
        + line(1, 0, 4, 11)
        + line(0, 10, 4, 12)
        + line(1, 10, 4, 13)
        + line(0, 20, 3, 14)  # sees only the left end: centroid 0.5 m off
        + line(1, 30, 4, 14)
        + line(0, 60, 4, 15)  # 15 claims to be object 5, then object 4
        + line(1, 50, 4, 15)
        + line(0, 70, 4, 16)  # an object made of background in both visits: no claim
        + line(1, 70, 4, 16),
        {11: STATIC, 12: DISAPPEARED, 13: APPEARED, 14: MOVED, 15: MOVED, 16: STATIC},
    )
    report = evaluate_result(result, truth, radius_m=0.1)
    static, moved = report.identity[0][STATIC], report.identity[0][MOVED]
    assert (static.kept, static.present, static.right, static.claimed) == (1, 2, 1, 1)
    assert (moved.kept, moved.present, moved.right, moved.claimed) == (1, 2, 1, 2)
    assert (moved.recall, moved.precision) == (0.5, 0.5)
    displacement = report.displacement[0]
    assert displacement.compared == 1
    assert displacement.mean_error_m == pytest.approx(0.5, abs=1e-5)
    assert displacement.mean_vector_error_m == pytest.approx(0.5, abs=1e-5)
    assert "moved, visit 0 to 1" in report.table()


def test_a_sliver_is_not_a_majority(build) -> None:
    truth = build.truth(line(0, 0, 5, STATIC, 1) + line(1, 0, 5, STATIC, 1))
    result = build.result(
        line(0, 0, 1, 11) + line(0, 1, 4, 0) + line(1, 0, 5, 11),  # a fifth of it in the first visit
        {11: STATIC},
    )
    assert evaluate_result(result, truth, radius_m=0.1).identity[0][STATIC].kept == 0


def test_replaced_pairs_come_from_overlapping_bounds(build) -> None:
    truth = build.truth(
        line(0, 0, 5, DISAPPEARED, 1)
        + line(1, 1, 5, APPEARED, 2)  # shares 3 of 4 m
        + line(0, 20, 5, DISAPPEARED, 3)
        + line(1, 24, 5, APPEARED, 4)  # touches only
        + line(0, 40, 5, MOVED, 5)
        + line(1, 40, 5, APPEARED, 6)  # what stands there now was not replaced: the other one moved
    )
    units = match_units(truth, predicted_points(build.result([])), 0.1)
    assert true_replaced_pairs(units) == ((1, 2),)


def test_replaced_classes_counted_by_hand(build) -> None:
    truth = build.truth(
        line(0, 0, 4, DISAPPEARED, 1)
        + line(1, 0, 4, APPEARED, 2)  # replaced pair
        + line(0, 10, 2, DISAPPEARED, 3)  # plain
        + line(1, 20, 3, STATIC, 0)
        + line(1, 30, 1, 255, 0)
    )
    result = build.result(
        line(0, 0, 4, 11)
        + line(1, 0, 3, 12)
        + line(1, 3, 1, 13)  # appeared, but outside the event
        + line(0, 10, 2, 14)
        + line(1, 20, 1, 15)
        + line(1, 21, 2, 0)
        + line(1, 30, 1, 12),
        {11: DISAPPEARED, 12: APPEARED, 13: APPEARED, 14: DISAPPEARED, 15: APPEARED},
        [ReplacedEvent(11, 12, 0.9), ReplacedEvent(14, 15, 0.4)],
    )
    scores = evaluate_result(result, truth, radius_m=0.1).replaced
    # 14 and 15 are called replaced, wrongly: 2 plain disappeared and 1 static unit.
    assert scores.replaced == Counts(tp=7, fp=3, fn=1)
    assert scores.appeared_disappeared == Counts(tp=0, fp=1, fn=2)
    assert scores.static == Counts(tp=2, fp=0, fn=1)
    assert scores.moved == Counts()
    assert scores.events == Counts(tp=1, fp=1, fn=0)


def test_half_a_million_points_agree_with_themselves() -> None:
    generator = np.random.default_rng(0)
    count = 500_000
    points = np.concatenate(
        [generator.uniform(0, 20, (count, 2)), generator.normal(0, 0.01, (count, 1))], axis=1
    ).astype(np.float32)
    session = (np.arange(count) % 2).astype(np.uint8)
    object_id = (points[:, 0] // 2).astype(np.int32)  # stripes 0..9
    truth = LabelledPoints(
        points,
        np.zeros((count, 3), np.uint8),
        session,
        np.ones(count, np.uint8),
        object_id,
        np.ones(count, "f4"),
    )

    sessions = tuple(
        SimpleNamespace(points_world=points[session == s], object_ids=object_id[session == s]) for s in (0, 1)
    )
    report = evaluate_result(SimpleNamespace(sessions=sessions, objects=(), replaced=()), truth)
    assert report.pointwise.micro.f1 == 1.0
    assert report.detection[1].counts.f1 == 1.0
