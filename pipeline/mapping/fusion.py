"""Fusing keyframes into one voxel map per visit, keyframe by keyframe.

The map grows with the place, not with the recording: what is kept per keyframe (which pixel fell into
which voxel) goes back to the caller, who puts it on disk.
"""

from __future__ import annotations

import numpy as np
import open3d.core as o3c
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from pipeline.mapping.surface import FusedSurface

NEIGHBOUR_RADIUS_VOXELS = 1.9
_CHANNELS = 9  # point, normal, L*a*b*


class VoxelFusion:
    """Incremental mean of points, normals and colours per voxel.

    Voxels are numbered in the order in which they are first met (within a keyframe by their key), so the
    same keyframes always give the same numbers.
    """

    def __init__(self, voxel_size_m: float) -> None:
        self.voxel_size_m = voxel_size_m
        self._index_of_key = o3c.HashMap(
            1 << 18, o3c.int32, o3c.SizeVector([3]), o3c.int32, o3c.SizeVector([1])
        )
        self._size = 0
        self._sums = np.zeros((1 << 16, _CHANNELS), np.float64)
        self._counts = np.zeros(1 << 16, np.int32)
        self._first_keyframe = np.zeros(1 << 16, np.int32)
        self._camera_positions: list[NDArray[np.float64]] = []
        self._camera_up: list[NDArray[np.float64]] = []

    def add(
        self,
        points_world: NDArray[np.float32],
        normals_world: NDArray[np.float32],
        lab: NDArray[np.float32],
        T_world_camera: NDArray[np.float64],
    ) -> NDArray[np.int32]:
        """Fuse one keyframe.

        Args:
            points_world: (P, 3) metres; normals_world: (P, 3) unit; lab: (P, 3).
            T_world_camera: (4, 4) pose, for gravity.

        Returns:
            (P,) raw voxel number of each point; ``finish`` says what becomes of raw numbers.
        """
        keyframe = len(self._camera_positions)
        self._camera_positions.append(T_world_camera[:3, 3].copy())
        self._camera_up.append(-T_world_camera[:3, 1])
        if not len(points_world):
            return np.zeros(0, np.int32)
        cells = np.floor(points_world / self.voxel_size_m).astype(np.int32)
        unique_cells, inverse = _unique_rows(cells)
        numbers = self._numbers(unique_cells, keyframe)
        channels = np.concatenate([points_world, normals_world, lab], axis=1)
        for channel in range(_CHANNELS):
            self._sums[numbers, channel] += np.bincount(inverse, channels[:, channel], len(unique_cells))
        self._counts[numbers] += np.bincount(inverse, minlength=len(unique_cells)).astype(np.int32)
        return numbers[inverse]

    def _numbers(self, unique_cells: NDArray[np.int32], keyframe: int) -> NDArray[np.int32]:
        keys = o3c.Tensor(np.ascontiguousarray(unique_cells))
        slots, found = self._index_of_key.find(keys)
        is_known = found.numpy()
        numbers = np.empty(len(unique_cells), np.int32)
        # Read before inserting: the map may move its slots when it grows.
        numbers[is_known] = self._index_of_key.value_tensor().numpy()[slots.numpy()[is_known], 0]
        count = len(unique_cells) - int(is_known.sum())
        if count:
            self._reserve(self._size + count)
            fresh = np.arange(self._size, self._size + count, dtype=np.int32)
            self._index_of_key.insert(
                o3c.Tensor(np.ascontiguousarray(unique_cells[~is_known])), o3c.Tensor(fresh[:, None])
            )
            numbers[~is_known] = fresh
            self._first_keyframe[fresh] = keyframe
            self._size += count
        return numbers

    def _reserve(self, size: int) -> None:
        while len(self._counts) < size:
            self._sums = np.concatenate([self._sums, np.zeros_like(self._sums)])
            self._counts = np.concatenate([self._counts, np.zeros_like(self._counts)])
            self._first_keyframe = np.concatenate([self._first_keyframe, np.zeros_like(self._first_keyframe)])

    def finish(self, min_samples: int) -> tuple[FusedSurface, NDArray[np.int32], NDArray[np.int32]]:
        """The surface of all voxels with enough samples.

        Returns:
            The surface (M voxels); (raw voxels,) the number of each raw voxel in it, -1 = dropped;
            (M,) the keyframe that first met each voxel.
        """
        counts = self._counts[: self._size]
        kept = np.flatnonzero(counts >= min_samples)
        remap = np.full(self._size, -1, np.int32)
        remap[kept] = np.arange(len(kept), dtype=np.int32)
        means = self._sums[kept] / counts[kept, None]
        points = means[:, :3]
        neighbours = _neighbours(points, NEIGHBOUR_RADIUS_VOXELS * self.voxel_size_m)
        normals = _unit(means[:, 3:6])
        degree = np.maximum(np.asarray(neighbours.sum(axis=1)), 1.0)
        normals = _unit(normals + (neighbours @ normals) / degree)
        surface = FusedSurface(
            voxel_size_m=self.voxel_size_m,
            points_world=points.astype(np.float32),
            normals_world=normals.astype(np.float32),
            lab=means[:, 6:9].astype(np.float32),
            sample_count=counts[kept].copy(),
            neighbours=neighbours,
            up_world=_estimate_up(normals, self._camera_up),
            camera_positions_world=np.array(self._camera_positions, np.float64).reshape(-1, 3),
        )
        return surface, remap, self._first_keyframe[kept].copy()


def _unique_rows(cells: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """Distinct rows and, for each row, which distinct one it is; one sort of packed keys."""
    low = cells.min(axis=0).astype(np.int64)
    size = cells.max(axis=0).astype(np.int64) - low + 1
    packed = cells - low
    keys = (packed[:, 0] * size[1] + packed[:, 1]) * size[2] + packed[:, 2]
    unique_keys, inverse = np.unique(keys, return_inverse=True)
    rest, z = np.divmod(unique_keys, size[2])
    x, y = np.divmod(rest, size[1])
    return (np.stack([x, y, z], axis=1) + low).astype(np.int32), inverse


def _neighbours(points: NDArray[np.floating], radius_m: float) -> coo_matrix:
    if not len(points):
        return coo_matrix((0, 0), dtype=np.float32).tocsr()
    pairs = cKDTree(points).query_pairs(radius_m, output_type="ndarray").astype(np.int32)
    rows = np.concatenate([pairs[:, 0], pairs[:, 1]])
    columns = np.concatenate([pairs[:, 1], pairs[:, 0]])
    ones = np.ones(len(rows), np.float32)
    return coo_matrix((ones, (rows, columns)), shape=(len(points), len(points))).tocsr()


def _unit(vectors: NDArray[np.floating]) -> NDArray[np.floating]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)


def _estimate_up(
    normals_world: NDArray[np.floating], camera_up: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Direction against gravity: the cameras' mean up, refined by the surfaces nearly orthogonal to it."""
    up = np.mean(camera_up, axis=0) if camera_up else np.array([0.0, 0.0, 1.0])
    length = np.linalg.norm(up)
    # A camera that looks straight down all the time says nothing about up.
    up = up / length if length > 0.2 else np.array([0.0, 0.0, 1.0])
    for angle_deg in (40, 20, 10, 6, 4):
        level = normals_world[np.abs(normals_world @ up) > np.cos(np.deg2rad(angle_deg))]
        if len(level) < 100:
            break
        signed = level * np.sign(level @ up)[:, None]
        _, eigenvectors = np.linalg.eigh(signed.T @ signed)
        axis = eigenvectors[:, -1]
        up = axis * np.sign(axis @ up)
    return np.asarray(up, np.float64)
