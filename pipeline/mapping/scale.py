"""The voxel size of a visit, from what its pixels cover."""

from __future__ import annotations

import numpy as np

from pipeline.errors import InputError
from pipeline.session import Session
from pipeline.settings import Settings

SAMPLED_KEYFRAMES = 12


def voxel_size_m(session: Session, keyframes: tuple[int, ...], settings: Settings) -> float:
    """Edge of a voxel in metres: the footprint of one stride at a far percentile of the depth.

    A fixed size would leave a car park as disconnected dots or melt a desk into one lump.

    Raises:
        InputError: none of the sampled keyframes has any depth.
    """
    surface = settings.surface
    if surface.voxel_size_m > 0:
        return surface.voxel_size_m
    sampled = np.unique(np.linspace(0, len(keyframes) - 1, SAMPLED_KEYFRAMES).round().astype(int))
    depths, scale = [], []
    for position in sampled:
        frame = session.frames[keyframes[position]]
        try:
            depth = frame.load_depth()[::8, ::8]
        except InputError:
            continue  # the mapping stage warns about this frame
        measured = depth[(depth > 0) & (depth < settings.image.max_depth_m)]
        depths.append(measured)
        width = min(frame.camera.width, settings.image.max_width)
        scale.append(frame.camera.fx * width / frame.camera.width)
    values = np.concatenate(depths) if depths else np.zeros(0)
    if not len(values):
        raise InputError(
            f"{session.path}: no keyframe has any depth within {settings.image.max_depth_m:g} m",
            "check depth_unit_scale_factor, or raise image.max_depth_m",
        )
    far_m = np.percentile(values, surface.depth_percentile)
    footprint_m = far_m * settings.image.geometry_stride / float(np.median(scale))
    size = surface.footprint_factor * footprint_m
    return float(np.clip(size, surface.min_voxel_m, surface.max_voxel_m))
