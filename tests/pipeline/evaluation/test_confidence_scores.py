from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.evaluation import evaluate_result
from pipeline.evaluation.abstention import abstention_curve, abstention_scores, area_under_risk_coverage
from pipeline.evaluation.calibration import calibration_scores, errors_in_least_certain
from pipeline.evaluation.summary import Summary
from pipeline.evaluation.verdicts import Verdicts
from pipeline.result import ChangeLabel

UNKNOWN, STATIC, APPEARED, DISAPPEARED, MOVED = ChangeLabel


def decided(*pairs: tuple[float, int]) -> Verdicts:
    confidence, right = zip(*pairs, strict=True)
    return Verdicts(np.array(confidence, float), np.array(right, bool), np.ones(len(pairs), bool), unknown=1)


def test_calibration_by_hand() -> None:
    # Bins of 1/15: 0.95 and 1.0 share the last one, 0.5 is in the eighth.
    scores = calibration_scores(decided((0.95, 1), (1.0, 1), (0.95, 0), (0.5, 1)))
    assert [(item.count, round(item.low, 3)) for item in scores.bins] == [(1, 0.467), (3, 0.933)]
    assert scores.ece == pytest.approx((1 * 0.5 + 3 * abs(2 / 3 - 2.9 / 3)) / 4)
    assert scores.brier == pytest.approx((0.05**2 + 0 + 0.95**2 + 0.25) / 4)
    assert (scores.objects, scores.errors) == (4, 1)
    assert calibration_scores(decided((1.0, 1))).ece == 0
    empty = calibration_scores(Verdicts(np.zeros(0), np.zeros(0, bool), np.zeros(0, bool)))
    assert empty.ece is empty.brier is empty.errors_in_least_certain is None


def test_errors_of_the_least_certain_by_hand() -> None:
    clear = decided((0.1, 0), *[(0.5 + i / 100, i != 3) for i in range(9)])
    assert errors_in_least_certain(clear, 0.2) == pytest.approx(0.5)  # one of two errors in two objects
    tied = decided(*[(0.5, i > 3) for i in range(10)])  # all alike: a fifth of the errors, in expectation
    assert errors_in_least_certain(tied, 0.2) == pytest.approx(0.2)
    partly = decided((0.1, 0), (0.5, 0), (0.5, 1), *[(0.9, 1)] * 7)  # the second is one of two alike
    assert errors_in_least_certain(partly, 0.2) == pytest.approx((1 + 0.5) / 2)
    assert errors_in_least_certain(decided((0.1, 1)), 0.2) is None


def test_abstention_by_hand() -> None:
    found = decided((0.9, 1), (0.8, 0), (0.8, 1), (0.2, 0))
    points = [(p.coverage, p.precision, p.least_confidence) for p in abstention_curve(found)]
    assert points == [(0.25, 1.0, 0.9), (0.75, pytest.approx(2 / 3), 0.8), (1.0, 0.5, 0.2)]
    # Errors among the first 1, 2, 3, 4: 0, 1/2 (tie), 1, 2.
    assert area_under_risk_coverage(found) == pytest.approx((0 + 0.25 + 1 / 3 + 0.5) / 4)
    scores = abstention_scores(found)
    assert (scores.unknown, scores.unknown_rate) == (1, 0.2)
    assert scores.precision_at(0.5) == pytest.approx(2 / 3)
    assert scores.precision_at(0.25) == 1.0


@given(st.lists(st.tuples(st.floats(0, 1), st.booleans()), min_size=1, max_size=40))
def test_confidence_scores_stay_in_range(pairs: list[tuple[float, bool]]) -> None:
    found = decided(*pairs)
    scores, area = calibration_scores(found), area_under_risk_coverage(found)
    assert 0 <= scores.ece <= 1 and 0 <= scores.brier <= 1 and 0 <= area <= 1
    assert sum(item.count for item in scores.bins) == len(pairs)
    curve = abstention_curve(found)
    assert curve[-1].coverage == 1 and curve[-1].precision == pytest.approx(np.mean(found.is_right))
    if scores.errors:
        assert errors_in_least_certain(found, 1.0) == pytest.approx(1)


def line(session: int, start: int, count: int, *rest: int) -> list[tuple]:
    return [(session, start + i, *rest) for i in range(count)]


@pytest.fixture
def report(build):
    truth = build.truth(
        line(1, 0, 3, APPEARED, 1)
        + line(1, 3, 2, STATIC, 0)
        + line(1, 10, 2, APPEARED, 2)
        + line(1, 12, 3, STATIC, 0)
        + line(1, 20, 3, MOVED, 3)
        + line(1, 30, 3, 255, 4)
    )
    result = build.result(
        line(1, 0, 5, 11)  # appeared, and 3 of 5 units did: right
        + line(1, 10, 5, 12)  # appeared, but 3 of 5 units are static background: wrong
        + line(1, 20, 3, 13)  # unknown, truly moved
        + line(1, 30, 3, 14)  # only where nothing is scored
        + line(1, 40, 3, 15),  # far from all ground truth
        {11: APPEARED, 12: APPEARED, 13: UNKNOWN, 14: APPEARED, 15: STATIC},
    )
    result.objects = tuple(
        dataclasses.replace(item, confidence=0.8 if item.object_id == 11 else 0.6) for item in result.objects
    )
    return evaluate_result(result, truth, radius_m=0.1)


def test_objects_are_judged_by_the_majority_of_their_units(report) -> None:
    assert report.verdicts.confidence.tolist() == [0.8, 0.6]
    assert report.verdicts.is_right.tolist() == [True, False]
    abstention = report.abstention
    assert (abstention.unknown, abstention.unknown_changed, abstention.unmatched) == (1, 1, 2)
    assert abstention.unknown_rate == pytest.approx(1 / 3)
    assert report.calibration.ece == pytest.approx((0.2 + 0.6) / 2)
    assert "ECE 0.400" in report.table()


def test_summary_pools_the_objects_of_all_pairs(report) -> None:
    pooled = Summary({"a": report, "b": report})
    assert pooled.calibration().objects == 4
    assert pooled.calibration().ece == pytest.approx(0.4)
    assert pooled.abstention().unknown == 2
    assert pooled.to_dict()["calibration"]["bins_of_equal_width"] == 15
