from __future__ import annotations

import pytest

from pipeline.evaluation import evaluate_result
from pipeline.evaluation.association import AssociationScores
from pipeline.result import ChangeLabel

UNKNOWN, STATIC, APPEARED, DISAPPEARED, MOVED = ChangeLabel


def line(session: int, start: int, count: int, *rest: int) -> list[tuple]:
    return [(session, start + i, *rest) for i in range(count)]


@pytest.fixture
def report(build):
    truth = build.truth(
        line(0, 0, 4, STATIC, 1)
        + line(1, 0, 4, STATIC, 1)  # 11 in both, static: found
        + line(0, 10, 4, STATIC, 2)
        + line(1, 10, 4, STATIC, 2)  # 12 in both, but it is mostly object 3
        + line(0, 14, 5, STATIC, 3)
        + line(1, 14, 5, STATIC, 3)  # 12 in both: found
        + line(0, 20, 4, STATIC, 4)
        + line(1, 20, 4, STATIC, 4)  # 14 in both, but called moved
        + line(0, 30, 4, DISAPPEARED, 5)  # 15, disappeared: found
        + line(0, 40, 4, DISAPPEARED, 6)  # 16, unknown
        + line(0, 50, 4, MOVED, 7)
        + line(1, 60, 4, MOVED, 7)  # 17 in both, moved: found
        + line(0, 70, 4, STATIC, 0)
        + line(1, 70, 4, STATIC, 0)  # 18 is background, called disappeared
        + line(0, 80, 2, 255, 0)
    )
    result = build.result(
        line(0, 0, 4, 11)
        + line(1, 0, 4, 11)
        + line(0, 10, 9, 12)
        + line(1, 10, 9, 12)
        + line(0, 20, 4, 14)
        + line(1, 20, 4, 14)
        + line(0, 30, 4, 15)
        + line(0, 40, 4, 16)
        + line(0, 50, 4, 17)
        + line(1, 60, 4, 17)
        + line(0, 70, 3, 18)
        + line(0, 73, 1, 0)
        + line(1, 70, 2, 0)
        + line(0, 80, 2, 18),
        {11: STATIC, 12: STATIC, 14: MOVED, 15: DISAPPEARED, 16: UNKNOWN, 17: MOVED, 18: DISAPPEARED},
    )
    return evaluate_result(result, truth, radius_m=0.1)


def test_association_counted_by_hand(report) -> None:
    scores = report.association[0]
    assert scores["static"] == AssociationScores(found=2, true_count=4, right=2, claimed=2, on_background=0)
    assert scores["moved"] == AssociationScores(found=1, true_count=1, right=1, claimed=2, on_background=0)
    assert scores["removed"] == AssociationScores(found=1, true_count=2, right=1, claimed=1, on_background=1)
    assert (scores["moved"].precision, scores["moved"].recall) == (0.5, 1.0)
    assert scores["moved"].f1 == pytest.approx(2 / 3)
    assert AssociationScores(0, 3, 0, 0, 0).f1 == 0
    assert AssociationScores(0, 0, 0, 0, 0).f1 is None


def test_merged_objects_are_kept_but_not_distinct(report) -> None:
    static = report.identity[0][STATIC]
    assert (static.kept, static.present) == (4, 4)  # 2 and 3 share object 12
    assert (static.distinct, static.distinct_recall) == (3, 0.75)


def test_background_counted_by_hand(report) -> None:
    background = report.background
    assert background.true_units == 8
    assert (background.changed, background.in_objects) == (3, 3)
    assert background.missed == 2  # of visit 1
    assert background.unknown == 0
    assert background.changed_rate == pytest.approx(3 / 8)
    assert background.map_points == (1, 2)
    assert background.all_map_points == (4 + 9 + 4 + 4 + 4 + 4 + 4 + 2, 4 + 9 + 4 + 4 + 2)
