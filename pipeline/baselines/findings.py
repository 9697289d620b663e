"""From what a baseline found to an outcome that is written like any other: the one place that adapts.

The score matrix of a baseline's result holds the patch matches between its objects, as in every result: they
show people what the images say. No baseline decides by them; what it did decide by is in the evidence table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.assemble import Assembled
from pipeline.association.aggregation import MatchEvidence
from pipeline.association.cases import match_case
from pipeline.baselines.instances import InstanceGeometry, instance_geometry
from pipeline.change.observation import Observation
from pipeline.change.replaced import find_replaced
from pipeline.correspondence.compare import Comparison, VisitImages
from pipeline.methods import MappedVisits, Outcome
from pipeline.result import ChangeLabel, MapObject, MatchCase, ReplacedEvent, ScoreMatrix, Sighting
from pipeline.settings import Settings

# Label code of an object that nobody has seen yet.
NOT_MET = 255


@dataclass(frozen=True)
class Findings:
    """What a baseline says; arrays are (K + 1,) per visit, entry 0 is background.

    Attributes:
        identities: (previous, current) instances, counted from 1, that are one object; one-to-one.
        labels: ``ChangeLabel`` codes of the previous and the current instances.
        confidences: of the labels, in [0, 1].
        beliefs: labels of both visits after each submap of the current one, without the last: that is
            ``labels``. ``NOT_MET`` for objects that nobody had seen by then.
        evidence: what it decided by, a column per name, for either visit.
        collections: instances of either visit that pool what lies scattered; never part of an event.
    """

    identities: tuple[tuple[int, int], ...]
    labels: tuple[NDArray[np.int64], NDArray[np.int64]]
    confidences: tuple[NDArray[np.float64], NDArray[np.float64]]
    beliefs: tuple[tuple[NDArray[np.int64], NDArray[np.int64]], ...]
    evidence: tuple[Mapping[str, NDArray[np.float64]], Mapping[str, NDArray[np.float64]]]
    collections: tuple[frozenset[int], frozenset[int]] = field(default=(frozenset(), frozenset()))


def undecided_until_the_end(
    mapped: MappedVisits, visits: tuple[VisitImages, VisitImages]
) -> tuple[tuple[NDArray[np.int64], NDArray[np.int64]], ...]:
    """Beliefs of a method that compares finished visits: unknown as soon as met, until the last submap."""
    previous, current = visits
    first = _first_keyframes(current)
    submaps = np.array([keyframe.submap for keyframe in mapped.geometries[1].keyframes])
    first_submap = np.where(first < len(submaps), submaps[np.minimum(first, len(submaps) - 1)], len(submaps))
    known = np.full(previous.objects.count + 1, int(ChangeLabel.UNKNOWN), np.int64)
    return tuple(
        (known, np.where(first_submap <= submap, int(ChangeLabel.UNKNOWN), NOT_MET))
        for submap in range(mapped.geometries[1].submap_count - 1)
    )


def _first_keyframes(visit: VisitImages) -> NDArray[np.int64]:
    """(K + 1,) the keyframe that first met each instance; a large number where none did."""
    first = np.full(visit.objects.count + 1, np.iinfo(np.int32).max, np.int64)
    np.minimum.at(first, visit.objects.instance_of_voxel, visit.geometry.first_keyframe)
    return first


def outcome(
    mapped: MappedVisits,
    visits: tuple[VisitImages, VisitImages],
    comparison: Comparison,
    findings: Findings,
) -> Outcome:
    """Number the objects and gather what a result says about each."""
    settings = mapped.settings
    observed = (mapped.observation.of_previous, mapped.observation.of_current)
    geometries = [instance_geometry(visit.geometry, visit.objects) for visit in visits]
    seen = [_seen(visit, view, settings) for visit, view in zip(visits, observed, strict=True)]
    ids = _number(findings, visits[0].objects.count, visits[1].objects.count)
    patches = _total(comparison, visits)
    sightings = tuple(
        _sightings(session, visits[session], geometries[session], seen[session][0]) for session in range(2)
    )
    belief = _belief(findings, ids)
    objects = _objects(findings, ids, sightings, (seen[0][1], seen[1][1]), patches, belief, settings)
    replaced = _replaced(objects, _pooled_ids(findings, ids), settings)
    matrix = ScoreMatrix(
        sigma=patches.sigma.astype(np.float32),
        sigma_backward=patches.sigma_backward.astype(np.float32),
        s_bar=patches.s_bar.astype(np.float32),
        match_count=patches.link_count.astype(np.int32),
        row_object_ids=ids[0][1:],
        column_object_ids=ids[1][1:],
        tau_sigma=settings.association.tau_sigma,
        tau_s=settings.association.tau_s,
    )
    assembled = Assembled(_with_events(objects, replaced), replaced, matrix, belief, ids[0], ids[1])
    tables = [
        _table({"voxel_count": g.voxel_count, "coverage": c, "seen_through": t, **columns})
        for g, (c, t), columns in zip(geometries, seen, findings.evidence, strict=True)
    ]
    return Outcome(assembled, (tables[0], tables[1]), {})


def _seen(
    visit: VisitImages, view: Observation, settings: Settings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(K + 1,) coverage and seen-through share of each instance by the other visit."""
    owner, size = visit.objects.instance_of_voxel, visit.objects.count + 1
    total = np.bincount(owner, minlength=size)
    observed = np.bincount(owner, view.is_observed, size)
    through = np.bincount(owner, view.is_seen_through(settings.observation), size)
    return observed / np.maximum(total, 1), np.minimum(through / np.maximum(observed, 1), 1.0)


def _number(findings: Findings, count0: int, count1: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Object ids: previous instances in order, then the current ones that are not one of them."""
    ids0 = np.arange(count0 + 1, dtype=np.int32)
    ids1 = np.zeros(count1 + 1, np.int32)
    for previous, current in findings.identities:
        ids1[current] = previous
    new = np.flatnonzero(ids1[1:] == 0) + 1
    ids1[new] = count0 + 1 + np.arange(len(new))
    return ids0, ids1


def _total(comparison: Comparison, visits: tuple[VisitImages, VisitImages]) -> MatchEvidence:
    total = MatchEvidence.empty(visits[0].objects.count, visits[1].objects.count)
    for local in comparison.evidence:
        total.merge(local)
    return total


def _sightings(
    session: int, visit: VisitImages, geometry: InstanceGeometry, coverage: NDArray[np.float64]
) -> list[Sighting]:
    """Sightings of the instances of a visit, counted from 1."""
    found = []
    for instance in range(1, visit.objects.count + 1):
        pixels = visit.objects.view_pixels[:, instance]
        found.append(
            Sighting(
                session=session,
                instance=instance - 1,
                centroid_world_m=_triple(geometry.centroid_world[instance]),
                box_min_world_m=_triple(geometry.low_world[instance]),
                box_max_world_m=_triple(geometry.high_world[instance]),
                point_count=int(geometry.voxel_count[instance]),
                coverage=_rounded(coverage[instance]),
                keyframes=tuple(int(k) for k in np.argsort(-pixels, kind="stable") if pixels[k] > 0),
            )
        )
    return found


def _objects(
    findings: Findings,
    ids: tuple[NDArray[np.int32], NDArray[np.int32]],
    sightings: tuple[list[Sighting], ...],
    seen_through: tuple[NDArray[np.float64], NDArray[np.float64]],
    patches: MatchEvidence,
    belief: NDArray[np.uint8],
    settings: Settings,
) -> list[MapObject]:
    partners = dict(findings.identities)
    matched = set(partners.values())
    entries = [(0, instance, partners.get(instance)) for instance in range(1, len(ids[0]))]
    entries += [(1, instance, None) for instance in range(1, len(ids[1])) if instance not in matched]
    objects = []
    for visit, instance, partner in entries:
        seen = (sightings[visit][instance - 1], *((sightings[1][partner - 1],) if partner else ()))
        counterpart = partner - 1 if partner else _best_counterpart(patches, visit, instance - 1)
        sigma, s_bar, case = 0.0, 0.0, MatchCase.NONE
        if counterpart >= 0:
            pair = (instance - 1, counterpart) if visit == 0 else (counterpart, instance - 1)
            sigma = float((patches.sigma if visit == 0 else patches.sigma_backward)[pair])
            s_bar = float(patches.s_bar[pair])
            gates = settings.association
            case = match_case(float(patches.sigma[pair]), s_bar, gates.tau_sigma, gates.tau_s)
        displacement = None
        if len(seen) == 2:
            before, after = (np.array(sighting.centroid_world_m) for sighting in seen)
            displacement = _rounded(float(np.linalg.norm(after - before)))
        label = ChangeLabel(int(findings.labels[visit][instance]))
        object_id = int(ids[visit][instance])
        objects.append(
            MapObject(
                object_id=object_id,
                label=label,
                confidence=_rounded(findings.confidences[visit][instance]),
                case=case,
                sigma=_rounded(sigma),
                s_bar=_rounded(s_bar),
                coverage=min(sighting.coverage for sighting in seen),
                displacement_m=displacement,
                rotation_rad=None,
                seen_through=_rounded(seen_through[visit][instance]),
                appearance_change=None,
                decided_in_submap=_settled(belief[:, object_id - 1]),
                counterpart_instance=counterpart if counterpart >= 0 else None,
                replaced_by=None,
                replaces=None,
                sightings=seen,
            )
        )
    return sorted(objects, key=lambda found: found.object_id)


def _best_counterpart(patches: MatchEvidence, visit: int, instance: int) -> int:
    score = patches.sigma[instance] if visit == 0 else patches.sigma_backward[:, instance]
    return int(score.argmax()) if score.size and score.max() > 0 else -1


def _pooled_ids(findings: Findings, ids: tuple[NDArray[np.int32], NDArray[np.int32]]) -> set[int]:
    return {int(ids[visit][i]) for visit, pooled in enumerate(findings.collections) for i in pooled}


def _replaced(objects: list[MapObject], pooled: set[int], settings: Settings) -> tuple[ReplacedEvent, ...]:
    """Events by the rule that all methods share: a gone and a new object whose bounds overlap."""
    groups = [
        [o for o in objects if o.label is label and o.object_id not in pooled]
        for label in (ChangeLabel.DISAPPEARED, ChangeLabel.APPEARED)
    ]
    bounds = [
        np.array([getattr(o.sightings[0], name) for o in group], np.float64).reshape(-1, 3)
        for group in groups
        for name in ("box_min_world_m", "box_max_world_m")
    ]
    return tuple(
        ReplacedEvent(
            groups[0][e.disappeared].object_id, groups[1][e.appeared].object_id, _rounded(e.overlap)
        )
        for e in find_replaced(bounds[0], bounds[1], bounds[2], bounds[3], settings.change.replaced_overlap)
    )


def _with_events(objects: list[MapObject], replaced: tuple[ReplacedEvent, ...]) -> tuple[MapObject, ...]:
    replaced_by = {event.disappeared_id: event.appeared_id for event in replaced}
    replaces = {event.appeared_id: event.disappeared_id for event in replaced}
    return tuple(
        replace(o, replaced_by=replaced_by.get(o.object_id), replaces=replaces.get(o.object_id))
        for o in objects
    )


def _belief(findings: Findings, ids: tuple[NDArray[np.int32], NDArray[np.int32]]) -> NDArray[np.uint8]:
    count = int(max(ids[0].max(initial=0), ids[1].max(initial=0)))
    rows = []
    for labels0, labels1 in (*findings.beliefs, findings.labels):
        row = np.full(count + 1, NOT_MET, np.uint8)
        row[ids[1]] = labels1
        # The previous visit's object was known from the start; its label leads where both visits know it.
        row[ids[0]] = labels0
        rows.append(row[1:])
    return np.stack(rows)


def _settled(labels: NDArray[np.uint8]) -> int | None:
    """The submap from which on an object kept its final label; None while it stays unknown."""
    if labels[-1] in (ChangeLabel.UNKNOWN, NOT_MET):
        return None
    differs = np.flatnonzero(labels != labels[-1])
    return int(differs[-1]) + 1 if len(differs) else 0


def _table(columns: Mapping[str, NDArray[np.generic]]) -> NDArray[np.void]:
    """(K,) structured rows of (K + 1,) columns, background left out."""
    kinds = [
        (name, np.int64 if values.dtype.kind in "iu" else np.float64) for name, values in columns.items()
    ]
    rows = np.zeros(len(next(iter(columns.values()))) - 1, np.dtype(kinds))
    for name, values in columns.items():
        rows[name] = values[1:]
    return rows


def _triple(values: NDArray[np.floating]) -> tuple[float, float, float]:
    return (_rounded(values[0]), _rounded(values[1]), _rounded(values[2]))


def _rounded(value: float | np.floating) -> float:
    return round(float(value), 6)
