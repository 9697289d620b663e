"""An object map of one visit by incremental association of masks, as ConceptGraphs builds it.

For every mask of a keyframe, in order: overlap with each object (share of the mask's voxels that the object
holds) plus semantic similarity ((cosine + 1) / 2); it joins the object with the greatest sum if that is at
least ``merge_similarity``, else it founds a new one. An object's embedding is the mean over its masks.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.baselines.embedding import VisitEmbeddings
from pipeline.baselines.instances import numbered
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects
from pipeline.mapping.surface import FusedSurface
from pipeline.methods import MappedVisits
from pipeline.perception.registry import mask_generator
from pipeline.settings import BaselineSettings


class ObjectMap:
    """Objects under construction.

    Args:
        voxel_count: M, voxels of the surface.
        settings: thresholds.
    """

    def __init__(self, voxel_count: int, settings: BaselineSettings) -> None:
        self._settings = settings
        self._owner = np.zeros(voxel_count, np.int32)
        self._votes = np.zeros(voxel_count, np.int32)
        self._embedding_sum: list[NDArray[np.float64]] = []
        self._detections: list[int] = []

    @property
    def detections(self) -> NDArray[np.int64]:
        """(K + 1,) masks that joined each object; entry 0 is 0."""
        return np.array([0, *self._detections], np.int64)

    def add(
        self,
        masks: NDArray[np.int32],
        voxels: NDArray[np.int32],
        embeddings: dict[int, NDArray[np.float32]],
    ) -> dict[int, int]:
        """Add the masks of one keyframe.

        All masks are compared with the objects as they were before this keyframe.

        Args:
            masks: (h, w) mask number of each strided pixel, 0 = none.
            voxels: (h, w) surface voxel of each strided pixel, -1 = none.
            embeddings: unit vector of each mask; masks without one are skipped.

        Returns:
            The object that each mask joined or founded.
        """
        lifted = (masks > 0) & (voxels >= 0)
        numbers, of_voxels = masks[lifted], voxels[lifted]
        # One key per mask and voxel: unique rows would be sorted many times slower.
        keys = np.unique(numbers.astype(np.int64) * len(self._owner) + of_voxels)
        numbers, of_voxels = np.divmod(keys, len(self._owner))
        joined: list[tuple[int, NDArray[np.int64], NDArray[np.float32]]] = []
        chosen: dict[int, int] = {}
        for number in np.unique(numbers).tolist():
            mask_voxels = of_voxels[numbers == number]
            if number not in embeddings or len(mask_voxels) < self._settings.min_mask_voxels:
                continue
            owner = self._most_similar(mask_voxels, embeddings[number])
            if owner == 0:
                self._embedding_sum.append(np.zeros(len(embeddings[number])))
                self._detections.append(0)
                owner = len(self._detections)
            chosen[number] = owner
            joined.append((owner, mask_voxels, embeddings[number]))
        for owner, mask_voxels, vector in joined:
            self._claim(mask_voxels, owner)
            self._embedding_sum[owner - 1] += vector
            self._detections[owner - 1] += 1
        return chosen

    def _most_similar(self, mask_voxels: NDArray[np.int64], vector: NDArray[np.float32]) -> int:
        """The object that the mask joins, counted from 1; 0 = none."""
        known = [i for i, count in enumerate(self._detections) if count]
        if not known:
            return 0
        sums = np.array([self._embedding_sum[i] for i in known])
        cosine = sums @ vector / np.maximum(np.linalg.norm(sums, axis=1), 1e-9)
        shared = np.bincount(self._owner[mask_voxels], minlength=len(self._detections) + 1)
        overlap = shared[np.array(known) + 1] / len(mask_voxels)
        similarity = overlap + (cosine + 1) / 2
        best = int(similarity.argmax())
        return known[best] + 1 if similarity[best] >= self._settings.merge_similarity else 0

    def _claim(self, voxels: NDArray[np.int64], owner: int) -> None:
        """Vote for an owner: majority vote with one counter per voxel (Boyer and Moore)."""
        agrees = self._owner[voxels] == owner
        self._votes[voxels[agrees]] += 1
        others = voxels[~agrees]
        self._votes[others] -= 1
        lost = others[self._votes[others] <= 0]
        self._owner[lost] = owner
        self._votes[lost] = 1

    def finish(self, surface: FusedSurface) -> NDArray[np.int32]:
        """(M,) object of each voxel, 0 = none: objects of too few masks dropped, each cut to its largest
        connected piece (ConceptGraphs keeps the largest DBSCAN cluster)."""
        enough = self.detections >= self._settings.min_detections
        return largest_pieces(surface, np.where(enough[self._owner], self._owner, 0).astype(np.int32))


def largest_pieces(surface: FusedSurface, owner: NDArray[np.int32]) -> NDArray[np.int32]:
    """(M,) the same numbers, 0 outside of each object's largest connected piece."""
    rows, columns = surface.neighbours.nonzero()
    linked = (owner[rows] > 0) & (owner[rows] == owner[columns])
    links = coo_matrix(
        (np.ones(int(linked.sum()), np.int8), (rows[linked], columns[linked])), shape=surface.neighbours.shape
    )
    _, piece = connected_components(links, directed=False)
    size = np.bincount(piece)[piece]
    largest = np.zeros(int(owner.max(initial=0)) + 1, np.int64)
    np.maximum.at(largest, owner, size)
    kept = np.where((owner > 0) & (size == largest[owner]), owner, 0)
    # Pieces of equal size: the first one stays.
    first = np.full(len(largest), len(piece), np.int64)
    np.minimum.at(first, kept, piece)
    return np.where((kept > 0) & (piece == first[kept]), kept, 0).astype(np.int32)


def build_object_maps(mapped: MappedVisits) -> tuple[SessionObjects, SessionObjects]:
    """The object maps of both visits, independently of each other."""
    with ThreadPoolExecutor(2) as threads:
        previous, current = threads.map(lambda visit: build_object_map(mapped, visit), range(2))
    return previous, current


def build_object_map(mapped: MappedVisits, visit: int) -> SessionObjects:
    """Objects of one visit from the masks of its keyframes; mask numbers mean nothing beyond a keyframe."""
    geometry: SessionGeometry = mapped.geometries[visit]
    settings = mapped.settings
    generator = mask_generator(settings)
    generator.prepare(geometry.surface)
    embeddings = VisitEmbeddings(mapped, visit, None)
    objects = ObjectMap(len(geometry.surface.points_world), settings.baseline)
    for k in range(len(geometry.keyframes)):
        voxels = geometry.store.voxels(k)
        masks = generator.masks(lambda k=k: mapped.images[visit](k), voxels)  # type: ignore[misc]
        objects.add(masks, voxels, embeddings.of_masks(k, masks))
    return numbered(geometry, objects.finish(geometry.surface))
