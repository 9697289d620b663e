"""Finding the voxels that a camera may see without touching all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera

BLOCK_EDGE_VOXELS = 24


class VoxelBlocks:
    """Points sorted into coarse cubic blocks.

    Args:
        points_world: (M, 3) metres.
        voxel_size_m: edge of a voxel; blocks are ``BLOCK_EDGE_VOXELS`` of them wide.
    """

    def __init__(self, points_world: NDArray[np.float32], voxel_size_m: float) -> None:
        edge_m = BLOCK_EDGE_VOXELS * voxel_size_m
        blocks = np.floor(points_world / edge_m).astype(np.int64)
        unique, inverse = np.unique(blocks, axis=0, return_inverse=True)
        inverse = inverse.reshape(-1)
        self._order = np.argsort(inverse, kind="stable")
        self._start = np.searchsorted(inverse[self._order], np.arange(len(unique) + 1))
        self._centres = (unique + 0.5) * edge_m
        self._radius_m = edge_m * np.sqrt(3) / 2

    def in_view(
        self, camera: PinholeCamera, T_world_camera: NDArray[np.float64], far_m: float
    ) -> NDArray[np.intp]:
        """Points of all blocks that reach into the view frustum, ascending numbers."""
        if not len(self._centres):
            return np.zeros(0, np.intp)
        centres = (self._centres - T_world_camera[:3, 3]) @ T_world_camera[:3, :3]
        radius = self._radius_m
        inside = (centres[:, 2] > -radius) & (centres[:, 2] < far_m + radius)
        for axis, focal, low, high in (
            (0, camera.fx, -camera.cx, camera.width - 1 - camera.cx),
            (1, camera.fy, -camera.cy, camera.height - 1 - camera.cy),
        ):
            # Signed distances to the two side planes through the camera centre.
            for bound, sign in ((low / focal, 1.0), (high / focal, -1.0)):
                distance = sign * (centres[:, axis] - bound * centres[:, 2]) / np.hypot(1.0, bound)
                inside &= distance > -radius
        chosen = np.flatnonzero(inside)
        if not len(chosen):
            return np.zeros(0, np.intp)
        spans = [self._order[self._start[b] : self._start[b + 1]] for b in chosen]
        return np.sort(np.concatenate(spans))
