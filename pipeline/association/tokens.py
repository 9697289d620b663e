"""Object tokens: the patches of an object in each keyframe that sees it best, never averaged."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.association.aggregation import patch_owners, patch_shares

VIEWS_PER_OBJECT = 4


class ObjectTokens:
    """Gathers the feature tokens of single objects of one visit.

    Args:
        view_pixels: (N, K + 1) pixels of each instance in each keyframe.
        features: stored feature map of a keyframe, (H_f, W_f, c).
        mask: instance image of a keyframe, (h, w).
    """

    def __init__(
        self,
        view_pixels: NDArray[np.integer],
        features: Callable[[int], NDArray[np.float16]],
        mask: Callable[[int], NDArray[np.int32]],
    ) -> None:
        self._view_pixels = view_pixels
        self._features = features
        self._mask = mask
        self._cache: dict[int, NDArray[np.float16]] = {}

    def of(self, instance: int) -> NDArray[np.float16]:
        """(T, c) patches of an instance (counted from 1) over its best views; may be empty."""
        if instance not in self._cache:
            self._cache[instance] = self._gather(instance)
        return self._cache[instance]

    def _gather(self, instance: int) -> NDArray[np.float16]:
        pixels = self._view_pixels[:, instance]
        views = np.argsort(-pixels, kind="stable")[:VIEWS_PER_OBJECT]
        tokens = []
        channels = 0
        for k in views[pixels[views] > 0]:
            features = np.asarray(self._features(int(k)))
            channels = features.shape[-1]
            owners = patch_owners(
                patch_shares(self._mask(int(k)), features.shape[:2]), features.shape[0] * features.shape[1]
            )
            tokens.append(features.reshape(-1, channels)[owners == instance])
        return np.concatenate(tokens) if tokens else np.zeros((0, channels), np.float16)
