"""Segments corrected by what changed: something that came or went as one is an object by that alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.components import Mask, Pieces, first_seen_order, linked
from pipeline.settings import DiscoverySettings

_LINK_VOXELS = 2.2


def refine_by_change(
    surface: FusedSurface,
    segments: NDArray[np.integer],
    changed: Mask,
    evident: Mask,
    proof: NDArray[np.floating],
    settings: DiscoverySettings,
) -> NDArray[np.int32]:
    """Cut segments where change ends: no object is half changed.

    Evidently changed parts of segments that did not change as a whole (background included), linked within
    2.2 voxels, form regions. A region that touches a mostly changed segment at least half its size is the
    rest of that object and joins it; any other becomes a new segment. Unchanged parts of mostly changed
    segments become new segments where they are a fair share of them. New segments are numbered after the
    given ones.

    Args:
        surface: the fused surface of M voxels.
        segments: (M,) segment numbers, 0 = background.
        changed: (M,) voxels that changed between the visits.
        evident: (M,) changed voxels that may be cut out of what did not change as a whole; elsewhere changes
            that were only concluded from those around count too.
        proof: (M,) how sure that is; regions of little proof in all are left where they are.
        settings: sizes and shares.

    Returns:
        (M,) new segment numbers; existing segments keep theirs.
    """
    refined: NDArray[np.int32] = np.array(segments, np.int32)
    segments = refined.copy()
    count = int(segments.max(initial=0)) + 1
    sizes = np.bincount(segments, minlength=count)
    is_whole = np.bincount(segments, changed, count) > settings.whole_change * np.maximum(sizes, 1)
    is_whole[:1] = False

    unchanged = np.flatnonzero(
        _unchanged_parts(surface, segments, sizes, ~changed & is_whole[segments], settings)
    )
    following = count
    if len(unchanged):
        number = first_seen_order(segments[unchanged].astype(np.int64), 1)
        refined[unchanged] = following - 1 + number
        following += int(number.max())

    regions = _regions(surface, np.flatnonzero(changed & evident & ~is_whole[segments]))
    in_region = regions.number[regions.order]
    sure = np.bincount(in_region, proof[regions.order], regions.count) >= settings.change_region_proof
    for region in np.flatnonzero(sure & (regions.sizes >= settings.change_region_voxels)):
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


def _unchanged_parts(
    surface: FusedSurface,
    segments: NDArray[np.int32],
    sizes: NDArray[np.integer],
    unchanged: Mask,
    settings: DiscoverySettings,
) -> Mask:
    """(M,) those of the ``unchanged`` voxels whose connected piece is a fair share of its segment."""
    pieces = Pieces.of(unchanged, surface.neighbours)
    segment = segments[pieces.order[pieces.starts[:-1]]]
    is_fair = (pieces.sizes >= settings.change_region_voxels) & (
        pieces.sizes >= settings.unchanged_share * sizes[segment]
    )
    fair: Mask = np.zeros(len(segments), np.bool_)
    fair[pieces.order] = is_fair[pieces.number[pieces.order]]
    return fair


def _regions(surface: FusedSurface, voxels: NDArray[np.intp]) -> Pieces:
    """The ``voxels`` (n,) in pieces linked within 2.2 voxels."""
    number = np.full(len(surface.points_world), -1, np.int64)
    if len(voxels):
        tree = cKDTree(np.asarray(surface.points_world, np.float64)[voxels])
        pairs = tree.query_pairs(_LINK_VOXELS * surface.voxel_size_m, output_type="ndarray")
        number[voxels] = linked(len(voxels), pairs[:, 0], pairs[:, 1])
    return Pieces.from_numbers(number)
