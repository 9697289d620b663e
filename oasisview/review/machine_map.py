"""The machine's objects as the base of all corrections: their fragments, and a number for each fragment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from oasisview.review.fragments import Fragment, Members
from pipeline.result import ChangeLabel, MapObject, MatchCase, ReplacedEvent, Result, ScoreMatrix
from pipeline.settings import Settings


@dataclass(frozen=True)
class MachineMap:
    """What the machine found, as far as corrections build on it.

    Attributes:
        objects: by object id.
        replaced: the machine's replaced events.
        score_matrix: evidence between the objects of two visits; None where nothing is known.
        tau_d_m: displacement from which a thing has moved, metres.
        replaced_overlap: share of the smaller bounds that a replacement has in common with what it replaces.
    """

    objects: Mapping[int, MapObject]
    replaced: tuple[ReplacedEvent, ...] = ()
    score_matrix: ScoreMatrix | None = None
    tau_d_m: float = field(default_factory=lambda: Settings().change.tau_d_m)
    replaced_overlap: float = field(default_factory=lambda: Settings().change.replaced_overlap)

    @classmethod
    def of(cls, result: Result) -> MachineMap:
        """The map of a result, with the limits that it was decided with."""
        change = result.manifest.get("settings", {}).get("change", {})
        default = Settings().change
        return cls(
            {item.object_id: item for item in result.objects},
            result.replaced,
            result.score_matrix,
            float(change.get("tau_d_m", default.tau_d_m)),
            float(change.get("replaced_overlap", default.replaced_overlap)),
        )

    @classmethod
    def of_labels(cls, labels: Mapping[int, ChangeLabel]) -> MachineMap:
        """Objects of which only the label is known; each is one fragment of visit 0."""
        return cls({object_id: _bare_object(object_id, label) for object_id, label in labels.items()})

    @cached_property
    def members(self) -> Mapping[int, Members]:
        """Fragments of every object, by object id; an object without sightings counts as one of visit 0."""
        return {
            object_id: frozenset(Fragment(object_id, s.session) for s in item.sightings)
            or frozenset({Fragment(object_id, 0)})
            for object_id, item in self.objects.items()
        }

    @cached_property
    def number_of(self) -> Mapping[Fragment, int]:
        """A number for every fragment, the same whatever is corrected.

        The first fragment of an object has the object's id. Further ones have numbers above all ids, for the
        case that somebody says they are another object.
        """
        numbers: dict[Fragment, int] = {}
        following = max(self.objects, default=0) + 1
        for object_id in sorted(self.objects):
            for place, fragment in enumerate(sorted(self.members[object_id])):
                numbers[fragment] = object_id if place == 0 else following
                following += place > 0
        return numbers

    @cached_property
    def fragment_of(self) -> Mapping[int, Fragment]:
        """The fragment behind a number of :attr:`number_of`."""
        return {number: fragment for fragment, number in self.number_of.items()}

    def points(self, fragment: Fragment) -> int:
        """Map points of a fragment; 1 where its size is not known, so that it can be weighed."""
        sighting = self.objects[fragment.object_id].sighting(fragment.session)
        return max(sighting.point_count, 1) if sighting is not None else 1

    def is_whole(self, object_id: int, members: Members) -> bool:
        """Whether all fragments of a machine object are among ``members``."""
        return self.members[object_id] <= members

    def pair_evidence(self, before: int, after: int) -> tuple[float, float, MatchCase] | None:
        """sigma, s-bar and case of a row and a column of the score matrix; None where it has no such cell."""
        matrix = self.score_matrix
        if matrix is None or not (0 <= before < matrix.sigma.shape[0] and 0 <= after < matrix.sigma.shape[1]):
            return None
        sigma, s_bar = float(matrix.sigma[before, after]), float(matrix.s_bar[before, after])
        if s_bar >= matrix.tau_s:
            case = MatchCase.CONFIDENT if sigma >= matrix.tau_sigma else MatchCase.PARTIAL
        else:
            case = MatchCase.LOOKALIKE if sigma >= matrix.tau_sigma else MatchCase.NONE
        return round(float(np.clip(sigma, 0, 1)), 6), round(s_bar, 6), case


def _bare_object(object_id: int, label: ChangeLabel) -> MapObject:
    return MapObject(
        object_id=object_id,
        label=label,
        confidence=0.0,
        case=MatchCase.NONE,
        sigma=0.0,
        s_bar=0.0,
        coverage=0.0,
        displacement_m=None,
        rotation_rad=None,
        seen_through=0.0,
        appearance_change=None,
        decided_in_submap=None,
        counterpart_instance=None,
        replaced_by=None,
        replaces=None,
        sightings=(),
    )
