"""Fine clouds of single objects, from the depth pixels of the keyframes that see them best.

Fused voxels are made for whole places; a print or the shape of a roof takes finer points to tell apart.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.association.cloud_agreement import ObjectCloud
from pipeline.camera import transform_points
from pipeline.mapping.colours import log_colour
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects

VIEWS_PER_OBJECT = 5
# A cell of the fine cloud is this share of a voxel.
CELL_PER_VOXEL = 0.4
_KEYFRAMES_KEPT = 24


def cell_m(geometry: SessionGeometry) -> float:
    """Distance of neighbouring points of the fine clouds, metres."""
    return CELL_PER_VOXEL * geometry.surface.voxel_size_m


class ObjectClouds:
    """Gathers the clouds of objects of one visit; remembers what it gathered.

    Args:
        geometry, objects: of the visit.
        log_gain: (3,) taken off the log colours, so that both visits' clouds are in one light.
    """

    def __init__(
        self, geometry: SessionGeometry, objects: SessionObjects, log_gain: NDArray[np.floating]
    ) -> None:
        self._geometry = geometry
        self._objects = objects
        self._log_gain = np.asarray(log_gain, np.float32)
        self.cell_m = cell_m(geometry)
        self._clouds: dict[int, ObjectCloud] = {}
        self._keyframe = lru_cache(_KEYFRAMES_KEPT)(self._read)

    def of(self, instance: int) -> ObjectCloud:
        """The cloud of an instance (counted from 1), at least one point."""
        if instance not in self._clouds:
            self._clouds[instance] = self._gather(instance)
        return self._clouds[instance]

    def _read(self, k: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Instance and voxel of the strided pixels of a keyframe, (h, w) each."""
        voxels = self._geometry.store.voxels(k)
        instances = np.where(voxels >= 0, self._objects.instance_of_voxel[np.maximum(voxels, 0)], 0)
        return instances.astype(np.int32), voxels

    def _gather(self, instance: int) -> ObjectCloud:
        geometry, surface = self._geometry, self._geometry.surface
        pixels = self._objects.view_pixels[:, instance]
        views = np.argsort(-pixels, kind="stable")[:VIEWS_PER_OBJECT]
        points, colours, voxels = [], [], []
        for k in views[pixels[views] > 0].tolist():
            instances, voxel_of_pixel = self._keyframe(k)
            chosen = instances == instance
            in_camera = geometry.strided_camera(k).backproject(geometry.store.depth(k))[chosen]
            points.append(transform_points(geometry.keyframes[k].T_world_camera, in_camera))
            gain = geometry.log_gains[k].astype(np.float32) + self._log_gain
            colours.append(log_colour(geometry.store.rgb(k)[chosen]) - gain)
            voxels.append(voxel_of_pixel[chosen])
        if not points:
            own = self._objects.instance_of_voxel == instance
            return ObjectCloud(
                surface.points_world[own],
                surface.normals_world[own],
                geometry.log_colours[own] - self._log_gain,
                surface.camera_positions_world,
            )
        viewpoints = surface.camera_positions_world[views[pixels[views] > 0]]
        return self._thinned(
            np.concatenate(points), np.concatenate(colours), np.concatenate(voxels), viewpoints
        )

    def _thinned(
        self,
        points: NDArray[np.float32],
        log_colours: NDArray[np.float32],
        voxels: NDArray[np.int32],
        viewpoints: NDArray[np.floating],
    ) -> ObjectCloud:
        """Mean point and colour of each cell, in the order of the cells."""
        cells = np.floor(points / self.cell_m).astype(np.int64)
        _, cell_of_point, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        cell_of_point = cell_of_point.ravel()
        sums = np.zeros((len(count), 9))
        values = np.concatenate([points, log_colours, self._geometry.surface.normals_world[voxels]], axis=1)
        for column in range(9):
            sums[:, column] = np.bincount(cell_of_point, values[:, column], len(count))
        means = sums / count[:, None]
        normals = means[:, 6:] / np.maximum(np.linalg.norm(means[:, 6:], axis=1, keepdims=True), 1e-9)
        return ObjectCloud(means[:, :3], normals, means[:, 3:6], viewpoints)
