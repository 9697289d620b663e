"""Was the label of each object right? What calibration and abstention are counted over.

An object of the result is matched to the ground truth by the scored units, of both visits, at which it is
the prediction: its true label is the most frequent one among them, background included (label static).
Objects without a scored unit are left out. Every object weighs the same, whatever its size. *Unknown* is no
claim, so such objects are counted apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.pointwise import CHANGES
from pipeline.evaluation.units import Units
from pipeline.result import ChangeLabel, MapObject


@dataclass(frozen=True)
class Verdicts:
    """Decided objects, and what was left unknown.

    Attributes:
        confidence: (N,) of the decided objects, in [0, 1].
        is_right: (N,) whether the label equals the true one.
        is_change: (N,) whether the label says appeared, disappeared or moved.
        unknown: objects left unknown; unknown_changed: those of them that truly changed.
        unmatched: objects without a scored unit.
    """

    confidence: NDArray[np.float64]
    is_right: NDArray[np.bool_]
    is_change: NDArray[np.bool_]
    unknown: int = 0
    unknown_changed: int = 0
    unmatched: int = 0

    def __len__(self) -> int:
        return len(self.confidence)

    def changes(self) -> Verdicts:
        """Only the objects that are labelled as changed."""
        chosen = self.is_change
        return Verdicts(self.confidence[chosen], self.is_right[chosen], self.is_change[chosen])


def verdicts(
    units: Units, objects: Sequence[MapObject], predicted_labels: Mapping[int, ChangeLabel]
) -> Verdicts:
    """Match every object of the result and compare its label."""
    scored = units.scored & (units.predicted_object > 0)
    votes: dict[int, NDArray[np.int64]] = {
        item.object_id: np.zeros(len(ChangeLabel), dtype=np.int64) for item in objects
    }
    owners, rows = np.unique(units.predicted_object[scored], return_inverse=True)
    table = np.zeros((len(owners), len(ChangeLabel)), dtype=np.int64)
    np.add.at(table, (rows, units.true_label[scored]), 1)
    votes.update(zip(owners.tolist(), table, strict=True))
    confidence, is_right, is_change = [], [], []
    unknown = unknown_changed = unmatched = 0
    for item in objects:
        counted = votes[item.object_id]
        if not counted.any():
            unmatched += 1
            continue
        true, label = int(counted.argmax()), predicted_labels[item.object_id]
        if label == ChangeLabel.UNKNOWN:
            unknown += 1
            unknown_changed += true in CHANGES
            continue
        confidence.append(item.confidence)
        is_right.append(label == true)
        is_change.append(label in CHANGES)
    return Verdicts(
        np.array(confidence, dtype=np.float64),
        np.array(is_right, dtype=bool),
        np.array(is_change, dtype=bool),
        unknown,
        unknown_changed,
        unmatched,
    )


def pooled_verdicts(parts: Sequence[Verdicts]) -> Verdicts:
    """The objects of several pairs as one."""
    if not parts:
        return Verdicts(np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0, dtype=bool))
    return Verdicts(
        np.concatenate([part.confidence for part in parts]),
        np.concatenate([part.is_right for part in parts]),
        np.concatenate([part.is_change for part in parts]),
        sum(part.unknown for part in parts),
        sum(part.unknown_changed for part in parts),
        sum(part.unmatched for part in parts),
    )
