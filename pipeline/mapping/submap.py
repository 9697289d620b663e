"""Geometric submaps: a TSDF per N_sub keyframes, or accumulated points for LiDAR (paper, Sec. III-B.1)."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import open3d.core as o3c
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, invert_rigid
from pipeline.mapping.accumulation import splat_depth
from pipeline.store.files import write_arrays

BLOCK_RESOLUTION = 8
_CACHED_SUBMAPS = 8
_NEAR_M = 0.1

# A finished submap in memory: a distance field, or the points of a LiDAR visit.
Surface = o3d.t.geometry.VoxelBlockGrid | NDArray[np.float32]

# Open3D warns about its own reallocations on every ray cast.
o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)


@dataclass(frozen=True)
class TsdfGrid:
    """How submaps of a visit are integrated.

    Attributes:
        voxel_size_m: edge of a voxel.
        truncation_voxels: truncation distance in voxels.
        max_depth_m: farther measurements are ignored.
    """

    voxel_size_m: float
    truncation_voxels: float
    max_depth_m: float


class TsdfSubmap:
    """One submap under construction: a sparse truncated signed distance field (Open3D VoxelBlockGrid)."""

    def __init__(self, grid: TsdfGrid) -> None:
        self._grid = grid
        self._volume = _new_volume(grid.voxel_size_m)
        self.keyframe_count = 0

    def integrate(
        self, depth: NDArray[np.float32], camera: PinholeCamera, T_world_camera: NDArray[np.float64]
    ) -> None:
        """Fuse a depth image (h, w) in metres, 0 = no measurement."""
        self.keyframe_count += 1
        if not (depth > 0).any():
            return
        image = o3d.t.geometry.Image(o3c.Tensor(np.ascontiguousarray(depth)))
        intrinsic = o3c.Tensor(camera.matrix)
        extrinsic = o3c.Tensor(invert_rigid(T_world_camera))
        far, band = self._grid.max_depth_m, self._grid.truncation_voxels
        blocks = self._volume.compute_unique_block_coordinates(image, intrinsic, extrinsic, 1.0, far, band)
        if len(blocks):
            self._volume.integrate(blocks, image, intrinsic, extrinsic, 1.0, far, band)

    def save(self, path: Path) -> None:
        """Write the submap (plain arrays: block coordinates, distances, weights)."""
        slots = self._volume.hashmap().active_buf_indices().to(o3c.int64)
        keys = self._volume.hashmap().key_tensor()[slots].numpy()
        # The hash map's order depends on threads; sorted blocks make the file reproducible.
        order = np.lexsort(keys.T[::-1])
        tsdf = self._volume.attribute("tsdf")[slots].numpy()[order]
        weight = self._volume.attribute("weight")[slots].numpy()[order]
        write_arrays(path, blocks=keys[order], tsdf=tsdf, weight=weight)


class SubmapSurfaces:
    """The finished TSDF submaps of a visit, loaded when a view needs them."""

    def __init__(self, folder: Path, grid: TsdfGrid) -> None:
        self._folder = folder
        self._grid = grid
        self._loaded: OrderedDict[int, Surface] = OrderedDict()

    def path(self, submap: int) -> Path:
        """File of a submap."""
        return self._folder / f"submap_{submap:04d}.npz"

    def render_depth(
        self, submaps: tuple[int, ...], camera: PinholeCamera, T_world_camera: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Depth of the nearest surface of some submaps as seen from a pose.

        Returns:
            (height, width) float32 metres along z; 0 where no surface is met.
        """
        nearest = np.full((camera.height, camera.width), np.inf, np.float32)
        for submap in submaps:
            surface = self._surface(submap)
            if isinstance(surface, np.ndarray):
                depth = splat_depth(surface, self._grid.voxel_size_m, camera, T_world_camera)
            else:
                depth = self._ray_cast(surface, camera, T_world_camera)
            nearest = np.where(depth > 0, np.minimum(nearest, depth), nearest)
        return np.where(np.isfinite(nearest), nearest, 0).astype(np.float32)

    def _ray_cast(
        self,
        volume: o3d.t.geometry.VoxelBlockGrid,
        camera: PinholeCamera,
        T_world_camera: NDArray[np.float64],
    ) -> NDArray[np.float32]:
        slots = volume.hashmap().active_buf_indices().to(o3c.int64)
        blocks = volume.hashmap().key_tensor()[slots].numpy() if len(slots) else np.zeros((0, 3), np.int32)
        visible = self._blocks_in_view(blocks, camera, T_world_camera)
        if not visible.any():
            return np.zeros((camera.height, camera.width), np.float32)
        cast = volume.ray_cast(
            o3c.Tensor(np.ascontiguousarray(blocks[visible])),
            o3c.Tensor(camera.matrix),
            o3c.Tensor(invert_rigid(T_world_camera)),
            camera.width,
            camera.height,
            ["depth"],
            1.0,
            _NEAR_M,
            self._grid.max_depth_m,
            1.0,
            self._grid.truncation_voxels,
        )
        return cast["depth"].numpy()[..., 0]

    def _blocks_in_view(
        self, blocks: NDArray[np.int32], camera: PinholeCamera, T_world_camera: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        edge_m = BLOCK_RESOLUTION * self._grid.voxel_size_m
        centres = (blocks + 0.5) * edge_m - T_world_camera[:3, 3]
        pixels, depth = camera.project(centres @ T_world_camera[:3, :3])
        margin = 1.5 * edge_m * camera.fx / np.maximum(depth, edge_m)
        inside = (pixels > -margin[:, None]).all(axis=1)
        inside &= (pixels[:, 0] < camera.width + margin) & (pixels[:, 1] < camera.height + margin)
        return inside & (depth > -edge_m) & (depth < self._grid.max_depth_m + edge_m)

    def _surface(self, submap: int) -> Surface:
        if submap in self._loaded:
            self._loaded.move_to_end(submap)
            return self._loaded[submap]
        with np.load(self.path(submap), allow_pickle=False) as file:
            arrays = dict(file)
        self._loaded[submap] = arrays["points_world"] if "points_world" in arrays else self._volume(arrays)
        while len(self._loaded) > _CACHED_SUBMAPS:
            self._loaded.popitem(last=False)
        return self._loaded[submap]

    def _volume(self, arrays: dict[str, NDArray[Any]]) -> o3d.t.geometry.VoxelBlockGrid:
        blocks = arrays["blocks"]
        volume = _new_volume(self._grid.voxel_size_m, max(64, len(blocks)))
        if len(blocks):
            slots, _ = volume.hashmap().activate(o3c.Tensor(blocks))
            rows = slots.to(o3c.int64)
            volume.attribute("tsdf")[rows] = o3c.Tensor(arrays["tsdf"])
            volume.attribute("weight")[rows] = o3c.Tensor(arrays["weight"])
        return volume


def _new_volume(voxel_size_m: float, blocks: int = 4096) -> o3d.t.geometry.VoxelBlockGrid:
    return o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (o3c.float32, o3c.float32), ((1), (1)), voxel_size_m, BLOCK_RESOLUTION, blocks
    )
