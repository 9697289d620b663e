"""The background: how much of it the map holds, and how much of it is wrongly called changed.

True background is what belongs to no object of the ground truth. A scored background unit that the map
labels appeared, disappeared or moved is a false change; of a map without any, every change lies on objects.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.evaluation.pointwise import CHANGES
from pipeline.evaluation.units import MISSED, MapPoints, Units
from pipeline.result import ChangeLabel


@dataclass(frozen=True)
class BackgroundScores:
    """Background of all visits.

    Attributes:
        true_units: scored units of the true background.
        changed: those labelled as changed; unknown: left unknown; missed: without a map point in reach.
        in_objects: those that the map gives to some object, whatever its label.
        map_points: points of the map that belong to no object, per visit; all_map_points: all of them.
    """

    true_units: int
    changed: int
    unknown: int
    missed: int
    in_objects: int
    map_points: tuple[int, ...]
    all_map_points: tuple[int, ...]

    @property
    def changed_rate(self) -> float | None:
        """Share of the true background that is called changed; None without any background."""
        return self.changed / self.true_units if self.true_units else None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return {
            "true_units": self.true_units,
            "changed": self.changed,
            "changed_rate": self.changed_rate,
            "unknown": self.unknown,
            "missed": self.missed,
            "in_objects": self.in_objects,
            "map_points": list(self.map_points),
            "all_map_points": list(self.all_map_points),
        }


def background_scores(units: Units, visits: tuple[MapPoints, ...]) -> BackgroundScores:
    """Count the background of the ground truth and of the map."""
    background = units.scored & (units.true_object == 0)
    label, owner = units.predicted_label[background], units.predicted_object[background]
    return BackgroundScores(
        true_units=len(label),
        changed=int(np.count_nonzero(np.isin(label, CHANGES))),
        unknown=int(np.count_nonzero(label == ChangeLabel.UNKNOWN)),
        missed=int(np.count_nonzero(label == MISSED)),
        in_objects=int(np.count_nonzero(owner > 0)),
        map_points=tuple(int(np.count_nonzero(visit.object_id == 0)) for visit in visits),
        all_map_points=tuple(len(visit.object_id) for visit in visits),
    )
