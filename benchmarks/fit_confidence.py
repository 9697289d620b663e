"""Fit the weights of ``pipeline.change.confidence`` on results of synthetic scenes.

    python benchmarks/fit_confidence.py FOLDER [FOLDER ...]

Each FOLDER holds ``changes.oasis`` (a result of ``oasisview run``) and ``gt.ply`` of its pair; use seeds that
no table reports. An instance is right if its label is that of most of its points in the ground truth.
Printed: the weights, and the expected calibration error on each folder when it is left out of the fit.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from instance_truth import instance_truths
from numpy.typing import NDArray
from scipy.optimize import minimize

from pipeline.change.confidence import FEATURES, GROUPS, confidence_features, group_of
from pipeline.evaluation.calibration import calibration_scores
from pipeline.evaluation.verdicts import Verdicts
from pipeline.ply import NOT_SCORED, read_ply
from pipeline.result import ChangeLabel
from pipeline.store import open_result

MIN_POINTS = 5
RIDGE = 1.0


@dataclass(frozen=True)
class Examples:
    """Decided instances of one result: (N, 5) features, (N,) group and whether the label is right."""

    features: NDArray[np.float64]
    group: NDArray[np.int64]
    is_right: NDArray[np.bool_]


def main() -> None:
    """Print weights and errors."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    folders = parser.parse_args().folders
    examples = [read_examples(folder) for folder in folders]
    for group, row in zip(GROUPS, fit(examples), strict=True):
        print(", ".join(f"{group}_{name}={value:.2f}" for name, value in zip(FEATURES, row, strict=True)))
    for number, folder in enumerate(folders):
        others = [e for position, e in enumerate(examples) if position != number]
        if others:
            error = calibration_scores(_verdicts(examples[number], fit(others))).ece
            print(f"{folder.name}: expected calibration error {error:.3f} left out of the fit")


def read_examples(folder: Path) -> Examples:
    """The decided instances of a result that the ground truth speaks about."""
    result, truth = open_result(folder / "changes.oasis"), read_ply(folder / "gt.ply")
    label_of = {item.object_id: int(item.label) for item in result.objects}
    tables = [session.evidence for session in result.sessions]  # type: ignore[attr-defined]
    values = [
        confidence_features(
            rows["log_odds"], rows["coverage"], rows["voxel_count"].astype(int), rows["move_log_odds"]
        )
        for rows in tables
    ]
    features, labels, is_right = [], [], []
    for found in instance_truths(result, truth):
        true = found.labels[(found.labels != NOT_SCORED) & (found.labels != ChangeLabel.UNKNOWN)]
        label = label_of[found.object_id]
        if len(true) < MIN_POINTS or label == ChangeLabel.UNKNOWN:
            continue
        features.append(values[found.session][found.instance])
        labels.append(label)
        is_right.append(int(np.bincount(true).argmax()) == label)
    return Examples(np.array(features), group_of(np.array(labels)), np.array(is_right))


def fit(examples: list[Examples]) -> NDArray[np.float64]:
    """(3, 5) logistic regression of being right, one row per group, every object weighing the same."""
    weights = np.zeros((len(GROUPS), len(FEATURES)))
    for group in range(len(GROUPS)):
        features = np.concatenate([e.features[e.group == group] for e in examples])
        is_right = np.concatenate([e.is_right[e.group == group] for e in examples])
        weights[group] = _logistic(features, is_right)
    return weights


def _logistic(features: NDArray[np.float64], is_right: NDArray[np.bool_]) -> NDArray[np.float64]:
    centre, spread = features.mean(axis=0), features.std(axis=0) + 1e-6
    centre[0], spread[0] = 0.0, 1.0
    scaled = (features - centre) / spread

    def loss(weights: NDArray[np.float64]) -> float:
        score = scaled @ weights
        return float(
            np.logaddexp(0, np.where(is_right, -score, score)).sum() + RIDGE * (weights[1:] ** 2).sum()
        )

    found = minimize(loss, np.zeros(features.shape[1])).x
    weights = found / spread
    weights[0] -= float((found[1:] * centre[1:] / spread[1:]).sum())
    return np.asarray(weights)


def _verdicts(examples: Examples, weights: NDArray[np.float64]) -> Verdicts:
    score = (examples.features * weights[examples.group]).sum(axis=1)
    confidence = 1 / (1 + np.exp(-score))
    return Verdicts(confidence, examples.is_right, examples.group > 0)


if __name__ == "__main__":
    main()
