"""Replaced events, scored apart from plain appearances and disappearances (paper, Table I).

The four columns of the paper are four classes here: static, moved, replaced, and appeared or
disappeared outside any replaced event. True replaced pairs are read off the ground truth itself:
a disappeared and an appeared object whose bounds share at least ``MIN_SHARED_BOUNDS`` of the smaller
one, paired one to one by the greatest overlap. A unit is predicted replaced when its object belongs to
a replaced event of the result and carries the label appeared or disappeared.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pipeline.evaluation.counts import Counts
from pipeline.evaluation.pointwise import count_class
from pipeline.evaluation.units import UNIT_SIZE_M, Units
from pipeline.result import ChangeLabel, ReplacedEvent

MIN_SHARED_BOUNDS = 0.25

_APPEARED_DISAPPEARED, _REPLACED = 101, 102  # classes beside the codes of ChangeLabel
_GONE_OR_NEW = (ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED)


@dataclass(frozen=True)
class ReplacedScores:
    """The paper's columns, point by point, and replaced events as pairs.

    Attributes:
        static, appeared_disappeared, replaced, moved: counts of units, the four classes exclusive.
        events: counts of pairs; a predicted pair is right when the points of both its objects lie on
            the two objects of one true pair (most of their units).
    """

    static: Counts
    appeared_disappeared: Counts
    replaced: Counts
    moved: Counts
    events: Counts

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        names = ("static", "appeared_disappeared", "replaced", "moved", "events")
        return {name: getattr(self, name).to_dict() for name in names}


def replaced_scores(units: Units, events: tuple[ReplacedEvent, ...]) -> ReplacedScores:
    """Score replaced events and the paper's four classes."""
    pairs = true_replaced_pairs(units)
    in_true_pair = np.isin(units.true_object, [object_id for pair in pairs for object_id in pair])
    in_event = np.isin(
        units.predicted_object,
        [object_id for event in events for object_id in (event.disappeared_id, event.appeared_id)],
    )
    scored = units.scored
    true = _paper_class(units.true_label, in_true_pair)[scored]
    predicted = _paper_class(units.predicted_label, in_event)[scored]
    found = {
        (_main_true_object(units, event.disappeared_id, 0), _main_true_object(units, event.appeared_id, 1))
        for event in events
    } & set(pairs)
    return ReplacedScores(
        static=count_class(true, predicted, ChangeLabel.STATIC),
        appeared_disappeared=count_class(true, predicted, _APPEARED_DISAPPEARED),
        replaced=count_class(true, predicted, _REPLACED),
        moved=count_class(true, predicted, ChangeLabel.MOVED),
        events=Counts(tp=len(found), fp=len(events) - len(found), fn=len(pairs) - len(found)),
    )


def true_replaced_pairs(units: Units) -> tuple[tuple[int, int], ...]:
    """(disappeared, appeared) objects of the ground truth that stood in the same place."""
    gone = _bounds(units, ChangeLabel.DISAPPEARED)
    new = _bounds(units, ChangeLabel.APPEARED)
    if not gone or not new:
        return ()
    overlap = np.array([[_shared(a, b) for b in new.values()] for a in gone.values()])
    rows, columns = linear_sum_assignment(-np.where(overlap >= MIN_SHARED_BOUNDS, overlap, 0.0))
    gone_ids, new_ids = list(gone), list(new)
    return tuple(
        (gone_ids[row], new_ids[column])
        for row, column in zip(rows, columns, strict=True)
        if overlap[row, column] >= MIN_SHARED_BOUNDS
    )


def _paper_class(labels: NDArray[np.int64], replaced: NDArray[np.bool_]) -> NDArray[np.int64]:
    classes = labels.copy()
    gone_or_new = np.isin(labels, _GONE_OR_NEW)
    classes[gone_or_new] = _APPEARED_DISAPPEARED
    classes[gone_or_new & replaced] = _REPLACED
    return classes


def _bounds(units: Units, label: ChangeLabel) -> dict[int, tuple[NDArray, NDArray]]:
    """Bounds of each object of a label, grown by half a unit so that flat objects have a volume."""
    chosen = (units.true_label == label) & (units.true_object > 0)
    bounds = {}
    for object_id in np.unique(units.true_object[chosen]).tolist():
        points = units.points_world[chosen & (units.true_object == object_id)]
        bounds[object_id] = (points.min(axis=0) - UNIT_SIZE_M / 2, points.max(axis=0) + UNIT_SIZE_M / 2)
    return bounds


def _shared(a: tuple[NDArray, NDArray], b: tuple[NDArray, NDArray]) -> float:
    """Volume that two boxes have in common over the smaller one's."""
    sides = np.minimum(a[1], b[1]) - np.maximum(a[0], b[0])
    common = float(np.prod(np.clip(sides, 0.0, None)))
    return common / float(min(np.prod(a[1] - a[0]), np.prod(b[1] - b[0])))


def _main_true_object(units: Units, predicted_object: int, session: int) -> int:
    """True object under most units of a predicted one in a visit; 0 if background or none."""
    here = units.true_object[(units.predicted_object == predicted_object) & (units.session == session)]
    return int(np.bincount(here).argmax()) if len(here) else 0
