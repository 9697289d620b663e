"""The objects of one visit: lifted masks, merged, cleaned, and numbered as instances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.surface import FusedSurface

# Pieces of an object smaller than this share of its largest piece are noise.
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


def remove_noise(surface: FusedSurface, objects: NDArray[np.int32]) -> NDArray[np.int32]:
    """Drop the small disconnected pieces of each object.

    Args:
        objects: (M,) object of each voxel, 0 = none.

    Returns:
        (M,) the same numbers, 0 where a piece was dropped.
    """
    rows, columns = surface.neighbours.nonzero()
    inside = (objects[rows] > 0) & (objects[rows] == objects[columns])
    links = coo_matrix(
        (np.ones(int(inside.sum()), np.int8), (rows[inside], columns[inside])), shape=surface.neighbours.shape
    )
    _, piece = connected_components(links, directed=False)
    size = np.bincount(piece)
    largest = np.zeros(int(objects.max(initial=0)) + 1, np.int64)
    np.maximum.at(largest, objects, size[piece])
    keep = size[piece] >= MIN_PIECE_SHARE * largest[objects]
    return np.where(keep, objects, 0).astype(np.int32)


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
