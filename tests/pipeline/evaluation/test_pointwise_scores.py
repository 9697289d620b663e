from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.errors import InputError
from pipeline.evaluation import evaluate_result
from pipeline.evaluation.counts import Counts, mean_defined, pooled
from pipeline.evaluation.pointwise import pointwise_scores
from pipeline.evaluation.units import MISSED, Units, match_radius_m, match_units, predicted_points
from pipeline.result import ChangeLabel

UNKNOWN, STATIC, APPEARED, DISAPPEARED, MOVED = ChangeLabel


def test_ratios_by_hand() -> None:
    counts = Counts(tp=3, fp=1, fn=2)
    assert counts.precision == pytest.approx(0.75)
    assert counts.recall == pytest.approx(0.6)
    assert counts.f1 == pytest.approx(2 * 0.75 * 0.6 / 1.35)
    assert Counts().f1 is Counts().precision is Counts().recall is None
    assert (Counts(fn=4).f1, Counts(fn=4).precision, Counts(fn=4).recall) == (0.0, None, 0.0)
    assert (Counts(fp=4).f1, Counts(fp=4).precision, Counts(fp=4).recall) == (0.0, 0.0, None)
    assert pooled([counts, Counts(1, 1, 1)]) == Counts(4, 2, 3)
    assert mean_defined([0.5, None, 1.0]) == 0.75
    assert mean_defined([None]) is None


def test_confusion_counted_by_hand(build) -> None:
    truth = build.truth(
        [
            (0, 0, STATIC, 0),  # right
            (0, 1, DISAPPEARED, 5),  # right
            (0, 2, DISAPPEARED, 5),  # said static: FN disappeared, FP static
            (0, 3, MOVED, 6),  # unknown: FN moved, no FP
            (0, 4, STATIC, 0),  # no map point in reach: FN static
            (0, 5, 255, 0),  # not scored, though called disappeared
            (1, 0, STATIC, 0),  # said appeared: FN static, FP appeared
            (1, 1, APPEARED, 7),  # right
            (1, 2, MOVED, 6),  # right
            (1, 3, UNKNOWN, 9),  # unknowable: not scored
        ]
    )
    result = build.result(
        [
            (0, 0, 0),
            (0, 1, 1),
            (0, 2, 0),
            (0, 3, 2),
            (0, 5, 1),
            (1, 0, 3),
            (1, 1, 3),
            (1, 2, 4),
            (1, 3, 3),
            (1, 9, 3),  # far from all ground truth: invented, appeared
        ],
        {1: DISAPPEARED, 2: UNKNOWN, 3: APPEARED, 4: MOVED},
    )
    scores = evaluate_result(result, truth, radius_m=0.1).pointwise
    assert scores.per_label == {
        STATIC: Counts(tp=1, fp=1, fn=2),
        APPEARED: Counts(tp=1, fp=1, fn=0),
        DISAPPEARED: Counts(tp=1, fp=0, fn=1),
        MOVED: Counts(tp=1, fp=0, fn=1),
    }
    assert scores.appeared_disappeared == Counts(2, 1, 1)
    assert scores.micro == Counts(4, 2, 4)
    assert (scores.scored, scores.unscored, scores.unknown, scores.missed) == (8, 2, 1, 1)
    assert (scores.changed, scores.changed_unknown) == (5, 1)
    assert scores.mean_change_f1 == pytest.approx(2 / 3)  # three times 2 / (2 + 1)
    assert scores.macro_f1 == pytest.approx((2 / 5 + 3 * 2 / 3) / 4)
    assert scores.invented == {STATIC: 0, APPEARED: 1, DISAPPEARED: 0, MOVED: 0}
    assert scores.precision_with_invented(APPEARED) == pytest.approx(1 / 3)
    data = scores.to_dict()
    assert data["unknown_rate"] == pytest.approx(1 / 8)
    assert data["missed_rate"] == pytest.approx(1 / 8)
    assert data["unknown_rate_of_changed"] == pytest.approx(1 / 5)
    assert data["per_label"]["static"]["fn"] == 2


def test_perfect_prediction_scores_one(build) -> None:
    rows = [(0, 0, STATIC, 0), (0, 1, DISAPPEARED, 1), (1, 0, STATIC, 0), (1, 2, APPEARED, 2)]
    result = build.result([(s, at, object_id) for s, at, _, object_id in rows], {1: DISAPPEARED, 2: APPEARED})
    scores = evaluate_result(result, build.truth(rows), radius_m=0.1).pointwise
    assert scores.micro.f1 == scores.macro_f1 == scores.mean_change_f1 == 1.0
    assert scores.per_label[MOVED].f1 is None  # never occurs, so it does not count in the means


def test_empty_map_misses_everything(build) -> None:
    truth = build.truth([(0, 0, STATIC, 0), (1, 1, APPEARED, 2), (1, 2, 255, 0)])
    report = evaluate_result(build.result([]), truth)
    assert report.pointwise.micro == Counts(tp=0, fp=0, fn=2)
    assert report.pointwise.missed == 2
    assert report.pointwise.mean_change_f1 == 0.0
    assert report.to_dict()["match_radius_m"] == 0.1
    assert "missed 100.0 %" in report.table()


def test_nothing_scored_gives_no_numbers_instead_of_wrong_ones(build) -> None:
    report = evaluate_result(build.result([(0, 0, 0)]), build.truth([(0, 0, 255, 0)]))
    assert report.pointwise.micro.f1 is None
    assert report.pointwise.mean_change_f1 is None
    assert report.to_dict()["pointwise"]["unknown_rate"] is None
    assert "-" in report.table()


def test_predicted_change_without_true_change_is_a_zero_not_a_gap(build) -> None:
    truth = build.truth([(1, 0, STATIC, 0)])
    scores = evaluate_result(build.result([(1, 0, 1)], {1: APPEARED}), truth, radius_m=0.1).pointwise
    assert scores.mean_change_f1 == 0.0
    assert scores.per_label[DISAPPEARED].f1 is None


def test_labels_are_the_machines_unless_given(build) -> None:
    truth = build.truth([(1, 0, STATIC, 1)])
    result = build.result([(1, 0, 1)], {1: APPEARED})
    assert evaluate_result(result, truth).pointwise.per_label[STATIC] == Counts(fn=1)
    given = evaluate_result(result, truth, labels={1: STATIC})
    assert given.pointwise.per_label[STATIC] == Counts(tp=1)
    assert given.to_dict()["labels"] == "given"


def test_units_are_voxels_per_visit_object_and_label(build) -> None:
    truth = build.truth(
        [
            (0, 0.000, STATIC, 0),
            (0, 0.010, STATIC, 0),  # same voxel, same everything: one unit, at the mean
            (0, 0.012, STATIC, 3),  # same voxel, another object
            (0, 0.050, STATIC, 0),  # next voxel
            (1, 0.000, STATIC, 0),  # another visit
        ]
    )
    units = match_units(truth, predicted_points(build.result([])), 0.1)
    assert len(units) == 4
    first = (units.session == 0) & (units.true_object == 0)
    assert sorted(units.points_world[first][:, 0]) == pytest.approx([0.025, 0.07])
    assert (units.predicted_label == MISSED).all()


def test_only_the_same_visit_within_the_radius_speaks(build) -> None:
    truth = build.truth([(0, 0, STATIC, 0), (0, 1, STATIC, 0), (0, 2, STATIC, 0)])
    result = build.result([(1, 0, 0), (0, 1.099, 0), (0, 2.101, 0)])
    units = match_units(truth, predicted_points(result), 0.1)
    assert sorted(units.predicted_label.tolist()) == [STATIC, MISSED, MISSED]


def test_radius_grows_with_a_coarse_map(build) -> None:
    fine = build.result([(0, 0.04 * i, 0) for i in range(20)] + [(1, 0.04 * i, 0) for i in range(20)])
    assert match_radius_m(predicted_points(fine)) == pytest.approx(0.1)
    coarse = build.result([(0, 0.04 * i, 0) for i in range(20)] + [(1, 0.2 * i, 0) for i in range(20)])
    assert match_radius_m(predicted_points(coarse)) == pytest.approx(0.3, rel=1e-4)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([], "no points"),
        ([(2, 0, STATIC, 0)], "visit 2, the result has 2 visits"),
        ([(0, 0, 77, 0)], "unknown label 77"),
        ([(0, 0, STATIC, -1)], "negative object_id"),
        ([(0, float("nan"), STATIC, 0)], "not finite"),
    ],
)
def test_impossible_ground_truth_is_one_line(build, rows, message: str) -> None:
    with pytest.raises(InputError, match=message):
        evaluate_result(build.result([(0, 0, 0)]), build.truth(rows))


@pytest.mark.parametrize("radius_m", [0.0, -1.0, float("nan"), float("inf")])
def test_impossible_radius_is_one_line(build, radius_m: float) -> None:
    with pytest.raises(InputError, match="match radius"):
        evaluate_result(build.result([(0, 0, 0)]), build.truth([(0, 0, STATIC, 0)]), radius_m)


CODES = st.sampled_from([0, 1, 2, 3, 4])


@given(
    true=arrays(np.int64, 40, elements=st.sampled_from([1, 2, 3, 4, 255])),
    predicted=arrays(np.int64, 40, elements=st.sampled_from([0, 1, 2, 3, 4, MISSED])),
)
def test_counts_add_up(true: np.ndarray, predicted: np.ndarray) -> None:
    zeros = np.zeros(40, dtype=np.int64)
    scores = pointwise_scores(Units(np.zeros((40, 3)), zeros, true, zeros, predicted, zeros), zeros)
    micro = scores.micro
    assert micro.tp + micro.fn == scores.scored
    assert micro.fp == micro.fn - scores.unknown - scores.missed
    for label, counts in scores.per_label.items():
        assert counts.tp + counts.fn == np.count_nonzero(true == label)
        assert counts.tp + counts.fp == np.count_nonzero((predicted == label) & (true != 255))
