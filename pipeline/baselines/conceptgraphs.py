"""``conceptgraphs``: object maps of single visits, matched one-to-one afterwards (Gu et al., ICRA 2024).

Taken from the publication: objects by incremental association of masks across keyframes, with overlap plus
semantic similarity and the threshold 1.1, points of 16 voxels at least, 3 masks at least, noise cut off, and
one embedding per object averaged over its views. Between visits, what the OASIS-Map paper adds for its
comparison: the finished maps are associated offline and one-to-one, by the same sum of overlap and semantic
similarity; an associated object is static, or moved when displaced by more than tau_d; whatever finds no
partner is disappeared or appeared. The method has no notion of what a visit saw, so it is never unknown.

What it cannot: no CLIP, SAM, captions or language model: masks and features are the embedded ones that all
methods here share, so the cosine from which two embeddings may be one object is ours (0.99 for the embedded
features, chosen on development scenes in this method's favour, as is tau_d; CLIP's do not transfer). Scene
graph edges and text queries play no part in change. Where it differs: masks of a keyframe never overlap, so
duplicate objects need no merging afterwards, and distances of 2.5 cm (one of its voxels) are one voxel of the
shared surface here, whatever its size.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pipeline.baselines.confidence import margin_confidence
from pipeline.baselines.embedding import VisitEmbeddings, averaged_embeddings, min_similarity
from pipeline.baselines.findings import Findings, outcome, undecided_until_the_end
from pipeline.baselines.instances import instance_geometry
from pipeline.baselines.light import visit_light
from pipeline.baselines.object_map import build_object_maps
from pipeline.change.colocation import nearest_instances
from pipeline.correspondence.compare import Comparison, VisitImages
from pipeline.mapping.objects import SessionObjects
from pipeline.methods import MappedVisits, Outcome
from pipeline.result import ChangeLabel


class ConceptGraphsMethod:
    """See the module's docstring."""

    name = "conceptgraphs"

    def find_objects(self, mapped: MappedVisits) -> tuple[SessionObjects, SessionObjects]:
        """The object maps of both visits, independently of each other."""
        return build_object_maps(mapped)

    def conclude(
        self,
        mapped: MappedVisits,
        visits: tuple[VisitImages, VisitImages],
        comparison: Comparison,
        on_submap: Callable[[int], None],
    ) -> Outcome:
        """Associate the finished maps once."""
        settings = mapped.settings.baseline
        cosine = object_similarity(mapped, visits)
        overlap = object_overlap(visits)
        threshold = min_similarity(mapped)
        pairs = match_offline(overlap, cosine, threshold)
        places = [instance_geometry(visit.geometry, visit.objects) for visit in visits]
        sizes = tuple(visit.objects.count + 1 for visit in visits)
        labels = (
            np.full(sizes[0], int(ChangeLabel.DISAPPEARED), np.int64),
            np.full(sizes[1], int(ChangeLabel.APPEARED), np.int64),
        )
        partner = (np.full(sizes[0], np.nan), np.full(sizes[1], np.nan))
        for previous, current in pairs:
            shift = places[1].centroid_world[current] - places[0].centroid_world[previous]
            moved = float(np.linalg.norm(shift)) > settings.displacement_m
            labels[0][previous] = labels[1][current] = ChangeLabel.MOVED if moved else ChangeLabel.STATIC
            partner[0][previous] = partner[1][current] = cosine[previous - 1, current - 1]
        labels[0][0] = labels[1][0] = ChangeLabel.STATIC
        best = [np.concatenate([[0.0], cosine.max(axis=1 - axis, initial=0.0)]) for axis in range(2)]
        softness = settings.embedding_spread * mapped.extractor.similarity.softness
        confidences = [
            margin_confidence(np.where(np.isnan(partner[v]), best[v], partner[v]), threshold, softness)
            for v in range(2)
        ]
        on_submap(len(comparison.evidence))
        findings = Findings(
            identities=tuple(pairs),
            labels=labels,
            confidences=(confidences[0], confidences[1]),
            beliefs=undecided_until_the_end(mapped, visits),
            evidence=(
                {"partner_similarity": partner[0], "best_similarity": best[0]},
                {"partner_similarity": partner[1], "best_similarity": best[1]},
            ),
        )
        return outcome(mapped, visits, comparison, findings)


def match_offline(
    overlap: NDArray[np.floating], cosine: NDArray[np.floating], threshold: float
) -> list[tuple[int, int]]:
    """One-to-one pairs, counted from 1, that maximise overlap plus semantic similarity ((cosine + 1) / 2).

    Args:
        overlap: (n, m) in [0, 1]. cosine: (n, m) of the embeddings.
        threshold: pairs of less cosine are no candidates.
    """
    if not cosine.size:
        return []
    is_candidate = cosine >= threshold
    total = np.where(is_candidate, overlap + (cosine + 1) / 2, 0.0)
    rows, columns = linear_sum_assignment(-total)
    return [
        (int(row) + 1, int(column) + 1)
        for row, column in zip(rows, columns, strict=True)
        if is_candidate[row, column]
    ]


def object_similarity(mapped: MappedVisits, visits: tuple[VisitImages, VisitImages]) -> NDArray[np.float64]:
    """(n, m) cosine of the averaged embeddings of all pairs of objects."""
    light = visit_light(mapped)
    vectors = [
        averaged_embeddings(VisitEmbeddings(mapped, visit, light), images)
        for visit, images in enumerate(visits)
    ]
    if vectors[0].shape[1] != vectors[1].shape[1]:  # one visit shows no object at all
        return np.zeros((visits[0].objects.count, visits[1].objects.count))
    return (vectors[0][1:] @ vectors[1][1:].T).astype(np.float64)


def object_overlap(visits: tuple[VisitImages, VisitImages]) -> NDArray[np.float64]:
    """(n, m) share of the smaller object's voxels that lie at the other's (two voxels' reach)."""
    previous, current = visits
    counts = (previous.objects.count, current.objects.count)
    shared = []
    for own, other in ((previous, current), (current, previous)):
        nearest = nearest_instances(
            own.geometry.surface.points_world,
            own.objects.instance_of_voxel,
            other.geometry.surface.points_world,
            other.objects.instance_of_voxel,
            own.geometry.surface.voxel_size_m,
        )
        shape = (own.objects.count + 1, other.objects.count + 1)
        keys = own.objects.instance_of_voxel.astype(np.int64) * shape[1] + nearest
        share = np.bincount(keys, minlength=shape[0] * shape[1]).reshape(shape)
        size = np.bincount(own.objects.instance_of_voxel, minlength=shape[0])
        shared.append((share / np.maximum(size, 1)[:, None])[1:, 1:])
    return np.maximum(shared[0], shared[1].T).reshape(counts)
