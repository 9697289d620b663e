"""One embedding per object: the mean of its patches in a keyframe, averaged over keyframes.

ConceptGraphs and Where's-my-glasses embed the crop of a mask with CLIP; here it is the mean of the patches
that the mask covers, in the features that all methods share.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.association.aggregation import patch_owners, patch_shares
from pipeline.correspondence.compare import VisitImages
from pipeline.methods import MappedVisits


class VisitEmbeddings:
    """Embeddings of masks in the keyframes of one visit.

    Args:
        mapped: the visits.
        visit: 0 = previous, 1 = current.
        light: of the current visit against the previous one; None compares the patches as they are.
    """

    def __init__(self, mapped: MappedVisits, visit: int, light: NDArray[np.float64] | None) -> None:
        self._features = mapped.features[visit]
        self._extractor = mapped.extractor
        self._visit = visit
        self._light = light

    def of_masks(self, k: int, masks: NDArray[np.integer]) -> dict[int, NDArray[np.float32]]:
        """Unit vectors of the masks of a keyframe, by mask number; masks that own no patch are left out.

        Args:
            k: keyframe.
            masks: (h, w) mask number of every strided pixel, 0 = none.
        """
        stored = self._features(k)
        nothing = stored.reshape(-1, stored.shape[-1])[:1]
        if self._visit == 0:
            features, _ = self._extractor.comparable(stored, nothing, self._light)
        else:
            _, features = self._extractor.comparable(nothing, stored, self._light)
        rows, columns = stored.shape[:2]
        owners = patch_owners(patch_shares(masks, (rows, columns)), rows * columns)
        return {
            int(number): unit(features[owners == number].mean(axis=0))
            for number in np.unique(owners[owners > 0])
        }


def averaged_embeddings(embeddings: VisitEmbeddings, visit: VisitImages) -> NDArray[np.float32]:
    """(K + 1, d) mean over the keyframes of each instance's embeddings, unit length; zeros without any.

    Args:
        embeddings: of the visit.
        visit: with its objects.
    """
    total: NDArray[np.float32] | None = None
    for k in range(len(visit.geometry.keyframes)):
        for instance, vector in embeddings.of_masks(k, visit.objects.mask(visit.geometry, k)).items():
            if total is None:
                total = np.zeros((visit.objects.count + 1, len(vector)), np.float32)
            total[instance] += vector
    if total is None:
        return np.zeros((visit.objects.count + 1, 1), np.float32)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-9)


def min_similarity(mapped: MappedVisits) -> float:
    """Least cosine of two embeddings of one object.

    It follows from where the features' own patches start to look changed: how a correlation reads differs
    between features, and averages over an object scatter much less than patches do.
    """
    patches = mapped.extractor.similarity.threshold
    return 1.0 - mapped.settings.baseline.embedding_spread * (1.0 - patches)


def unit(vector: NDArray[np.floating]) -> NDArray[np.float32]:
    """The vector at length one; a zero vector stays."""
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-9), np.float32)
