from __future__ import annotations

import pytest

from pipeline.evaluation import evaluate_result
from pipeline.evaluation.counts import Counts
from pipeline.evaluation.summary import Summary
from pipeline.result import ChangeLabel

STATIC, APPEARED = ChangeLabel.STATIC, ChangeLabel.APPEARED


@pytest.fixture
def summary(build) -> Summary:
    truth = build.truth([(1, 0, APPEARED, 1), (1, 1, STATIC, 0), (1, 2, STATIC, 0), (1, 3, STATIC, 0)])
    right = build.result([(1, 0, 1), (1, 1, 0), (1, 2, 0), (1, 3, 0)], {1: APPEARED})
    over = build.result([(1, at, 1) for at in range(4)], {1: APPEARED})
    unchanged = build.truth([(1, 5, STATIC, 0)])
    return Summary(
        {
            "right": evaluate_result(right, truth, 0.1),
            "over": evaluate_result(over, truth, 0.1),
            "unchanged": evaluate_result(build.result([(1, 5, 0)]), unchanged, 0.1),
        }
    )


def test_micro_pools_counts_and_macro_averages_ratios(summary: Summary) -> None:
    assert summary.micro("appeared") == Counts(tp=2, fp=3, fn=0)
    assert summary.micro("appeared").precision == pytest.approx(0.4)
    macro = summary.macro("appeared")
    assert macro["precision"] == pytest.approx((1 + 0.25) / 2)  # the unchanged pair defines none
    assert macro["f1"] == pytest.approx((1 + 0.4) / 2)
    assert summary.macro("static")["recall"] == pytest.approx((1 + 0 + 1) / 3)
    assert summary.macro("moved") == {"precision": None, "recall": None, "f1": None}


def test_tables_are_markdown_of_one_width(summary: Summary) -> None:
    for table in (summary.pair_table(), summary.class_table()):
        assert len({line.count("|") for line in table.splitlines()}) == 1
    pairs = summary.pair_table().splitlines()
    assert pairs[2].startswith("| right | 1.000 | 1.000 | 1.000 | - |")
    assert pairs[-1].startswith("| **mean** | **0.700** |")


def test_data_holds_every_pair(summary: Summary) -> None:
    data = summary.to_dict()
    assert list(data["pairs"]) == ["right", "over", "unchanged"]
    assert data["macro_columns"]["change F1"] == pytest.approx(0.7)
    assert Summary({}).to_dict()["macro_columns"]["change F1"] is None
