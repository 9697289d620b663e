"""Fit the weights of ``pipeline.association.moves`` on results of synthetic scenes.

    python benchmarks/fit_move_score.py FOLDER [FOLDER ...]

Each FOLDER, named KIND-SEED, holds ``changes.oasis`` (a result of ``oasisview run``) and ``gt.ply`` of its
pair; the tables report other seeds. An example is a pair of objects that the run laid over each other: they
are one if both are mostly the same true object, which moved. Pairs of objects that no truth is known of, and
of parts of one object that stayed, are left out: the engine asks for a motion besides.
Printed: the weights as settings, and how many moves are claimed and right, on the folders and on each kind
of scene when it is left out of the fit.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from pipeline.association.cloud_agreement import ObjectRegistration
from pipeline.association.moves import FEATURES, ScoredMove, choose_moves
from pipeline.errors import InputError, ResultError
from pipeline.ply import LabelledPoints, read_ply
from pipeline.result import ChangeLabel, SessionResult
from pipeline.settings import MoveSettings
from pipeline.store import open_result

MATCH_RADIUS_M = 0.15
MIN_POINTS = 5
MAX_WEIGHT_VOXELS = 2000
POSITIVE_WEIGHT = 1.5
RIDGE = 1.0


@dataclass(frozen=True)
class Examples:
    """Pairs of objects of one result.

    Attributes:
        pairs: (N, 2) object ids of the previous and the current object.
        features: (N, len(FEATURES)).
        true_object: (N,) the true object that both are, 0 = they are not one.
    """

    pairs: NDArray[np.int64]
    features: NDArray[np.float64]
    true_object: NDArray[np.int64]

    @property
    def weight(self) -> NDArray[np.float64]:
        """(N,) by the voxels of the smaller object; pairs that are one weigh more, as they are few."""
        voxels = np.exp(self.features[:, FEATURES.index("voxels")])
        size = np.sqrt(np.minimum(voxels, MAX_WEIGHT_VOXELS) / MAX_WEIGHT_VOXELS) * 2
        return size * np.where(self.true_object > 0, POSITIVE_WEIGHT, 1.0)


def main() -> None:
    """Print weights and moves."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+")
    folders = parser.parse_args().folders
    examples = [read_examples(folder) for folder in folders]
    weights = fit(examples)
    names = ("bias", *(f"{name}_weight" for name in FEATURES))
    print({name: round(float(value), 2) for name, value in zip(names, weights, strict=True)})
    kinds = [kind_of(folder) for folder in folders]
    for kind in sorted(set(kinds)):
        of_kind = [e for e, its_kind in zip(examples, kinds, strict=True) if its_kind == kind]
        others = [e for e, its_kind in zip(examples, kinds, strict=True) if its_kind != kind]
        left_out = report(of_kind, fit(others)) if others else "-"
        print(f"{kind}: {report(of_kind, weights)}; left out of the fit: {left_out}")


def kind_of(folder: Path) -> str:
    """``office`` of ``.../office-3``."""
    kind, dash, _ = folder.resolve().name.rpartition("-")
    return kind if dash else folder.resolve().name


def read_examples(folder: Path) -> Examples:
    """The pairs of a result whose truth is clear.

    Raises:
        ResultError: there is no result, or none that tells which objects were laid over each other.
        InputError: there is no ground truth.
    """
    result, truth = open_result(folder / "changes.oasis"), read_ply(folder / "gt.ply")
    moves = result.moves  # type: ignore[attr-defined]
    if moves is None:
        raise ResultError(f"{result.path} holds no moves.npy", "run it again with the method oasis")
    previous, current = (true_objects(session, truth) for session in result.sessions)
    pairs, features, true_object = [], [], []
    for row in moves:
        ids = int(row["previous_object_id"]), int(row["current_object_id"])
        if ids[0] not in previous or ids[1] not in current:
            continue
        (before, had_moved), (after, has_moved) = previous[ids[0]], current[ids[1]]
        is_one = before == after > 0
        if is_one and not (had_moved and has_moved):
            continue
        pairs.append(ids)
        features.append([float(row[name]) for name in FEATURES])
        true_object.append(before if is_one else 0)
    return Examples(
        np.array(pairs, np.int64).reshape(-1, 2),
        np.array(features, np.float64).reshape(-1, len(FEATURES)),
        np.array(true_object, np.int64),
    )


def true_objects(session: SessionResult, truth: LabelledPoints) -> dict[int, tuple[int, bool]]:
    """The true object that most of each object is, and whether it moved; 0 = background or nothing clear."""
    mine = truth.session == session.index
    if not mine.any():
        raise InputError(f"the truth has no points of visit {session.index}", "generate the pair again")
    distance, nearest = cKDTree(truth.points_world[mine]).query(
        np.asarray(session.points_world), distance_upper_bound=MATCH_RADIUS_M
    )
    ids = np.where(np.isfinite(distance), np.asarray(session.object_ids), 0)
    nearest = np.where(np.isfinite(distance), nearest, 0)
    its_object, its_label = truth.object_id[mine][nearest], truth.label[mine][nearest]
    found = {}
    for object_id in np.unique(ids[ids > 0]).tolist():
        points = ids == object_id
        objects, counts = np.unique(its_object[points], return_counts=True)
        if counts.sum() < MIN_POINTS:
            continue
        most = int(objects[counts.argmax()]) if counts.max() > counts.sum() / 2 else 0
        labels = its_label[points & (its_object == most)]
        has_moved = most > 0 and bool((labels == ChangeLabel.MOVED).mean() > 0.5)
        found[object_id] = most, has_moved
    return found


def fit(examples: list[Examples]) -> NDArray[np.float64]:
    """(1 + len(FEATURES),) bias and weights: logistic regression, ridge on the standardised features."""
    features = np.concatenate([e.features for e in examples])
    target = np.concatenate([e.true_object > 0 for e in examples]).astype(float)
    size = np.concatenate([e.weight for e in examples])
    if not len(features):
        raise InputError("no two objects were laid over each other in these results", "name other folders")
    centre, spread = features.mean(axis=0), features.std(axis=0) + 1e-9
    design = np.column_stack([np.ones(len(features)), (features - centre) / spread])
    penalty = RIDGE * np.r_[0.0, np.ones(len(FEATURES))]

    def loss(weights: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        odds = design @ weights
        error = size * (1 / (1 + np.exp(-np.clip(odds, -30, 30))) - target)
        value = (size * (np.logaddexp(0, odds) - target * odds)).sum() + (penalty * weights**2).sum() / 2
        return float(value), design.T @ error + penalty * weights

    bias, *weights = minimize(loss, np.zeros(design.shape[1]), jac=True, method="L-BFGS-B").x
    weights = np.array(weights) / spread
    return np.r_[bias - weights @ centre, weights]


def report(examples: list[Examples], weights: NDArray[np.float64]) -> str:
    """Moves that the engine would claim with these weights, whether anything went far enough or not."""
    claimed = right = found = present = 0
    nowhere = ObjectRegistration(np.eye(4), *[0.0] * 9)
    for e in examples:
        log_odds = weights[0] + e.features @ weights[1:]
        scored = [
            ScoredMove(int(p), int(c), nowhere, values, float(odds))
            for (p, c), values, odds in zip(e.pairs, e.features, log_odds, strict=True)
        ]
        truth = {(int(p), int(c)): int(t) for (p, c), t in zip(e.pairs, e.true_object, strict=True)}
        chosen = choose_moves(scored, lambda move: True, MoveSettings())
        what = [truth[move.previous, move.current] for move in chosen]
        claimed, right = claimed + len(what), right + sum(number > 0 for number in what)
        found, present = found + len(set(what) - {0}), present + len(set(truth.values()) - {0})
    return f"{right} right of {claimed} claimed, {found} found of {present} that moved"


if __name__ == "__main__":
    main()
