"""Stage "decide": labels after every submap of the current visit; the last ones are final."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.association.accumulation import AccumulatedAssociation
from pipeline.association.moves import Candidate, ScoredMove, score_moves
from pipeline.association.object_clouds import ObjectClouds, cell_m
from pipeline.change.appearance import AppearanceResidual, appearance_residual
from pipeline.change.change_score import change_log_odds
from pipeline.change.colocation import nearest_instances, overlap_matrix
from pipeline.change.decision import Decision, VisitEvidence, decide_by_association, decide_by_evidence
from pipeline.change.evidence import object_evidence
from pipeline.change.move_choice import MoveChoice
from pipeline.change.observation import Observation
from pipeline.change.observe import MutualObservation
from pipeline.change.prints import Prints, PrintSupport, find_prints
from pipeline.correspondence.compare import Comparison, VisitImages
from pipeline.correspondence.heatmaps import change_of_similarity
from pipeline.correspondence.pattern import PatternAgreement
from pipeline.correspondence.place_similarity import PlaceSimilarity
from pipeline.perception.protocols import FeatureExtractor
from pipeline.settings import Settings


@dataclass(frozen=True)
class Conclusion:
    """What was decided, and what it rests on.

    Attributes:
        decisions: one per submap of the current visit; the last one is final.
        previous, current: final evidence per object.
        association: accumulated scores of all pairs.
        moves: pairs of changed objects that were laid over each other, chosen or not.
        appearance_scale: spread of the colour residual between the visits, log units: a quality figure.
        overlap: (n, m) of the objects' places, voxel intersection over union; None where the rule needs none.
    """

    decisions: tuple[Decision, ...]
    previous: VisitEvidence
    current: VisitEvidence
    association: AccumulatedAssociation
    moves: tuple[ScoredMove, ...]
    appearance_scale: float
    overlap: NDArray[np.float64] | None = None


def decide(
    previous: VisitImages,
    current: VisitImages,
    observation: MutualObservation,
    comparison: Comparison,
    patterns: tuple[list[PatternAgreement], list[PatternAgreement]],
    extractor: FeatureExtractor,
    settings: Settings,
    on_submap: Callable[[int], None],
) -> Conclusion:
    """Accumulate the evidence submap by submap, and decide after each."""
    association = AccumulatedAssociation(previous.objects.count, current.objects.count, settings.association)
    seen_so_far = Observation(len(previous.geometry.surface.points_world))
    similarity = (PlaceSimilarity.empty(previous.objects.count), PlaceSimilarity.empty(current.objects.count))
    pattern = (PatternAgreement.empty(previous.objects.count), PatternAgreement.empty(current.objects.count))
    last_keyframe = _last_keyframes(current)
    prints = find_prints(previous, current, cell_m(previous.geometry), settings)
    # The previous visit was seen as a whole before the current one began.
    compared1 = _compared(current, observation.of_current, settings)
    evidence: list[tuple[VisitEvidence, VisitEvidence]] = []
    decisions: list[Decision] = []
    for submap, local in enumerate(comparison.evidence):
        association.add_submap(local)
        seen_so_far.add_sparse(observation.by_submap[submap])
        similarity[0].merge(comparison.similarity0[submap])
        similarity[1].merge(comparison.similarity1[submap])
        for so_far, added in zip(pattern, patterns, strict=True):
            so_far.add(added[submap])
        is_met = current.geometry.first_keyframe <= last_keyframe[submap]
        is_met_object = np.bincount(current.objects.instance_of_voxel, is_met, current.objects.count + 1) > 0
        prints0, prints1 = prints.support(is_met_object)
        dissimilarity = [change_of_similarity(s.mean, extractor.similarity) for s in similarity]
        compared0 = _compared(previous, seen_so_far, settings)
        evidence0 = _visit_evidence(
            previous, compared0, ~observation.is_noise0, dissimilarity[0], pattern[0], prints0, settings
        )
        evidence1 = _visit_evidence(
            current,
            compared1,
            is_met & ~observation.is_noise1,
            dissimilarity[1],
            pattern[1],
            prints1,
            settings,
        )
        evidence.append((evidence0, evidence1))
        if settings.change.rule == "paper":
            is_final = submap + 1 == len(last_keyframe)
            decisions.append(
                decide_by_association(evidence0, evidence1, association, settings.change, is_final=is_final)
            )
        on_submap(submap + 1)
    moves: list[ScoredMove] = []
    overlap: NDArray[np.float64] | None = None
    if settings.change.rule == "evidence":
        log_gain = compared1.appearance.log_gain
        moves = _scored_moves((previous, current), evidence[-1], prints, log_gain, settings)
        find_moves = MoveChoice(moves, evidence[-1], settings)
        nearest0, nearest1 = _nearest(previous, current), _nearest(current, previous)
        for submap, pair in enumerate(evidence):
            is_met = current.geometry.first_keyframe <= last_keyframe[submap]
            overlap = overlap_matrix(
                previous.objects.instance_of_voxel,
                nearest0,
                previous.objects.count,
                np.where(is_met, current.objects.instance_of_voxel, 0),
                np.where(is_met, nearest1, 0),
                current.objects.count,
            )
            decisions.append(decide_by_evidence(*pair, overlap, find_moves, find_moves.likeliest, settings))
    scale = max(compared0.appearance.scale, compared1.appearance.scale)
    return Conclusion(tuple(decisions), *evidence[-1], association, tuple(moves), scale, overlap)


def _last_keyframes(visit: VisitImages) -> list[int]:
    """The last keyframe of every submap."""
    submaps = [keyframe.submap for keyframe in visit.geometry.keyframes]
    return [len(submaps) - 1 - submaps[::-1].index(submap) for submap in range(visit.geometry.submap_count)]


def _nearest(own: VisitImages, other: VisitImages) -> NDArray[np.int32]:
    return nearest_instances(
        own.geometry.surface.points_world,
        own.objects.instance_of_voxel,
        other.geometry.surface.points_world,
        other.objects.instance_of_voxel,
        own.geometry.surface.voxel_size_m,
    )


@dataclass(frozen=True)
class _Compared:
    """The surface of one visit against what the other one observed of it; (M,) per voxel."""

    is_observed: NDArray[np.bool_]
    is_seen_through: NDArray[np.bool_]
    appearance: AppearanceResidual


def _compared(visit: VisitImages, seen: Observation, settings: Settings) -> _Compared:
    through = seen.is_seen_through(settings.observation)
    appearance = appearance_residual(
        visit.geometry.log_colours,
        seen.log_colours,
        seen.has_colour & ~through,
        visit.geometry.surface.normals_world,
    )
    return _Compared(seen.is_observed, through, appearance)


def _visit_evidence(
    visit: VisitImages,
    compared: _Compared,
    is_met: NDArray[np.bool_],
    dissimilarity: NDArray[np.float64],
    pattern: PatternAgreement,
    prints: PrintSupport,
    settings: Settings,
) -> VisitEvidence:
    surface = visit.geometry.surface
    evidence = object_evidence(
        visit.objects.instance_of_voxel,
        visit.objects.count,
        is_met,
        compared.is_observed,
        compared.is_seen_through,
        compared.appearance,
        visit.geometry.log_colours,
        surface.normals_world,
        surface.points_world,
        dissimilarity,
        pattern,
        prints,
    )
    log_odds = change_log_odds(evidence, compared.appearance.scale, settings.change)
    return VisitEvidence(evidence, log_odds, evidence.voxel_count > 0)


def _scored_moves(
    visits: tuple[VisitImages, VisitImages],
    final: tuple[VisitEvidence, VisitEvidence],
    prints: Prints,
    log_gain: NDArray[np.float64],
    settings: Settings,
) -> list[ScoredMove]:
    """Moves between objects that changed by the end; scored once, chosen anew after every submap."""
    # Colours of the current visit are brought into the light of the previous one.
    clouds = [
        ObjectClouds(visit.geometry, visit.objects, gain)
        for visit, gain in zip(visits, (np.zeros(3), -log_gain), strict=True)
    ]
    candidates = [
        [
            Candidate(
                int(instance),
                of_visit.of(int(instance)),
                places[int(instance)],
                float(evidence.objects.seen_through[instance]),
                int(evidence.objects.voxel_count[instance]),
            )
            for instance in np.flatnonzero(
                evidence.is_met & (evidence.log_odds > settings.moves.least_change_log_odds)
            )
            if instance > 0
        ]
        for of_visit, evidence, places in zip(clouds, final, prints.places, strict=True)
    ]
    up_world = visits[0].geometry.surface.up_world
    return score_moves(
        candidates[0], candidates[1], up_world, clouds[0].cell_m, prints.registrations, settings.moves
    )
