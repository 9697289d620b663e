"""Segments corrected by what changed: something that came or went as one is an object by that alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.components import Mask, Pieces, linked

_LINK_VOXELS = 2.2


def refine_by_change(
    surface: FusedSurface,
    segments: NDArray[np.integer],
    changed: Mask,
    min_voxels: int,
    whole_change: float = 0.5,
) -> NDArray[np.int32]:
    """Cut changed regions out of segments that did not change as a whole.

    A segment of which more than ``whole_change`` changed stays as it is. Elsewhere (background included)
    changed voxels linked within 2.2 voxels form regions. A region that touches a mostly changed segment at
    least half its size is the rest of that object and joins it; any other becomes a new segment, numbered
    after the given ones.

    Args:
        surface: the fused surface of M voxels.
        segments: (M,) segment numbers, 0 = background.
        changed: (M,) voxels that changed between the visits.
        min_voxels: smaller regions are left where they are.
        whole_change: share of changed voxels from which a segment changed as a whole.

    Returns:
        (M,) new segment numbers; existing segments keep theirs.
    """
    refined: NDArray[np.int32] = np.array(segments, np.int32)
    segments = refined.copy()
    count = int(segments.max(initial=0)) + 1
    sizes = np.bincount(segments, minlength=count)
    is_whole = np.bincount(segments, changed, count) > whole_change * np.maximum(sizes, 1)
    is_whole[:1] = False

    partial = np.flatnonzero(changed & ~is_whole[segments])
    if len(partial) < min_voxels:
        return refined
    tree = cKDTree(np.asarray(surface.points_world, np.float64)[partial])
    pairs = tree.query_pairs(_LINK_VOXELS * surface.voxel_size_m, output_type="ndarray")
    number = np.full(len(segments), -1, np.int64)
    number[partial] = linked(len(partial), pairs[:, 0], pairs[:, 1])
    regions = Pieces.from_numbers(number)

    following = count
    for region in np.flatnonzero(regions.sizes >= min_voxels):
        voxels = regions.voxels_of(np.array([region]))
        around = segments[np.unique(surface.neighbours[voxels].indices)]
        touching = np.bincount(around[is_whole[around]], minlength=count)
        host = int(touching.argmax())
        if touching[host] > 0.15 * len(voxels) and sizes[host] > 0.5 * len(voxels):
            refined[voxels] = host
            continue
        refined[voxels] = following
        following += 1
    return refined
