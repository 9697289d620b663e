"""Identity across visits: is the same thing the same object afterwards?

Recall, per true label: of the true objects that are static (or moved) and present in both visits, the
share whose majority prediction carries the same ``object_id`` in both. One object of the result may be the
majority of several true ones (chairs merged into one): ``distinct`` counts only true objects that their
prediction mostly consists of, in both visits. Precision, per predicted label: of the result's objects with
points in both visits, the share that lie on the same true object in both. Objects of the result that lie on
true background in both visits are no statement about an identity: they are false positives of detection and
are left out here. *Majority* is the object with most of the units, if it has a quarter of them at least.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.evaluation.overlap import Overlap
from pipeline.evaluation.units import Units
from pipeline.result import ChangeLabel

PERSISTENT = (ChangeLabel.STATIC, ChangeLabel.MOVED)


@dataclass(frozen=True)
class IdentityScores:
    """Kept identities of one label between two visits.

    Attributes:
        kept, present: true objects that kept their id, of those in both visits.
        right, claimed: predicted objects that are one true object in both visits, of those that claim so.
        pairs: (true object, predicted object) of the kept ones.
        distinct: kept ones whose predicted object is mostly theirs in both visits.
    """

    label: ChangeLabel
    kept: int
    present: int
    right: int
    claimed: int
    pairs: tuple[tuple[int, int], ...]
    distinct: int = 0

    @property
    def distinct_recall(self) -> float | None:
        """Share of identities kept by an object of their own; None when no object is in both visits."""
        return self.distinct / self.present if self.present else None

    @property
    def recall(self) -> float | None:
        """Share of identities kept; None when no object is in both visits."""
        return self.kept / self.present if self.present else None

    @property
    def precision(self) -> float | None:
        """Share of claimed identities that are right; None when none is claimed."""
        return self.right / self.claimed if self.claimed else None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "kept": self.kept,
            "present_in_both": self.present,
            "recall": self.recall,
            "distinct": self.distinct,
            "distinct_recall": self.distinct_recall,
            "right": self.right,
            "claimed_in_both": self.claimed,
            "precision": self.precision,
        }


def identity_scores(
    units: Units,
    previous: Overlap,
    current: Overlap,
    sessions: tuple[int, int],
    predicted_labels: Mapping[int, ChangeLabel],
) -> dict[ChangeLabel, IdentityScores]:
    """Identities between two visits, for static and for moved objects."""
    found_before, found_after = previous.predicted_of_true(), current.predicted_of_true()
    truth_before, truth_after = previous.true_of_predicted(), current.true_of_predicted()
    labels_before, labels_after = (true_labels(units, session) for session in sessions)
    alone = kept_alone(previous, current)
    scores = {}
    for label in PERSISTENT:
        present = [
            object_id
            for object_id, true_label in labels_before.items()
            if true_label == label and labels_after.get(object_id) == label
        ]
        pairs = tuple(
            (object_id, found_before[object_id])
            for object_id in present
            if found_before[object_id] > 0 and found_before[object_id] == found_after[object_id]
        )
        claimed = [
            object_id
            for object_id in truth_before.keys() & truth_after.keys()
            if predicted_labels.get(object_id) == label
            and (truth_before[object_id] > 0 or truth_after[object_id] > 0)
        ]
        right = sum(truth_before[object_id] == truth_after[object_id] for object_id in claimed)
        scores[label] = IdentityScores(
            label,
            kept=len(pairs),
            present=len(present),
            right=right,
            claimed=len(claimed),
            pairs=pairs,
            distinct=sum(object_id in alone for object_id in present),
        )
    return scores


def kept_alone(previous: Overlap, current: Overlap) -> dict[int, int]:
    """True object -> the predicted object that is its majority in both visits, and is mostly it."""
    sides = [(overlap.predicted_of_true(), overlap.true_of_predicted()) for overlap in (previous, current)]
    (before, truth_before), (after, truth_after) = sides
    return {
        true_id: predicted
        for true_id, predicted in before.items()
        if predicted > 0
        and after.get(true_id) == predicted
        and truth_before[predicted] == true_id == truth_after[predicted]
    }


def true_labels(units: Units, session: int) -> dict[int, int]:
    """Most frequent scored label of each true object of a visit."""
    chosen = units.scored & (units.session == session) & (units.true_object > 0)
    objects, rows = np.unique(units.true_object[chosen], return_inverse=True)
    votes = np.zeros((len(objects), len(ChangeLabel)), dtype=np.int64)
    np.add.at(votes, (rows, units.true_label[chosen]), 1)
    return dict(zip(objects.tolist(), votes.argmax(axis=1).tolist(), strict=True))
