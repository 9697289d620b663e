"""From decisions to the typed result: identities, sightings, evidence, replaced events, belief."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import rotation_angle_rad
from pipeline.change.change_score import appearance_change
from pipeline.change.decide import Conclusion
from pipeline.change.decision import NOT_MET, Decision, VisitEvidence
from pipeline.change.replaced import find_replaced
from pipeline.correspondence.compare import VisitImages
from pipeline.result import ChangeLabel, MapObject, MatchCase, ReplacedEvent, ScoreMatrix, Sighting
from pipeline.settings import Settings

_BOUND_PERCENTILES = (1.0, 99.0)


@dataclass(frozen=True)
class Assembled:
    """What a result says about objects.

    Attributes:
        objects: ascending object id.
        replaced: events.
        score_matrix: accumulated evidence of all pairs.
        belief: (submaps, objects) label after each submap, 255 = not met yet.
        ids0, ids1: (K + 1,) object id of every instance; 0 for background.
    """

    objects: tuple[MapObject, ...]
    replaced: tuple[ReplacedEvent, ...]
    score_matrix: ScoreMatrix
    belief: NDArray[np.uint8]
    ids0: NDArray[np.int32]
    ids1: NDArray[np.int32]


@dataclass(frozen=True)
class _Bounds:
    """Robust axis-aligned bounds of the instances of a visit, (K + 1, 3) metres each."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]


def assemble(
    previous: VisitImages, current: VisitImages, conclusion: Conclusion, settings: Settings
) -> Assembled:
    """Number the objects and gather what the result says about each."""
    final = conclusion.decisions[-1]
    ids0, ids1 = _number(final, previous.objects.count, current.objects.count)
    bounds = (_bounds(previous), _bounds(current))
    sightings = _sightings((previous, current), conclusion, bounds)
    objects = _objects((ids0, ids1), sightings, conclusion, settings)
    replaced = _replaced(objects, settings)
    return Assembled(
        objects=_with_events(objects, replaced),
        replaced=replaced,
        score_matrix=_score_matrix(conclusion, ids0, ids1, settings),
        belief=_belief(conclusion, ids0, ids1, len(objects)),
        ids0=ids0,
        ids1=ids1,
    )


def _number(decision: Decision, count0: int, count1: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Object ids: previous instances in order, then the current ones that are not one of them."""
    ids0 = np.arange(count0 + 1, dtype=np.int32)
    ids1 = np.zeros(count1 + 1, np.int32)
    for identity in decision.identities:
        ids1[identity.current] = identity.previous
    new = np.flatnonzero(ids1[1:] == 0) + 1
    ids1[new] = count0 + 1 + np.arange(len(new))
    return ids0, ids1


def _bounds(visit: VisitImages) -> _Bounds:
    count = visit.objects.count
    low, high = np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    owner = visit.objects.instance_of_voxel
    voxels = np.flatnonzero(owner > 0)
    voxels = voxels[np.argsort(owner[voxels], kind="stable")]
    starts = np.searchsorted(owner[voxels], np.arange(count + 2))
    for instance in range(1, count + 1):
        points = visit.geometry.surface.points_world[voxels[starts[instance] : starts[instance + 1]]]
        low[instance], high[instance] = np.percentile(points, _BOUND_PERCENTILES, axis=0)
    return _Bounds(low, high)


def _sightings(
    visits: tuple[VisitImages, VisitImages], conclusion: Conclusion, bounds: tuple[_Bounds, _Bounds]
) -> tuple[list[Sighting], list[Sighting]]:
    """Sightings of all instances (counted from 1) of both visits."""
    found: tuple[list[Sighting], list[Sighting]] = ([], [])
    for session, (visit, evidence) in enumerate(
        zip(visits, (conclusion.previous, conclusion.current), strict=True)
    ):
        for instance in range(1, visit.objects.count + 1):
            pixels = visit.objects.view_pixels[:, instance]
            views = np.argsort(-pixels, kind="stable")
            low, high = bounds[session].low[instance], bounds[session].high[instance]
            found[session].append(
                Sighting(
                    session=session,
                    instance=instance - 1,
                    centroid_world_m=_triple(evidence.objects.centroid_world[instance]),
                    box_min_world_m=_triple(low),
                    box_max_world_m=_triple(high),
                    point_count=int(evidence.objects.voxel_count[instance]),
                    coverage=_rounded(evidence.objects.coverage[instance]),
                    keyframes=tuple(int(k) for k in views if pixels[k] > 0),
                )
            )
    return found


def _objects(
    ids: tuple[NDArray[np.int32], NDArray[np.int32]],
    sightings: tuple[list[Sighting], list[Sighting]],
    conclusion: Conclusion,
    settings: Settings,
) -> list[MapObject]:
    final = conclusion.decisions[-1]
    partner = {identity.previous: identity.current for identity in final.identities}
    settled = _settled(conclusion, ids)
    objects = []
    for instance in range(1, len(ids[0])):
        other = partner.get(instance)
        seen = (sightings[0][instance - 1], *((sightings[1][other - 1],) if other else ()))
        objects.append(
            _object(0, instance, other, int(ids[0][instance]), seen, conclusion, settings, settled)
        )
    matched = set(partner.values())
    for instance in range(1, len(ids[1])):
        if instance not in matched:
            seen = (sightings[1][instance - 1],)
            objects.append(
                _object(1, instance, None, int(ids[1][instance]), seen, conclusion, settings, settled)
            )
    return sorted(objects, key=lambda found: found.object_id)


def _object(
    axis: int,
    instance: int,
    partner: int | None,
    object_id: int,
    sightings: tuple[Sighting, ...],
    conclusion: Conclusion,
    settings: Settings,
    settled: dict[int, int],
) -> MapObject:
    final, association = conclusion.decisions[-1], conclusion.association
    visits: tuple[VisitEvidence, VisitEvidence] = (conclusion.previous, conclusion.current)
    labels = (final.labels0, final.labels1)[axis]
    confidences = (final.confidence0, final.confidence1)[axis]
    label = ChangeLabel(int(labels[instance]))
    counterpart = partner - 1 if partner else int(association.best_counterparts(axis)[instance - 1])
    sigma, s_bar, case = 0.0, 0.0, MatchCase.NONE
    if counterpart >= 0:
        pair = (instance - 1, counterpart) if axis == 0 else (counterpart, instance - 1)
        scores = association.evidence
        sigma = float((scores.sigma if axis == 0 else scores.sigma_backward)[pair])
        s_bar = float(scores.s_bar[pair])
        case = association.case(*pair)
    appearance = appearance_change(visits[axis].objects)[instance]
    motion = _motion(final, axis, instance) if partner else None
    displacement = None
    if len(sightings) == 2:
        before, after = (np.array(seen.centroid_world_m) for seen in sightings)
        if motion is not None:
            # Of a thing of which other parts were seen, the centroids are those of other points.
            after = motion[:3, :3] @ before + motion[:3, 3]
        displacement = _rounded(float(np.linalg.norm(after - before)))
    return MapObject(
        object_id=object_id,
        label=label,
        confidence=_rounded(confidences[instance]),
        case=case,
        sigma=_rounded(sigma),
        s_bar=_rounded(s_bar),
        coverage=min(seen.coverage for seen in sightings),
        displacement_m=displacement,
        rotation_rad=None if motion is None else _rounded(rotation_angle_rad(np.eye(3), motion[:3, :3])),
        seen_through=_rounded(visits[axis].objects.seen_through[instance]),
        appearance_change=None if np.isnan(appearance) else _rounded(appearance),
        decided_in_submap=settled.get(object_id),
        counterpart_instance=counterpart if counterpart >= 0 else None,
        replaced_by=None,
        replaces=None,
        sightings=sightings,
        T_world_motion=None if motion is None else tuple(tuple(map(_rounded, row)) for row in motion),
    )


def _motion(decision: Decision, axis: int, instance: int) -> NDArray[np.float64] | None:
    for identity in decision.identities:
        if instance == (identity.previous, identity.current)[axis]:
            return identity.T_world_motion
    return None


def _replaced(objects: list[MapObject], settings: Settings) -> tuple[ReplacedEvent, ...]:
    gone = [o for o in objects if o.label is ChangeLabel.DISAPPEARED]
    new = [o for o in objects if o.label is ChangeLabel.APPEARED]
    low0, high0, low1, high1 = (
        np.array([getattr(o.sightings[0], name) for o in group], np.float64).reshape(-1, 3)
        for group in (gone, new)
        for name in ("box_min_world_m", "box_max_world_m")
    )
    return tuple(
        ReplacedEvent(gone[e.disappeared].object_id, new[e.appeared].object_id, _rounded(e.overlap))
        for e in find_replaced(low0, high0, low1, high1, settings.change.replaced_overlap)
    )


def _with_events(objects: list[MapObject], replaced: tuple[ReplacedEvent, ...]) -> tuple[MapObject, ...]:
    replaced_by = {event.disappeared_id: event.appeared_id for event in replaced}
    replaces = {event.appeared_id: event.disappeared_id for event in replaced}
    return tuple(
        replace(o, replaced_by=replaced_by.get(o.object_id), replaces=replaces.get(o.object_id))
        for o in objects
    )


def _labels_by_object(
    decision: Decision, ids0: NDArray[np.int32], ids1: NDArray[np.int32], count: int
) -> NDArray[np.uint8]:
    labels = np.full(count + 1, NOT_MET, np.uint8)
    labels[ids1] = decision.labels1
    # The previous visit's object was known from the start; its label leads where both visits know it.
    labels[ids0] = decision.labels0
    return labels[1:]


def _belief(
    conclusion: Conclusion, ids0: NDArray[np.int32], ids1: NDArray[np.int32], count: int
) -> NDArray[np.uint8]:
    return np.stack([_labels_by_object(decision, ids0, ids1, count) for decision in conclusion.decisions])


def _settled(conclusion: Conclusion, ids: tuple[NDArray[np.int32], NDArray[np.int32]]) -> dict[int, int]:
    """The submap from which on each object kept its final label; nothing for those that stay unknown."""
    count = int(max(ids[0].max(initial=0), ids[1].max(initial=0)))
    belief = _belief(conclusion, ids[0], ids[1], count)
    final = belief[-1]
    differs = belief != final
    last_change = np.where(differs.any(axis=0), len(belief) - differs[::-1].argmax(axis=0), 0)
    return {
        int(number) + 1: int(last_change[number])
        for number in np.flatnonzero(final != ChangeLabel.UNKNOWN)
        if final[number] != NOT_MET
    }


def _score_matrix(
    conclusion: Conclusion, ids0: NDArray[np.int32], ids1: NDArray[np.int32], settings: Settings
) -> ScoreMatrix:
    evidence = conclusion.association.evidence
    return ScoreMatrix(
        sigma=evidence.sigma.astype(np.float32),
        sigma_backward=evidence.sigma_backward.astype(np.float32),
        s_bar=evidence.s_bar.astype(np.float32),
        match_count=evidence.link_count.astype(np.int32),
        row_object_ids=ids0[1:],
        column_object_ids=ids1[1:],
        tau_sigma=settings.association.tau_sigma,
        tau_s=settings.association.tau_s,
    )


def _triple(values: NDArray[np.floating]) -> tuple[float, float, float]:
    return (_rounded(values[0]), _rounded(values[1]), _rounded(values[2]))


def _rounded(value: float | np.floating) -> float:
    return round(float(value), 6)
