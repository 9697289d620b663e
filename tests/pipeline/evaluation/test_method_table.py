from __future__ import annotations

import json

import pytest

from pipeline.evaluation import evaluate_result
from pipeline.evaluation.method_table import MethodTable, Outcome, Trial
from pipeline.result import ChangeLabel

STATIC, APPEARED = ChangeLabel.STATIC, ChangeLabel.APPEARED


@pytest.fixture
def table(build) -> MethodTable:
    truth = build.truth([(1, 0, APPEARED, 1), *((1, at, STATIC, 0) for at in (1, 2, 3))])
    right = evaluate_result(
        build.result([(1, 0, 1), (1, 1, 0), (1, 2, 0), (1, 3, 0)], {1: APPEARED}), truth, 0.1
    )
    over = evaluate_result(build.result([(1, at, 1) for at in range(4)], {1: APPEARED}), truth, 0.1)
    return MethodTable(
        {
            Trial("ours", "office", 1): Outcome(right, 10.0),
            Trial("theirs", "office", 1): Outcome(over, 2.0),
            Trial("ours", "office", 2): Outcome(over, 20.0),
            Trial("ours", "market", 1): Outcome(right, 30.0),
        }
    )


def test_means_worst_seeds_and_runtimes_by_hand(table: MethodTable) -> None:
    means = table.to_dict()["means"]
    office = means["ours"]["office"]
    assert office["pairs"] == 2
    assert office["mean"]["change F1"] == pytest.approx((1 + 0.4) / 2)
    assert office["worst"]["change F1"] == pytest.approx(0.4)
    assert office["seconds"] == 15
    assert means["ours"]["all"]["mean"]["change F1"] == pytest.approx((1 + 0.4 + 1) / 3)
    assert means["ours"]["all"]["seconds"] == 20
    assert means["theirs"]["market"] == {
        "pairs": 0,
        "mean": dict.fromkeys(office["mean"]),
        "worst": dict.fromkeys(office["mean"]),
        "seconds": None,
    }


def test_data_and_text_hold_every_trial(table: MethodTable) -> None:
    data = json.loads(json.dumps(table.to_dict()))
    assert [(row["method"], row["scene"], row["seed"], row["seconds"]) for row in data["trials"]] == [
        ("ours", "office", 1, 10.0),
        ("theirs", "office", 1, 2.0),
        ("ours", "office", 2, 20.0),
        ("ours", "market", 1, 30.0),
    ]
    lines = [line for line in table.text().splitlines() if line.startswith("|")]
    assert len({line.count("|") for line in lines}) == 1
    assert [line.split(" | ")[:4] for line in lines[2:]] == [
        ["| office", "ours", "0.700", "0.400"],
        ["| office", "theirs", "0.400", "0.400"],
        ["| market", "ours", "1.000", "1.000"],
        ["| all", "ours", "0.800", "0.400"],
        ["| all", "theirs", "0.400", "0.400"],
    ]
    assert "theirs: ECE 0.900 over 1 decided objects" in table.text()  # called appeared at 0.9, mostly static
