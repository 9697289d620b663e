"""Change metrics of Khronos (Schmid et al., RSS 2024; ``ObjectEvaluator`` of the published code).

Objects are matched by surface votes, in both directions separately: every surface point of an object votes
for the object of the nearest surface point on the other side, if that is within the matching distance, and
the object with most votes is the match. Several objects may match the same one. An object of the map
without a match is *hallucinated*, one of the ground truth is *missed*.

Appeared and disappeared are then flags of an object: true positive when a map object and its match have the
flag, false positive when only the map object has it, false negative when a true object has it and its match
(in the direction from truth to map) has not. Change pools both. These scores leave unmatched objects out,
which flatters; the *including* variants count flagged hallucinated objects as false positives and flagged
missed ones as false negatives.

What differs here: Khronos knows no *moved* label, so a moved object is two objects, one that disappeared and
one that appeared; a static object is one object with the points of both visits. One query at the end of
the current visit instead of a grid of times. No classes, so no semantic gate. True objects that are not
scored take part in the matching, and what matches them counts nowhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.evaluation.counts import Counts
from pipeline.evaluation.matched import Matched
from pipeline.evaluation.tables import COUNT_HEADER, aligned, count_row
from pipeline.evaluation.units import SCORED_LABELS, voxel_means
from pipeline.result import ChangeLabel

MATCHING_DISTANCE_M = 0.5  # the published configuration says 2 m, its comment recommends 0.5 m for surfaces

_NONE = -1


@dataclass(frozen=True)
class FlaggedObject:
    """An object of one side: (N, 3) surface points, what became of it, and whether it is scored."""

    points_world: NDArray[np.float64]
    appeared: bool = False
    disappeared: bool = False
    scored: bool = True


@dataclass(frozen=True)
class KhronosScores:
    """Counts of objects and of changes.

    Attributes:
        objects: TP = map objects with a match, FP = hallucinated, FN = missed.
        recalled: true objects with a match, of all scored ones: recall of objects is counted from there.
        appeared, disappeared: over matched objects; the ``_including`` ones over all objects.
    """

    objects: Counts
    recalled: int
    appeared: Counts
    disappeared: Counts
    appeared_including: Counts
    disappeared_including: Counts

    @property
    def change(self) -> Counts:
        """Both kinds of change over matched objects."""
        return self.appeared + self.disappeared

    @property
    def change_including(self) -> Counts:
        """Both kinds of change, hallucinated and missed objects included."""
        return self.appeared_including + self.disappeared_including

    @property
    def object_recall(self) -> float | None:
        """Share of the scored true objects that have a match."""
        total = self.recalled + self.objects.fn
        return self.recalled / total if total else None

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        names = ("appeared", "disappeared", "change")
        return {
            "objects": {
                "matched": self.objects.tp,
                "hallucinated": self.objects.fp,
                "recalled": self.recalled,
                "missed": self.objects.fn,
                "precision": self.objects.precision,
                "recall": self.object_recall,
            },
            **{name: getattr(self, name).to_dict() for name in names},
            **{f"{name}_including": getattr(self, f"{name}_including").to_dict() for name in names},
        }

    def lines(self) -> list[str]:
        """The table."""
        rows = [
            ("appeared", self.appeared),
            ("disappeared", self.disappeared),
            ("change", self.change),
            ("appeared, including", self.appeared_including),
            ("disappeared, including", self.disappeared_including),
            ("change, including", self.change_including),
        ]
        return [
            f"{self.objects.tp} objects matched, {self.objects.fp} hallucinated; "
            f"{self.recalled} true objects recalled, {self.objects.fn} missed",
            *aligned([("changes", *COUNT_HEADER), *(count_row(*row) for row in rows)]),
        ]


def khronos_scores(matched: Matched, matching_distance_m: float = MATCHING_DISTANCE_M) -> KhronosScores:
    """Score a result of two visits."""
    return score_objects(predicted_objects(matched), true_objects(matched), matching_distance_m)


def score_objects(
    predicted: Sequence[FlaggedObject], true: Sequence[FlaggedObject], matching_distance_m: float
) -> KhronosScores:
    """Match both ways and count."""
    to_true = surface_votes(predicted, true, matching_distance_m)
    to_predicted = surface_votes(true, predicted, matching_distance_m)
    flags = ("appeared", "disappeared")
    counts = {flag: Counts() for flag in flags}
    extra = {flag: Counts() for flag in flags}
    found = hallucinated = recalled = missed = 0
    for item, partner in zip(predicted, to_true, strict=True):
        if partner != _NONE and not true[partner].scored:
            continue
        found += partner != _NONE
        hallucinated += partner == _NONE
        for flag in flags:
            if not getattr(item, flag):
                continue
            if partner == _NONE:
                extra[flag] += Counts(fp=1)
            elif getattr(true[partner], flag):
                counts[flag] += Counts(tp=1)
            else:
                counts[flag] += Counts(fp=1)
    for item, partner in zip(true, to_predicted, strict=True):
        if not item.scored:
            continue
        recalled += partner != _NONE
        missed += partner == _NONE
        for flag in flags:
            if not getattr(item, flag):
                continue
            if partner == _NONE:
                extra[flag] += Counts(fn=1)
            elif not getattr(predicted[partner], flag):
                counts[flag] += Counts(fn=1)
    return KhronosScores(
        objects=Counts(tp=found, fp=hallucinated, fn=missed),
        recalled=recalled,
        appeared=counts["appeared"],
        disappeared=counts["disappeared"],
        appeared_including=counts["appeared"] + extra["appeared"],
        disappeared_including=counts["disappeared"] + extra["disappeared"],
    )


def surface_votes(
    objects: Sequence[FlaggedObject], others: Sequence[FlaggedObject], matching_distance_m: float
) -> list[int]:
    """For each object the position of the other one with most votes; -1 = none in reach."""
    if not others:
        return [_NONE] * len(objects)
    tree = cKDTree(np.concatenate([other.points_world for other in others]))
    owner = np.repeat(np.arange(len(others)), [len(other.points_world) for other in others])
    winners = []
    for item in objects:
        distance, nearest = tree.query(item.points_world, distance_upper_bound=matching_distance_m)
        votes = np.bincount(owner[nearest[np.isfinite(distance)]], minlength=len(others))
        winners.append(int(votes.argmax()) if votes.any() else _NONE)
    return winners


def true_objects(matched: Matched) -> list[FlaggedObject]:
    """Objects of the ground truth; moved ones twice."""
    units = matched.units
    chosen = units.true_object > 0
    return _flagged(
        units.points_world[chosen],
        units.true_object[chosen],
        units.session[chosen],
        units.true_label[chosen],
    )


def predicted_objects(matched: Matched) -> list[FlaggedObject]:
    """Objects of the result, their points thinned like the ground truth; moved ones twice."""
    parts: list[list[NDArray]] = [[], [], [], []]
    for session, visit in enumerate(matched.visits):
        chosen = visit.object_id > 0
        if not chosen.any():
            continue
        keys: list[NDArray] = [visit.object_id[chosen], visit.label[chosen]]
        points, (owner, label) = voxel_means(visit.points_world[chosen], keys)
        for part, values in zip(parts, (points, owner, np.full(len(owner), session), label), strict=True):
            part.append(values)
    if not parts[0]:
        return []
    points, owner, sessions, label = (np.concatenate(part) for part in parts)
    return _flagged(points, owner, sessions, label, all_scored=True)


def _flagged(
    points: NDArray[np.float64],
    owner: NDArray[np.int64],
    session: NDArray[np.int64],
    label: NDArray[np.int64],
    all_scored: bool = False,
) -> list[FlaggedObject]:
    groups: dict[tuple[int, int], list[NDArray[np.int64]]] = {}
    labels: dict[tuple[int, int], int] = {}
    for object_id in np.unique(owner).tolist():
        for visit in np.unique(session[owner == object_id]).tolist():
            rows = np.flatnonzero((owner == object_id) & (session == visit))
            main = int(np.bincount(label[rows]).argmax())
            key = (object_id, _NONE if main == ChangeLabel.STATIC else visit)
            groups.setdefault(key, []).append(rows)
            labels[key] = main
    objects = []
    for key, rows_of_visits in groups.items():
        main, first_visit = labels[key], key[1] == 0
        moved = main == ChangeLabel.MOVED
        objects.append(
            FlaggedObject(
                points_world=points[np.concatenate(rows_of_visits)],
                appeared=main == ChangeLabel.APPEARED or (moved and not first_visit),
                disappeared=main == ChangeLabel.DISAPPEARED or (moved and first_visit),
                scored=all_scored or main in SCORED_LABELS,
            )
        )
    return objects
