"""The three seams behind which perception backends stand: features, masks, depth.

A backend is one new file that implements a protocol and is named in ``pipeline.perception.registry``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.mapping.surface import FusedSurface


@dataclass(frozen=True)
class PatchWarp:
    """Where the patches of the current keyframe lie in the previous one, from depth and poses.

    Attributes:
        positions: (H_f, W_f, 2) column and row in the previous patch grid, fractional.
        is_visible: (H_f, W_f) the patch has depth and the previous keyframe sees its place.
    """

    positions: NDArray[np.float32]
    is_visible: NDArray[np.bool_]


@dataclass(frozen=True)
class SimilarityScale:
    """How a descriptor's correlation reads: it differs between descriptors and is never transferable.

    Attributes:
        threshold: correlation at which a place is as likely changed as not.
        softness: how fast that turns; one softness below the threshold is changed at 73 %.
        noise: what unchanged places lack of a correlation of one, between two visits in like light: a
            quarter of the patches of a keyframe lack less. Where they lack more, the heatmap takes it for
            light that could not be taken out; 0 = do not.
    """

    threshold: float
    softness: float
    noise: float = 0.0


class FeatureExtractor(Protocol):
    """Dense features of images (paper: the encoder g)."""

    name: str
    weights_hash: str | None  # None when there are no weights
    similarity: SimilarityScale

    def describe(self, rgb: NDArray[np.uint8]) -> NDArray[np.float16]:
        """What is stored for an image: (H_f, W_f, c) float16, row-major patches over the whole image."""

    def light(
        self, previous: NDArray[np.float16], current: NDArray[np.float16], warp: PatchWarp
    ) -> NDArray[np.float64]:
        """How the light differs between two stored maps that see the same place.

        Only the extractor that made it reads it; lights of several pairs may be averaged. Features that
        do not mind the light return an empty array.
        """

    def comparable(
        self,
        previous: NDArray[np.float16],
        current: NDArray[np.float16],
        light: NDArray[np.float64] | None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """F0 and F1: unit rows, so that C = F0 F1^T.

        Args:
            previous, current: (..., c) stored patches, whole maps or any selection of patches.
            light: from ``light``; None compares the patches as they are.

        Returns:
            (N0, d) and (N1, d) float32, patches in row-major order.
        """

    def relit(
        self, previous: NDArray[np.float16], current: NDArray[np.float16], warp: PatchWarp
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """F0 and F1 of two whole maps for the heatmap, the difference in light fitted to this pair alone.

        Free to take out more than ``light``; features that do not mind the light return ``comparable``.
        """


class MaskGenerator(Protocol):
    """Instance masks per keyframe (paper: SAM2).

    ``masks_are_tracks`` says that a mask number means the same object in every keyframe of a visit, so that
    nothing has to be merged.
    """

    name: str
    weights_hash: str | None
    masks_are_tracks: bool

    def prepare(self, surface: FusedSurface) -> None:
        """Called once per visit before any mask is asked for."""

    def masks(
        self, load_rgb: Callable[[], NDArray[np.uint8]], voxels: NDArray[np.int32]
    ) -> NDArray[np.int32]:
        """Masks of one keyframe.

        Args:
            load_rgb: gives (H, W, 3) at processing size; geometry alone needs no decoding.
            voxels: (h, w) number of the surface voxel of every strided pixel, -1 = none.

        Returns:
            (h, w) mask number of every strided pixel, 0 = none.
        """


class DepthEstimator(Protocol):
    """Metric depth of images that come without it."""

    name: str
    weights_hash: str | None

    def depth(self, rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(H, W) metres."""
