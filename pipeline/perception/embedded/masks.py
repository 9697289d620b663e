"""The embedded mask generator: objects discovered on the fused surface, seen from each keyframe."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.mapping.surface import FusedSurface
from pipeline.settings import DiscoverySettings


class DiscoveredMasks:
    """Masks by looking up which discovered object each pixel's voxel belongs to: no projection error."""

    name = "embedded"
    weights_hash: str | None = None
    masks_are_tracks = True

    def __init__(self, settings: DiscoverySettings) -> None:
        self._settings = settings
        self._segments = np.zeros(0, np.int32)

    def prepare(self, surface: FusedSurface) -> None:
        """Discover the objects of a visit."""
        from pipeline.perception.embedded.discovery import discover_objects

        self._segments = discover_objects(surface, self._settings)

    def masks(
        self, load_rgb: Callable[[], NDArray[np.uint8]], voxels: NDArray[np.int32]
    ) -> NDArray[np.int32]:
        """(h, w) segment of every strided pixel, 0 = none."""
        if not len(self._segments):
            return np.zeros(voxels.shape, np.int32)
        return np.where(voxels >= 0, self._segments[np.maximum(voxels, 0)], 0).astype(np.int32)
