"""The objects of one visit: lifted masks, merged, cleaned, and numbered as instances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.surface import FusedSurface

# Pieces of an object smaller than this share of its largest piece are not taken for part of it.
MIN_PIECE_SHARE = 0.1
_FEW_KEYFRAMES = 12
MIN_VIEW_PIXELS = 12


@dataclass(frozen=True)
class SessionObjects:
    """The object map O_s of one visit.

    Attributes:
        instance_of_voxel: (M,) instance number counted from 1, 0 = background.
        count: number of instances K_s.
        view_pixels: (N, K_s + 1) strided pixels of each instance in each keyframe.
    """

    instance_of_voxel: NDArray[np.int32]
    count: int
    view_pixels: NDArray[np.int32]

    def mask(self, geometry: SessionGeometry, k: int) -> NDArray[np.int32]:
        """(h, w) instance of each strided pixel of keyframe ``k``."""
        voxels = geometry.store.voxels(k)
        return np.where(voxels >= 0, self.instance_of_voxel[np.maximum(voxels, 0)], 0).astype(np.int32)


def part_pieces(
    surface: FusedSurface, objects: NDArray[np.int32], least_own: int, reach_voxels: float
) -> NDArray[np.int32]:
    """Part the small disconnected pieces of each object from it.

    A piece of under a tenth of the object's largest becomes an object if it has ``least_own`` voxels;
    otherwise it joins the nearest object within reach: surfaces seen at a grazing angle are sparse.

    Args:
        objects: (M,) object of each voxel, 0 = none.

    Returns:
        (M,) the same numbers, new ones above them for new objects, 0 where a piece was dropped.
    """
    rows, columns = surface.neighbours.nonzero()
    inside = (objects[rows] > 0) & (objects[rows] == objects[columns])
    links = coo_matrix(
        (np.ones(int(inside.sum()), np.int8), (rows[inside], columns[inside])), shape=surface.neighbours.shape
    )
    _, piece = connected_components(links, directed=False)
    size = np.bincount(piece)
    owner = np.zeros(len(size), np.int32)
    owner[piece] = objects
    count = int(objects.max(initial=0)) + 1
    largest = np.zeros(count, np.int64)
    np.maximum.at(largest, owner, size)
    is_loose = (owner > 0) & (size < MIN_PIECE_SHARE * largest[owner])
    is_own = is_loose & (size >= least_own)
    owner[is_own] = count + np.arange(int(is_own.sum()))
    owner[is_loose & ~is_own] = 0
    parted: NDArray[np.int32] = owner[piece]
    return join_nearest(surface, parted, (objects > 0) & (parted == 0), reach_voxels)


def join_nearest(
    surface: FusedSurface, objects: NDArray[np.int32], loose: NDArray[np.bool_], reach_voxels: float
) -> NDArray[np.int32]:
    """Give the ``loose`` voxels (M,) to the object of the nearest voxel that has one, if it is in reach."""
    joined = objects.copy()
    held, loose_voxels = np.flatnonzero(objects > 0), np.flatnonzero(loose)
    if not len(held) or not len(loose_voxels):
        return joined
    distance, nearest = cKDTree(surface.points_world[held]).query(
        surface.points_world[loose_voxels], distance_upper_bound=reach_voxels * surface.voxel_size_m
    )
    near = np.isfinite(distance)
    joined[loose_voxels[near]] = objects[held[nearest[near]]]
    return joined


def number_instances(
    geometry: SessionGeometry,
    objects: NDArray[np.int32],
    counts: NDArray[np.bool_],
    min_voxels: int,
    min_views: int,
) -> SessionObjects:
    """Keep the objects that are large enough and seen often enough, numbered 1, 2, ... without gaps.

    Visits of few keyframes see many things once only: there one view is enough.

    Args:
        objects: (M,) object of each voxel, 0 = none.
        counts: (M,) voxels that count towards the size.
    """
    if len(geometry.keyframes) < _FEW_KEYFRAMES:
        min_views = 1
    count = int(objects.max(initial=0))
    pixels = np.zeros((len(geometry.keyframes), count + 1), np.int32)
    for k in range(len(geometry.keyframes)):
        voxels = geometry.store.voxels(k)
        pixels[k] = np.bincount(objects[voxels[voxels >= 0]], minlength=count + 1)
    views = (pixels >= MIN_VIEW_PIXELS).sum(axis=0)
    size = np.bincount(objects, counts, count + 1)
    kept = np.flatnonzero((size >= min_voxels) & (views >= min_views))
    kept = kept[kept > 0]
    renumber = np.zeros(count + 1, np.int32)
    renumber[kept] = np.arange(1, len(kept) + 1)
    view_pixels = np.zeros((len(pixels), len(kept) + 1), np.int32)
    view_pixels[:, 1:] = pixels[:, kept]
    return SessionObjects(renumber[objects], len(kept), view_pixels)
