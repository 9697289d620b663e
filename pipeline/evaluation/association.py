"""Association as in the paper's second table: static, moved and removed objects of the previous visit.

Stricter than ``identity``: the label must be right too, and one object of the result cannot stand for several
true ones. A true object that stayed (or moved) is found when its majority prediction is the same object in
both visits, mostly consists of it in both, and carries the label static (or moved); a removed one when its
majority prediction mostly consists of it and is labelled disappeared. Recall is found / N_gt. Precision, over
the result's objects that claim the state: those whose true object (majority, the same in both visits for
static and moved) has that state. Claims that lie on background only are counted apart, as in ``identity``:
the paper annotates objects, and what lies on none of them is neither right nor wrong about an identity.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.evaluation.identity import kept_alone, true_labels
from pipeline.evaluation.overlap import Overlap
from pipeline.evaluation.units import Units
from pipeline.result import ChangeLabel

STATES = {
    "static": ChangeLabel.STATIC,
    "moved": ChangeLabel.MOVED,
    "removed": ChangeLabel.DISAPPEARED,
}


@dataclass(frozen=True)
class AssociationScores:
    """One state between two visits.

    Attributes:
        found, true_count: true objects that were found, of N_gt.
        right, claimed: predicted objects that claim the state rightly, of those on true objects.
        on_background: predicted objects that claim the state on background only.
    """

    found: int
    true_count: int
    right: int
    claimed: int
    on_background: int

    @property
    def recall(self) -> float | None:
        """found / N_gt; None without any such object."""
        return self.found / self.true_count if self.true_count else None

    @property
    def precision(self) -> float | None:
        """right / claimed; None when nothing is claimed."""
        return self.right / self.claimed if self.claimed else None

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall; 0 when one of them is 0 or undefined, None when both are."""
        if self.precision is None and self.recall is None:
            return None
        precision, recall = self.precision or 0.0, self.recall or 0.0
        return 2 * precision * recall / (precision + recall) if precision + recall else 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "n_gt": self.true_count,
            "found": self.found,
            "right": self.right,
            "claimed": self.claimed,
            "on_background": self.on_background,
            "precision": self.precision,
            "recall": self.recall,
            "f1": self.f1,
        }


def association_scores(
    units: Units,
    previous: Overlap,
    current: Overlap,
    sessions: tuple[int, int],
    predicted_labels: Mapping[int, ChangeLabel],
) -> dict[str, AssociationScores]:
    """Scores of each state in ``STATES`` between two visits."""
    found_before, alone = previous.predicted_of_true(), kept_alone(previous, current)
    truth_before, truth_after = previous.true_of_predicted(), current.true_of_predicted()
    labels_before, labels_after = (true_labels(units, session) for session in sessions)

    def is_in_state(true_id: int, label: ChangeLabel) -> bool:
        if label is ChangeLabel.DISAPPEARED:
            return labels_before.get(true_id) == label
        return labels_before.get(true_id) == label == labels_after.get(true_id)

    def is_found(true_id: int, label: ChangeLabel) -> bool:
        if label is ChangeLabel.DISAPPEARED:
            predicted = found_before[true_id]
            is_own = predicted > 0 and truth_before[predicted] == true_id
        else:
            predicted = alone.get(true_id, 0)
            is_own = predicted > 0
        return is_own and predicted_labels.get(predicted) == label

    scores = {}
    for name, label in STATES.items():
        present = [true_id for true_id in labels_before if is_in_state(true_id, label)]
        right = claimed = on_background = 0
        for predicted, true_id in truth_before.items():
            if predicted_labels.get(predicted) != label:
                continue
            if label is ChangeLabel.DISAPPEARED:
                afterwards = true_id
            elif predicted in truth_after:
                afterwards = truth_after[predicted]
            else:
                continue  # claims both visits, but is near truth in one only
            if true_id == afterwards == 0:
                on_background += 1
                continue
            claimed += 1
            right += true_id == afterwards and is_in_state(true_id, label)
        scores[name] = AssociationScores(
            found=sum(is_found(true_id, label) for true_id in present),
            true_count=len(present),
            right=right,
            claimed=claimed,
            on_background=on_background,
        )
    return scores
