"""Geometric submaps: a TSDF per N_sub keyframes, or accumulated points for LiDAR (paper, Sec. III-B.1)."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path

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
_BLOCKS = 4096
# Voxels seen in a single pixel (weight 1) count: sparse keyframes see much of a place once only. Open3D keeps
# what lies above the threshold, not at it.
MIN_WEIGHT = 0.5
CAST_THREADS = 2


# Open3D warns about reallocations of its own while integrating.
o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)


@dataclass(frozen=True)
class LoadedSubmap:
    """A finished submap in memory.

    Attributes:
        points_world: (P, 3) float32 metres: vertices of the mesh, or the points of a LiDAR visit.
        mesh: to cast rays at; None without triangles.
    """

    points_world: NDArray[np.float32]
    mesh: o3d.t.geometry.RaycastingScene | None


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
        """Write the surface of the submap as a triangle mesh: vertices (V, 3) metres, triangles (T, 3)."""
        vertices, triangles = self._mesh()
        vertices, triangles = _in_canonical_order(vertices, triangles)
        write_arrays(path, points_world=vertices, triangles=triangles)

    def _mesh(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        nothing = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32)
        if not len(self._volume.hashmap().active_buf_indices()):
            return nothing
        try:
            mesh = self._volume.extract_triangle_mesh(MIN_WEIGHT)
        except RuntimeError:
            # Open3D cannot build a mesh without vertices: depth that crosses no voxel corner leaves none.
            return nothing
        return mesh.vertex.positions.numpy(), mesh.triangle.indices.numpy()


class SubmapSurfaces:
    """The finished submaps of a visit, loaded when a view needs them.

    Args:
        folder: where they were saved.
        grid: how they were integrated.
        T_world_saved: (4, 4) from the world of the saved surfaces to the world of the poses of views;
            None = the same.
    """

    def __init__(
        self, folder: Path, grid: TsdfGrid, T_world_saved: NDArray[np.float64] | None = None
    ) -> None:
        self._folder = folder
        self._grid = grid
        self._T_world_saved = T_world_saved
        self._loaded: OrderedDict[int, LoadedSubmap] = OrderedDict()

    def path(self, submap: int) -> Path:
        """File of a submap."""
        return self._folder / f"submap_{submap:04d}.npz"

    def moved(self, T_new_world: NDArray[np.float64]) -> SubmapSurfaces:
        """The same submaps in another world frame; nothing is copied, views are turned back instead."""
        before = np.eye(4) if self._T_world_saved is None else self._T_world_saved
        return SubmapSurfaces(self._folder, self._grid, T_new_world @ before)

    def render_depth(
        self, submaps: tuple[int, ...], camera: PinholeCamera, T_world_camera: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Depth of the nearest surface of some submaps as seen from a pose.

        Returns:
            (height, width) float32 metres along z; 0 where no surface is met.
        """
        if self._T_world_saved is not None:
            T_world_camera = invert_rigid(self._T_world_saved) @ T_world_camera
        nearest = np.full((camera.height, camera.width), np.inf, np.float32)
        for submap in submaps:
            loaded = self._load(submap)
            depth = splat_depth(loaded.points_world, self._grid.voxel_size_m, camera, T_world_camera)
            if loaded.mesh is not None:
                # The mesh is exact; its vertices fill what lies between triangles that were never closed,
                # as around the single views of a sparse visit.
                cast = _cast(loaded.mesh, camera, T_world_camera)
                depth = np.where(cast > 0, cast, depth)
            seen = (depth > 0) & (depth < self._grid.max_depth_m)
            nearest = np.where(seen, np.minimum(nearest, depth), nearest)
        return np.where(np.isfinite(nearest), nearest, 0).astype(np.float32)

    def forget(self) -> None:
        """Free the surfaces in memory; they are loaded again when a view needs them."""
        self._loaded.clear()

    def _load(self, submap: int) -> LoadedSubmap:
        if submap in self._loaded:
            self._loaded.move_to_end(submap)
            return self._loaded[submap]
        with np.load(self.path(submap), allow_pickle=False) as file:
            points, triangles = file["points_world"], file.get("triangles", np.zeros((0, 3), np.int32))
        mesh = None
        if len(triangles):
            mesh = o3d.t.geometry.RaycastingScene(CAST_THREADS)
            mesh.add_triangles(o3c.Tensor(points), o3c.Tensor(triangles.astype(np.uint32)))
        self._loaded[submap] = LoadedSubmap(points, mesh)
        while len(self._loaded) > _CACHED_SUBMAPS:
            self._loaded.popitem(last=False)
        return self._loaded[submap]


def _cast(
    mesh: o3d.t.geometry.RaycastingScene, camera: PinholeCamera, T_world_camera: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Depth of a mesh; 0 where a ray meets nothing.

    VoxelBlockGrid.ray_cast is not used: its range map depends on the order of threads, so that the same
    view came out differently from run to run, and at odd image sizes a cast could go on forever.
    """
    rays = mesh.create_rays_pinhole(
        o3c.Tensor(camera.matrix), o3c.Tensor(invert_rigid(T_world_camera)), camera.width, camera.height
    )
    # Rays of a pinhole camera have unit length along z: the distance to the hit is the depth.
    depth = mesh.cast_rays(rays)["t_hit"].numpy()
    return np.where(np.isfinite(depth) & (depth > _NEAR_M), depth, 0).astype(np.float32)


def _in_canonical_order(
    vertices: NDArray[np.float32], triangles: NDArray[np.integer]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """The same mesh in an order that follows from its geometry; threads extract it in any order."""
    order = np.lexsort(vertices.T[::-1])
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    renumbered = place[triangles] if len(triangles) else np.zeros((0, 3), np.int32)
    return vertices[order], renumbered[np.lexsort(renumbered.T[::-1])]


def _new_volume(voxel_size_m: float) -> o3d.t.geometry.VoxelBlockGrid:
    one = o3c.SizeVector([1])
    return o3d.t.geometry.VoxelBlockGrid(
        ("tsdf", "weight"), (o3c.float32, o3c.float32), (one, one), voxel_size_m, BLOCK_RESOLUTION, _BLOCKS
    )
