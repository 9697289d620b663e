"""The light between two visits, for methods that compare embeddings of whole objects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.correspondence.covisibility import patch_warp
from pipeline.methods import MappedVisits


def visit_light(mapped: MappedVisits) -> NDArray[np.float64] | None:
    """Mean lighting difference over all co-visible keyframes, as the extractor gives it; None without any.

    The published baselines embed with CLIP, which hardly minds the light; the embedded features do, so every
    method gets the same compensation as the engine.
    """
    covisibility = mapped.covisibility
    lights = [
        mapped.extractor.light(
            mapped.features[0](k0),
            mapped.features[1](k1),
            patch_warp(covisibility.views1[k1], covisibility.views0[k0]),
        )
        for k0, k1 in covisibility.pairs()
    ]
    return np.mean(lights, axis=0) if lights and lights[0].size else None
