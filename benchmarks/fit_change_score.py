"""Fit the weights of ``pipeline.change.change_score`` on results of synthetic scenes.

    python benchmarks/fit_change_score.py FOLDER [FOLDER ...]

Each FOLDER holds ``changes.oasis`` (a result of ``oasisview run``) and ``gt.ply`` of its pair. The defaults
were fitted on office, warehouse, carpark and market of seed 1; the tables report other seeds.
Printed: the weights, the errors on the folders, and the errors on each folder when it is left out of the fit.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from instance_truth import instance_truths
from numpy.typing import NDArray

from pipeline.change.change_score import appearance_trust, change_features
from pipeline.change.evidence import ObjectEvidence
from pipeline.ply import read_ply
from pipeline.result import ChangeLabel
from pipeline.settings import ChangeSettings
from pipeline.store import open_result

NAMES = (
    "bias",
    "seen_through",
    "dissimilarity",
    "residual",
    "texture",
    "tail",
    "pattern",
    "print_here",
    "print_elsewhere",
)
MIN_COVERAGE = 0.3
RIDGE = 0.02
NEWTON_STEPS = 60
MAX_WEIGHT_POINTS = 2000


@dataclass(frozen=True)
class Examples:
    """Objects of one result: features (N, 9), truth (N,) and weight (N,) by size."""

    features: NDArray[np.float64]
    is_changed: NDArray[np.bool_]
    weight: NDArray[np.float64]


def main() -> None:
    """Print weights and errors."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    folders = parser.parse_args().folders
    examples = [read_examples(folder) for folder in folders]
    weights = fit(examples)
    print({name: round(float(value), 2) for name, value in zip(NAMES, weights, strict=True)})
    for number, folder in enumerate(folders):
        others = [e for position, e in enumerate(examples) if position != number]
        left_out = errors(examples[number], fit(others)) if others else "-"
        print(f"{folder.name}: {errors(examples[number], weights)}; left out of the fit: {left_out}")


def read_examples(folder: Path) -> Examples:
    """The objects of a result whose truth is clear."""
    result, truth = open_result(folder / "changes.oasis"), read_ply(folder / "gt.ply")
    trust = appearance_trust(result.manifest["quality"]["appearance_scale_log"], ChangeSettings())
    evidence = [ObjectEvidence.from_table(session.evidence) for session in result.sessions]  # type: ignore[attr-defined]
    # Colours and patches count as far as the visits' colours agree, geometry and patterns always.
    trusted = np.array([1.0, *[trust] * 4, 1.0, 1.0, 1.0])
    values = [change_features(of_visit) * trusted for of_visit in evidence]
    features, changed, weight = [], [], []
    for found in instance_truths(result, truth):
        counts = np.bincount(found.labels, minlength=256)[: ChangeLabel.MOVED + 1]
        share = counts[ChangeLabel.APPEARED :].sum() / max(1, counts.sum())
        coverage = evidence[found.session].coverage[found.instance + 1]
        if counts.sum() < 5 or 0.2 < share < 0.8 or coverage < MIN_COVERAGE:
            continue
        features.append([1.0, *values[found.session][found.instance + 1]])
        changed.append(share > 0.5)
        weight.append(np.sqrt(min(int(counts.sum()), MAX_WEIGHT_POINTS)) / 20)
    return Examples(np.array(features), np.array(changed), np.array(weight))


def fit(examples: list[Examples]) -> NDArray[np.float64]:
    """Logistic regression by Newton's method, larger objects weighing more."""
    features = np.concatenate([e.features for e in examples])
    target = np.concatenate([e.is_changed for e in examples]).astype(float)
    size = np.concatenate([e.weight for e in examples])
    weights = np.zeros(features.shape[1])
    penalty = RIDGE * np.r_[0.0, np.ones(len(weights) - 1)]
    for _ in range(NEWTON_STEPS):
        odds = 1 / (1 + np.exp(-np.clip(features @ weights, -30, 30)))
        gradient = features.T @ (size * (target - odds)) - penalty * weights
        curvature = (features.T * (size * odds * (1 - odds) + 1e-6)) @ features + np.diag(penalty + 1e-9)
        weights = weights + np.linalg.solve(curvature, gradient)
    return weights


def errors(examples: Examples, weights: NDArray[np.float64]) -> str:
    """Wrong objects, both ways."""
    says_changed = examples.features @ weights > 0
    false_alarms = int((says_changed & ~examples.is_changed).sum())
    missed = int((~says_changed & examples.is_changed).sum())
    return f"{false_alarms} false alarms and {missed} missed of {len(says_changed)}"


if __name__ == "__main__":
    main()
