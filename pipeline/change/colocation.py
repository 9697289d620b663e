"""Which objects of the two visits occupy the same place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

REACH_VOXELS = 2.0


def nearest_instances(
    points_world: NDArray[np.float32],
    instances: NDArray[np.int32],
    other_points_world: NDArray[np.float32],
    other_instances: NDArray[np.int32],
    voxel_size_m: float,
) -> NDArray[np.int32]:
    """(M,) for every voxel of an object, the instance of the nearest object voxel of the other visit.

    0 where the voxel is background or nothing of the other visit's objects is within ``REACH_VOXELS``.
    """
    nearest = np.zeros(len(instances), np.int32)
    own, others = np.flatnonzero(instances > 0), np.flatnonzero(other_instances > 0)
    if not len(own) or not len(others):
        return nearest
    tree = cKDTree(other_points_world[others])
    distance, index = tree.query(
        points_world[own], distance_upper_bound=REACH_VOXELS * voxel_size_m, workers=-1
    )
    found = np.isfinite(distance)
    nearest[own[found]] = other_instances[others[index[found]]]
    return nearest


def overlap_matrix(
    instances0: NDArray[np.int32],
    nearest0: NDArray[np.int32],
    count0: int,
    instances1: NDArray[np.int32],
    nearest1: NDArray[np.int32],
    count1: int,
) -> NDArray[np.float64]:
    """Intersection over union of the voxels of every pair of instances.

    Args:
        instances0, instances1: (M0,), (M1,) instance of each voxel, 0 = none (or not met yet).
        nearest0, nearest1: from ``nearest_instances``, in either direction.

    Returns:
        (count0, count1), in [0, 1].
    """
    shape = (count0 + 1, count1 + 1)
    forward = np.bincount(instances0.astype(np.int64) * shape[1] + nearest0, minlength=shape[0] * shape[1])
    backward = np.bincount(nearest1.astype(np.int64) * shape[1] + instances1, minlength=shape[0] * shape[1])
    both = (forward + backward).reshape(shape)[1:, 1:] / 2.0
    size0 = np.bincount(instances0, minlength=shape[0])[1:, None]
    size1 = np.bincount(instances1, minlength=shape[1])[None, 1:]
    return both / np.maximum(size0 + size1 - both, 1)
