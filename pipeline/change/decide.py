"""Stage "decide": labels after every submap of the current visit; the last ones are final."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.association.accumulation import AccumulatedAssociation
from pipeline.association.reassociation import FoundAgain, find_again
from pipeline.association.tokens import ObjectTokens
from pipeline.change.appearance import appearance_residual
from pipeline.change.change_score import change_log_odds
from pipeline.change.colocation import nearest_instances, overlap_matrix
from pipeline.change.decision import Decision, VisitEvidence, decide_by_association, decide_by_evidence
from pipeline.change.evidence import object_evidence
from pipeline.change.observation import Observation
from pipeline.change.observe import MutualObservation
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
        appearance_scale: spread of the colour residual between the visits, log units: a quality figure.
    """

    decisions: tuple[Decision, ...]
    previous: VisitEvidence
    current: VisitEvidence
    association: AccumulatedAssociation
    appearance_scale: float


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
    nearest0, nearest1 = _nearest(previous, current), _nearest(current, previous)
    search = _Search(previous, current, extractor, comparison.light, settings)
    seen_so_far = Observation(len(previous.geometry.surface.points_world))
    similarity = (PlaceSimilarity.empty(previous.objects.count), PlaceSimilarity.empty(current.objects.count))
    pattern = (PatternAgreement.empty(previous.objects.count), PatternAgreement.empty(current.objects.count))
    last_keyframe = _last_keyframes(current)
    decisions: list[Decision] = []
    for submap, local in enumerate(comparison.evidence):
        association.add_submap(local)
        seen_so_far.add_sparse(observation.by_submap[submap])
        similarity[0].merge(comparison.similarity0[submap])
        similarity[1].merge(comparison.similarity1[submap])
        for so_far, added in zip(pattern, patterns, strict=True):
            so_far.add(added[submap])
        is_met = current.geometry.first_keyframe <= last_keyframe[submap]
        dissimilarity = [change_of_similarity(s.mean, extractor.similarity) for s in similarity]
        evidence0, scale0 = _visit_evidence(
            previous, seen_so_far, ~observation.is_noise0, dissimilarity[0], pattern[0], settings
        )
        evidence1, scale1 = _visit_evidence(
            current,
            observation.of_current,
            is_met & ~observation.is_noise1,
            dissimilarity[1],
            pattern[1],
            settings,
        )
        if settings.change.rule == "paper":
            decision = decide_by_association(
                evidence0, evidence1, association, settings.change, is_final=submap + 1 == len(last_keyframe)
            )
        else:
            overlap = overlap_matrix(
                previous.objects.instance_of_voxel,
                nearest0,
                previous.objects.count,
                np.where(is_met, current.objects.instance_of_voxel, 0),
                np.where(is_met, nearest1, 0),
                current.objects.count,
            )
            decision = decide_by_evidence(evidence0, evidence1, overlap, association, search, settings.change)
        decisions.append(decision)
        on_submap(submap + 1)
    return Conclusion(tuple(decisions), evidence0, evidence1, association, max(scale0, scale1))


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


def _visit_evidence(
    visit: VisitImages,
    seen: Observation,
    is_met: NDArray[np.bool_],
    dissimilarity: NDArray[np.float64],
    pattern: PatternAgreement,
    settings: Settings,
) -> tuple[VisitEvidence, float]:
    surface = visit.geometry.surface
    through = seen.is_seen_through(settings.observation)
    appearance = appearance_residual(
        visit.geometry.log_colours,
        seen.log_colours,
        seen.has_colour & ~through,
        surface.normals_world,
    )
    evidence = object_evidence(
        visit.objects.instance_of_voxel,
        visit.objects.count,
        is_met,
        seen.is_observed,
        through,
        appearance,
        visit.geometry.log_colours,
        surface.normals_world,
        surface.points_world,
        dissimilarity,
        pattern,
    )
    log_odds = change_log_odds(evidence, appearance.scale, settings.change)
    return VisitEvidence(evidence, log_odds, evidence.voxel_count > 0), appearance.scale


class _Search:
    """Re-association among objects that left their place; remembers tokens and sizes between submaps."""

    def __init__(
        self,
        previous: VisitImages,
        current: VisitImages,
        extractor: FeatureExtractor,
        light: NDArray[np.float64] | None,
        settings: Settings,
    ) -> None:
        self._tokens = tuple(
            ObjectTokens(
                visit.objects.view_pixels,
                visit.features,
                lambda k, visit=visit: visit.objects.mask(visit.geometry, k),  # type: ignore[misc]
            )
            for visit in (previous, current)
        )
        self._visits = (previous, current)
        self._extractor = extractor
        self._light = light
        self._settings = settings
        self._known_sizes: tuple[dict[int, NDArray[np.float64]], ...] = ({}, {})

    def __call__(self, left: list[int], taken: list[int]) -> list[FoundAgain]:
        sizes = tuple(
            np.array([self._size_m(visit, instance) for instance in instances])
            for visit, instances in enumerate((left, taken))
        )
        return find_again(
            left,
            taken,
            self._tokens[0],
            self._tokens[1],
            (sizes[0], sizes[1]),
            self._extractor,
            self._light,
            self._settings.association,
            self._settings.change.moved_size_ratio,
        )

    def _size_m(self, visit: int, instance: int) -> NDArray[np.float64]:
        known = self._known_sizes[visit]
        if instance not in known:
            images = self._visits[visit]
            surface = images.geometry.surface
            points = surface.points_world[images.objects.instance_of_voxel == instance]
            known[instance] = size_m(points, surface.up_world, surface.voxel_size_m)
        return known[instance]


def size_m(
    points_world: NDArray[np.floating], up_world: NDArray[np.floating], least_m: float
) -> NDArray[np.float64]:
    """(2,) horizontal reach and height of points in metres; turning about gravity changes neither."""
    height = points_world @ up_world
    level = points_world - height[:, None] * up_world
    reach = 2 * np.percentile(np.linalg.norm(level - level.mean(axis=0), axis=1), 95)
    low, high = np.percentile(height, [2, 98])
    return np.maximum([reach, high - low], least_m).astype(np.float64)
