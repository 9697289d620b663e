"""Stage "objects": masks of all keyframes become the object map of a visit (paper, Sec. III-B.2)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pipeline.association.aggregation import patch_owners, patch_shares
from pipeline.change.proposals import ChangeProposals
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.merging import ObjectMerger
from pipeline.mapping.objects import SessionObjects, number_instances, part_pieces
from pipeline.mapping.projection import visible_points
from pipeline.mapping.voxel_blocks import VoxelBlocks
from pipeline.perception.embedded.refinement import refine_by_change
from pipeline.perception.protocols import FeatureExtractor, MaskGenerator
from pipeline.settings import Settings


def find_objects(
    geometry: SessionGeometry,
    proposals: ChangeProposals,
    is_noise: NDArray[np.bool_],
    generator: MaskGenerator,
    extractor: FeatureExtractor,
    features: Callable[[int], NDArray[np.float16]],
    image: Callable[[int], NDArray[np.uint8]],
    settings: Settings,
) -> SessionObjects:
    """Ask for the masks of every keyframe, lift and merge them, and clean the outcome.

    Args:
        geometry: the mapped visit.
        proposals: voxels that changed between the visits: what came or went as one is an object even where
            masks missed it.
        is_noise: (M,) voxels that their own visit denies; they neither make an object nor a change.
        generator: makes the masks.
        extractor, features: for the semantic similarity of masks.
        image: colour image of a keyframe, only read when the generator needs pixels.
        settings: of the run.
    """
    surface = geometry.surface
    merger = ObjectMerger(
        len(surface.points_world), settings.merge, masks_are_tracks=generator.masks_are_tracks
    )
    generator.prepare(surface)
    blocks = VoxelBlocks(surface.points_world, surface.voxel_size_m)
    for k, keyframe in enumerate(geometry.keyframes):
        voxels = geometry.store.voxels(k)
        masks = generator.masks(partial(image, k), voxels)
        if generator.masks_are_tracks:
            merger.add(masks, voxels)
            continue
        camera = geometry.strided_camera(k)
        candidates = blocks.in_view(camera, keyframe.T_world_camera, settings.image.max_depth_m)
        projected = visible_points(surface.points_world, candidates, camera, keyframe.T_world_camera)
        merger.add(masks, voxels, mask_tokens(masks, features(k), extractor), projected)
    discovery = settings.discovery
    objects = part_pieces(
        surface, merger.finish(), discovery.loose_piece_voxels, discovery.loose_reach_voxels
    )
    objects = refine_by_change(
        surface, objects, proposals.is_changed, proposals.is_evident, proposals.proof, discovery
    )
    return number_instances(geometry, objects, ~is_noise, discovery.min_voxels, discovery.min_views)


def mask_tokens(
    masks: NDArray[np.int32], stored: NDArray[np.float16], extractor: FeatureExtractor
) -> dict[int, NDArray[np.floating]]:
    """Unit mean feature of every mask of a keyframe (paper: pooling F over the mask gives f).

    Only for merging masks of one visit; the tokens themselves are kept and compared one by one later.
    """
    features, _ = extractor.comparable(stored, stored, None)
    owners = patch_owners(patch_shares(masks, stored.shape[:2]), stored.shape[0] * stored.shape[1])
    tokens: dict[int, NDArray[np.floating]] = {}
    for number in np.unique(owners[owners > 0]):
        mean = features[owners == number].mean(axis=0)
        tokens[int(number)] = mean / max(float(np.linalg.norm(mean)), 1e-9)
    return tokens
