"""Where the instances of a visit are, and how to make instances of voxel numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects

# Bounds leave out this much at either end: one stray voxel must not stretch them.
_BOUND_PERCENTILES = (1.0, 99.0)


@dataclass(frozen=True)
class InstanceGeometry:
    """Per instance, entry 0 is background and holds zeros.

    Attributes:
        voxel_count: (K + 1,).
        centroid_world: (K + 1, 3) metres.
        low_world, high_world: (K + 1, 3) robust axis-aligned bounds, metres.
    """

    voxel_count: NDArray[np.int64]
    centroid_world: NDArray[np.float64]
    low_world: NDArray[np.float64]
    high_world: NDArray[np.float64]


def instance_geometry(geometry: SessionGeometry, objects: SessionObjects) -> InstanceGeometry:
    """Place and size of all instances."""
    size = objects.count + 1
    centroid, low, high = (np.zeros((size, 3)) for _ in range(3))
    points = voxels_by_instance(objects)
    for instance in range(1, size):
        cloud = geometry.surface.points_world[points[instance]].astype(np.float64)
        if len(cloud):
            centroid[instance] = cloud.mean(axis=0)
            low[instance], high[instance] = np.percentile(cloud, _BOUND_PERCENTILES, axis=0)
    count = np.array([0, *(len(voxels) for voxels in points[1:])], np.int64)
    return InstanceGeometry(count, centroid, low, high)


def voxels_by_instance(objects: SessionObjects) -> list[NDArray[np.intp]]:
    """Voxels of each instance, ascending; entry 0 (background) is empty."""
    owner = objects.instance_of_voxel
    owned = np.flatnonzero(owner > 0)
    owned = owned[np.argsort(owner[owned], kind="stable")]
    starts = np.searchsorted(owner[owned], np.arange(objects.count + 2))
    empty = np.zeros(0, np.intp)
    return [empty, *(owned[starts[i] : starts[i + 1]] for i in range(1, objects.count + 1))]


def numbered(geometry: SessionGeometry, owner: NDArray[np.integer]) -> SessionObjects:
    """Instances of arbitrary voxel numbers (0 = background), numbered 1, 2, ... in ascending order.

    Args:
        geometry: the mapped visit of M voxels.
        owner: (M,) number of each voxel.
    """
    kept = np.unique(owner[owner > 0])
    instances = np.where(owner > 0, np.searchsorted(kept, owner) + 1, 0).astype(np.int32)
    view_pixels = np.zeros((len(geometry.keyframes), len(kept) + 1), np.int32)
    for k in range(len(geometry.keyframes)):
        voxels = geometry.store.voxels(k)
        view_pixels[k] = np.bincount(instances[voxels[voxels >= 0]], minlength=len(kept) + 1)
    view_pixels[:, 0] = 0
    return SessionObjects(instances, len(kept), view_pixels)
