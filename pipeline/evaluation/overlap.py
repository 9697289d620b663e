"""How true and predicted objects overlap, counted in evaluation units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.units import Units

# An object is recognised in another one from this share on (also the lowest threshold of detection).
MIN_SHARE = 0.25


@dataclass(frozen=True)
class Overlap:
    """Shared units of the true and the predicted objects of one visit.

    Attributes:
        true_ids: (G,) objects of the ground truth; predicted_ids: (P,) objects of the result.
        shared: (G, P) units that belong to both.
        true_sizes: (G,) units of each true object; predicted_sizes: (P,) units with each prediction.
    """

    true_ids: NDArray[np.int64]
    predicted_ids: NDArray[np.int64]
    shared: NDArray[np.int64]
    true_sizes: NDArray[np.int64]
    predicted_sizes: NDArray[np.int64]

    @property
    def iou(self) -> NDArray[np.float64]:
        """(G, P) intersection over union."""
        union = self.true_sizes[:, None] + self.predicted_sizes[None, :] - self.shared
        return self.shared / np.maximum(union, 1)

    def predicted_of_true(self) -> dict[int, int]:
        """The prediction with most units of each true object; 0 if it has under a quarter of them."""
        return _majority(self.true_ids, self.predicted_ids, self.shared, self.true_sizes)

    def true_of_predicted(self) -> dict[int, int]:
        """The true object with most units of each prediction; 0 if it has under a quarter of them."""
        return _majority(self.predicted_ids, self.true_ids, self.shared.T, self.predicted_sizes)


def object_overlap(units: Units, session: int) -> Overlap:
    """Overlap of all objects (background left out) over all units of a visit, scored or not."""
    here = units.session == session
    true, predicted = units.true_object[here], units.predicted_object[here]
    true_ids, true_rows = np.unique(true, return_inverse=True)
    predicted_ids, predicted_columns = np.unique(predicted, return_inverse=True)
    table = np.zeros((len(true_ids), len(predicted_ids)), dtype=np.int64)
    np.add.at(table, (true_rows, predicted_columns), 1)
    rows, columns = true_ids > 0, predicted_ids > 0
    return Overlap(
        true_ids=true_ids[rows],
        predicted_ids=predicted_ids[columns],
        shared=table[np.ix_(rows, columns)],
        true_sizes=table.sum(axis=1)[rows],
        predicted_sizes=table.sum(axis=0)[columns],
    )


def _majority(ids: NDArray, other_ids: NDArray, shared: NDArray, sizes: NDArray) -> dict[int, int]:
    if len(other_ids) == 0:
        return dict.fromkeys(ids.tolist(), 0)
    best = shared.argmax(axis=1)
    enough = shared.max(axis=1) >= MIN_SHARE * sizes
    chosen = np.where(enough, other_ids[best], 0)
    return dict(zip(ids.tolist(), chosen.tolist(), strict=True))
