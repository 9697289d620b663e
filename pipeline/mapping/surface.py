"""The fused surface of one visit: voxels with position, normal and colour, and which pixels fell in each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix


@dataclass(frozen=True)
class FusedSurface:
    """Every voxel that enough pixels of a visit fell into, as one array per property.

    Attributes:
        voxel_size_m: edge of a voxel; the unit of every radius that is given in voxels.
        points_world: (M, 3) float32 mean position of the samples of each voxel, metres.
        normals_world: (M, 3) float32 unit normals, smoothed once over the neighbours, facing the cameras.
        lab: (M, 3) float32 mean CIE L*a*b* colour (L in 0..100).
        sample_count: (M,) int32 pixels that fell into the voxel.
        neighbours: (M, M) symmetric adjacency (ones) of voxels whose points are within 1.9 voxels.
        up_world: (3,) unit vector against gravity, estimated from the cameras and the surfaces.
        camera_positions_world: (N, 3) camera centres of the keyframes, metres.
    """

    voxel_size_m: float
    points_world: NDArray[np.float32]
    normals_world: NDArray[np.float32]
    lab: NDArray[np.float32]
    sample_count: NDArray[np.int32]
    neighbours: csr_matrix
    up_world: NDArray[np.float64]
    camera_positions_world: NDArray[np.float64]
