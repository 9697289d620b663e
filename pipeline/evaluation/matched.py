"""A result laid over its ground truth once: what every metric and every preset counts on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipeline.errors import InputError
from pipeline.evaluation.ground_truth import GroundTruth
from pipeline.evaluation.overlap import Overlap, object_overlap
from pipeline.evaluation.units import MapPoints, Units, match_radius_m, match_units, predicted_points
from pipeline.result import ChangeLabel, MapObject, Result


@dataclass(frozen=True)
class Matched:
    """A result and its ground truth, matched unit by unit.

    Attributes:
        radius_m: match radius, metres.
        visits: the result's labelled points, one entry per visit.
        labels: scored label of each object of the result (overrides applied).
        overridden: whether any label other than the machine's is scored.
    """

    result: Result
    truth: GroundTruth
    radius_m: float
    visits: tuple[MapPoints, ...]
    units: Units
    labels: Mapping[int, ChangeLabel]
    overridden: bool

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Overlap of true and predicted objects, per visit."""
        return tuple(object_overlap(self.units, session) for session in range(len(self.visits)))

    @cached_property
    def objects(self) -> dict[int, MapObject]:
        """The result's objects by id."""
        return {item.object_id: item for item in self.result.objects}

    @cached_property
    def predicted_counts(self) -> tuple[int, ...]:
        """Objects of the result with points in each visit, those far from all ground truth included."""
        return tuple(int(np.count_nonzero(np.unique(visit.object_id))) for visit in self.visits)

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Consecutive visits."""
        return tuple((session, session + 1) for session in range(len(self.visits) - 1))


def match(
    result: Result,
    truth: GroundTruth,
    radius_m: float | None = None,
    labels: Mapping[int, ChangeLabel] | None = None,
) -> Matched:
    """Lay a result over its ground truth; arguments as in ``evaluator.evaluate``.

    Raises:
        InputError: an impossible radius, or a ground truth that does not belong to the result.
    """
    if radius_m is not None and not (math.isfinite(radius_m) and radius_m > 0):
        raise InputError(f"a match radius of {radius_m} m is impossible", "give a length above 0, in metres")
    visits = predicted_points(result, labels)
    radius = match_radius_m(visits) if radius_m is None else radius_m
    return Matched(
        result=result,
        truth=truth,
        radius_m=radius,
        visits=visits,
        units=match_units(truth.points, visits, radius),
        labels={item.object_id: item.label for item in result.objects} | dict(labels or {}),
        overridden=bool(labels),
    )
