"""``wheres-my-glasses``: online association by one embedding, with a persistence state per object.

After "Where Did I Leave My Glasses? Open-Vocabulary Semantic Exploration in Real-World Semi-Static
Environments" (2025), of which no code is public and only an account of its method was at hand; numbers that
it does not give are those of POCD (Qian et al., RSS 2022), the same group's probabilistic object state.

Taken from it: the previous visit leaves an object library, each object with its points, one embedding and a
stationarity. Every current keyframe's objects are associated with it as they come, one-to-one by the cosine
of single embeddings; an object seen where expected grows more stationary, one that was expected (20 % of it
in plain view) and not seen less so; below 0.45 it goes to the missing-object library. What is new is
compared with that library, and found there it is the same object, moved. Objects that were never expected
keep their state and stay unknown; new objects that are nobody have appeared.

What it cannot: no SAM, no CLIP (masks and features are the embedded ones all methods here share, with their
own threshold of the cosine) and no language model, so every object starts with the same Beta prior instead
of a static or dynamic one by its class. Exploration, object search and revisiting play no part in change.
Objects within one visit are tracked as in ``object_map``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.baselines.confidence import margin_confidence
from pipeline.baselines.embedding import VisitEmbeddings, averaged_embeddings, min_similarity
from pipeline.baselines.findings import NOT_MET, Findings, outcome
from pipeline.baselines.instances import InstanceGeometry, instance_geometry
from pipeline.baselines.light import visit_light
from pipeline.baselines.object_map import build_object_maps
from pipeline.baselines.persistence import NOBODY, Candidate, ObjectLibrary
from pipeline.baselines.range_images import points_in_view
from pipeline.correspondence.compare import Comparison, VisitImages
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects
from pipeline.methods import MappedVisits, Outcome
from pipeline.result import ChangeLabel

# A point counts as in plain view when nothing is measured farther in front of it than this.
_SLACK_VOXELS = 2.0


class WheresMyGlassesMethod:
    """See the module's docstring."""

    name = "wheres-my-glasses"

    def find_objects(self, mapped: MappedVisits) -> tuple[SessionObjects, SessionObjects]:
        """Objects tracked within either visit."""
        return build_object_maps(mapped)

    def conclude(
        self,
        mapped: MappedVisits,
        visits: tuple[VisitImages, VisitImages],
        comparison: Comparison,
        on_submap: Callable[[int], None],
    ) -> Outcome:
        """Walk through the current visit keyframe by keyframe."""
        settings = mapped.settings.baseline
        light, threshold = visit_light(mapped), min_similarity(mapped)
        previous, current = visits
        places = (
            instance_geometry(previous.geometry, previous.objects),
            instance_geometry(current.geometry, current.objects),
        )
        known = averaged_embeddings(VisitEmbeddings(mapped, 0, light), previous)
        library = ObjectLibrary(
            known,
            places[0].low_world,
            places[0].high_world,
            current.objects.count,
            threshold,
            settings,
        )
        embeddings = VisitEmbeddings(mapped, 1, light)
        is_met = np.zeros(current.objects.count + 1, bool)
        beliefs = []
        keyframes = current.geometry.keyframes
        for k, keyframe in enumerate(keyframes):
            candidates = _candidates(current, k, embeddings)
            is_met[list(candidates)] = True
            library.observe(candidates, _expected_share(previous, places[0], current.geometry, k))
            if k + 1 == len(keyframes) or keyframes[k + 1].submap != keyframe.submap:
                beliefs.append(_labels(library, places, is_met, settings.displacement_m))
                on_submap(len(beliefs))
        labels = beliefs.pop()
        # Objects that no keyframe shows well enough for an embedding were still mapped.
        labels[1][labels[1] == NOT_MET] = ChangeLabel.APPEARED
        softness = settings.embedding_spread * mapped.extractor.similarity.softness
        stationarity = library.stationarity
        best = library.best_similarity()
        similarity = np.where(library.identity != NOBODY, library.similarity, best)
        found = [(int(p), n) for n, p in enumerate(library.identity.tolist()) if p != NOBODY]
        confidence1 = margin_confidence(similarity, threshold, softness)
        confidence0 = np.where(labels[0] == ChangeLabel.DISAPPEARED, 1.0 - stationarity, stationarity)
        for before, after in found:
            confidence0[before] = confidence1[after]
        confidence0[labels[0] == ChangeLabel.UNKNOWN] = 0.5
        findings = Findings(
            identities=tuple(sorted(found)),
            labels=labels,
            confidences=(confidence0, confidence1),
            beliefs=tuple(beliefs),
            evidence=(
                {
                    "stationarity": stationarity,
                    "seen_keyframes": library.hits - settings.prior_hits,
                    "missed_keyframes": library.misses - settings.prior_misses,
                },
                {"partner_similarity": library.similarity, "best_similarity": best},
            ),
        )
        return outcome(mapped, visits, comparison, findings)


def _candidates(visit: VisitImages, k: int, embeddings: VisitEmbeddings) -> dict[int, Candidate]:
    """The objects that a keyframe of the current visit shows."""
    mask, voxels = visit.objects.mask(visit.geometry, k), visit.geometry.store.voxels(k)
    shown = mask > 0
    owner, points = mask[shown], visit.geometry.surface.points_world[voxels[shown]]
    size = visit.objects.count + 1
    sums = np.stack([np.bincount(owner, points[:, axis], size) for axis in range(3)], axis=1)
    centroids = sums / np.maximum(np.bincount(owner, minlength=size), 1)[:, None]
    return {
        number: Candidate(vector, centroids[number])
        for number, vector in embeddings.of_masks(k, mask).items()
    }


def _expected_share(
    previous: VisitImages, places: InstanceGeometry, current: SessionGeometry, k: int
) -> NDArray[np.float64]:
    """(K0 + 1,) share of each previous object that keyframe ``k`` would have in plain view."""
    owner, surface = previous.objects.instance_of_voxel, previous.geometry.surface
    visible = points_in_view(
        surface.points_world,
        np.flatnonzero(owner > 0),
        current.store.depth(k),
        current.strided_camera(k),
        current.keyframes[k].T_world_camera,
        _SLACK_VOXELS * surface.voxel_size_m,
    )
    seen = np.bincount(owner[visible], minlength=previous.objects.count + 1)
    return seen / np.maximum(places.voxel_count, 1)


def _labels(
    library: ObjectLibrary,
    places: tuple[InstanceGeometry, InstanceGeometry],
    is_met: NDArray[np.bool_],
    displacement_m: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Labels as believed now."""
    labels0 = np.where(library.was_observed, int(ChangeLabel.STATIC), int(ChangeLabel.UNKNOWN))
    labels0[library.is_missing] = ChangeLabel.DISAPPEARED
    labels1 = np.where(is_met, int(ChangeLabel.APPEARED), NOT_MET)
    labels0[0] = labels1[0] = ChangeLabel.STATIC
    for number in np.flatnonzero(library.identity != NOBODY):
        previous = library.identity[number]
        shift = places[1].centroid_world[number] - places[0].centroid_world[previous]
        moved = float(np.linalg.norm(shift)) > displacement_m
        labels0[previous] = labels1[number] = ChangeLabel.MOVED if moved else ChangeLabel.STATIC
    return labels0.astype(np.int64), labels1.astype(np.int64)
