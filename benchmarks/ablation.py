"""What limits the change F1: one stage after another replaced by ground truth.

    python benchmarks/ablation.py FOLDER [FOLDER ...] [--json FILE]

Each FOLDER holds ``changes.oasis`` (a result of ``oasisview run``) and ``gt.ply`` of its pair. The rows:

ours            the result as it is
change          whether each object changed comes from the ground truth; what it calls moved stays moved
moves           which changed objects moved comes from the ground truth; whether they changed is ours
labels          both: each object has the label of most of its ground truth. What is missing is lost by
                masks, merging and boundaries
points          every map point has the true label. What is missing was never mapped
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.counts import mean_defined
from pipeline.evaluation.ground_truth import read_ground_truth
from pipeline.evaluation.pointwise import CHANGES, PointwiseScores, pointwise_scores
from pipeline.evaluation.units import MISSED, Units, match_radius_m, match_units, predicted_points
from pipeline.result import ChangeLabel
from pipeline.store import open_result

ROWS = ("ours", "change", "moves", "labels", "points")
_ONE_SIDED = np.array([ChangeLabel.DISAPPEARED, ChangeLabel.APPEARED], dtype=np.int64)
_CODES = 256


def main() -> None:
    """Print a table per folder and the mean over all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--json", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    print(
        "| pair | row | change F1 | appeared | disappeared | moved | static |",
        "|---|---|" + "---:|" * 5,
        sep="\n",
    )
    table = {folder.name: ablated(folder) for folder in arguments.folders}
    for name, rows in table.items():
        for row in ROWS:
            print(f"| {name} | {row} | {' | '.join(map(_number, rows[row].values()))} |")
    for row in ROWS:
        columns = zip(*(rows[row].values() for rows in table.values()), strict=True)
        print(f"| **mean** | {row} | {' | '.join(_number(mean_defined(column)) for column in columns)} |")
    if arguments.json:
        arguments.json.write_text(json.dumps(table, indent=1) + "\n")


def ablated(folder: Path) -> dict[str, dict[str, float | None]]:
    """Scores of every row for one result."""
    visits = predicted_points(open_result(folder / "changes.oasis"))
    truth = read_ground_truth(folder / "gt.ply")
    units = match_units(truth.points, visits, match_radius_m(visits))
    return {row: _scores(units, labels) for row, labels in substituted(units).items()}


def substituted(units: Units) -> Mapping[str, NDArray[np.int64]]:
    """Predicted label of every unit, per row."""
    ours = units.predicted_label
    true_of_object = _label_of_object(units)
    true_of_object = np.where(ours == MISSED, MISSED, true_of_object)
    truly_changed = np.isin(true_of_object, CHANGES)
    one_sided = _ONE_SIDED[np.clip(units.session, 0, 1)]
    is_changed = np.isin(ours, CHANGES)
    change = np.where(truly_changed, np.where(is_changed, ours, one_sided), true_of_object)
    moves = np.where(is_changed, np.where(truly_changed, true_of_object, one_sided), ours)
    points = np.where(ours == MISSED, MISSED, units.true_label)
    return {"ours": ours, "change": change, "moves": moves, "labels": true_of_object, "points": points}


def _label_of_object(units: Units) -> NDArray[np.int64]:
    """For every unit, the most frequent true label of the object that was predicted there, in its visit."""
    row = units.predicted_object * 2 + units.session
    votes = np.zeros((int(row.max(initial=0)) + 1, _CODES), dtype=np.int64)
    scored = units.scored
    np.add.at(votes, (row[scored], units.true_label[scored]), 1)
    label = votes.argmax(axis=1)[row]
    return np.where(units.predicted_object == 0, int(ChangeLabel.STATIC), label).astype(np.int64)


def _scores(units: Units, labels: NDArray[np.int64]) -> dict[str, float | None]:
    scores: PointwiseScores = pointwise_scores(
        replace(units, predicted_label=labels), np.zeros(0, dtype=np.int64)
    )
    names = {ChangeLabel.APPEARED: "appeared", ChangeLabel.DISAPPEARED: "disappeared"}
    names |= {ChangeLabel.MOVED: "moved", ChangeLabel.STATIC: "static"}
    return {
        "change": scores.mean_change_f1,
        **{name: scores.per_label[label].f1 for label, name in names.items()},
    }


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


if __name__ == "__main__":
    main()
