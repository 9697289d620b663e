"""The map that people see and export: depth pixels, not fused voxels.

Fusion drops thin things and rims for want of samples; their pixels are kept here, one per cell somewhat
smaller than a voxel, with the object of the nearest fused voxel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import open3d.core as o3c
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.camera import transform_points
from pipeline.mapping.front_end import SessionGeometry

CELL_VOXELS = 0.75
LABEL_REACH_VOXELS = 8.0


@dataclass(frozen=True)
class DenseMap:
    """Points of one visit: (P, 3) metres, (P, 3) RGB, (P,) instance, 0 = background."""

    points_world: NDArray[np.float32]
    colours: NDArray[np.uint8]
    instances: NDArray[np.int32]


def dense_map(
    geometry: SessionGeometry,
    instance_of_voxel: NDArray[np.int32],
    on_keyframe: Callable[[int], None],
) -> DenseMap:
    """One measured pixel per cell, keyframe by keyframe: earlier keyframes win."""
    cell_m = CELL_VOXELS * geometry.surface.voxel_size_m
    taken = o3c.HashMap(1 << 18, o3c.int32, o3c.SizeVector([3]), o3c.int32, o3c.SizeVector([1]))
    points_parts, colour_parts, voxel_parts = [], [], []
    for k, keyframe in enumerate(geometry.keyframes):
        depth = geometry.store.depth(k)
        measured = depth > 0
        points_camera = geometry.strided_camera(k).backproject(depth)[measured]
        points = transform_points(keyframe.T_world_camera, points_camera)
        if len(points):
            fresh = _first_in_cell(points, cell_m, taken)
            points_parts.append(points[fresh])
            colour_parts.append(geometry.store.rgb(k)[measured][fresh])
            voxel_parts.append(geometry.store.voxels(k)[measured][fresh])
        on_keyframe(k + 1)
    points = np.concatenate(points_parts) if points_parts else np.zeros((0, 3), np.float32)
    colours = np.concatenate(colour_parts) if colour_parts else np.zeros((0, 3), np.uint8)
    voxels = np.concatenate(voxel_parts) if voxel_parts else np.zeros(0, np.int32)
    return DenseMap(points, colours, _instances(points, voxels, geometry, instance_of_voxel))


def _first_in_cell(points: NDArray[np.float32], cell_m: float, taken: o3c.HashMap) -> NDArray[np.intp]:
    """Points that are the first in their cell, of this keyframe and of all before; marks their cells."""
    cells = np.floor(points / cell_m).astype(np.int32)
    low = cells.min(axis=0).astype(np.int64)
    size = cells.max(axis=0) - low + 1
    offset = cells - low
    _, first = np.unique((offset[:, 0] * size[1] + offset[:, 1]) * size[2] + offset[:, 2], return_index=True)
    first = np.sort(first)
    keys = o3c.Tensor(np.ascontiguousarray(cells[first]))
    _, found = taken.find(keys)
    fresh = first[~found.numpy()]
    if len(fresh):
        taken.insert(
            o3c.Tensor(np.ascontiguousarray(cells[fresh])), o3c.Tensor(np.zeros((len(fresh), 1), np.int32))
        )
    return fresh


def _instances(
    points: NDArray[np.float32],
    voxels: NDArray[np.int32],
    geometry: SessionGeometry,
    instance_of_voxel: NDArray[np.int32],
) -> NDArray[np.int32]:
    instances = np.where(voxels >= 0, instance_of_voxel[np.maximum(voxels, 0)], 0).astype(np.int32)
    loose = np.flatnonzero(voxels < 0)
    surface = geometry.surface
    if len(loose) and len(surface.points_world):
        reach_m = LABEL_REACH_VOXELS * surface.voxel_size_m
        tree = cKDTree(surface.points_world)
        distance, index = tree.query(points[loose], distance_upper_bound=reach_m, workers=-1)
        near = np.isfinite(distance)
        instances[loose[near]] = instance_of_voxel[index[near]]
    return instances
