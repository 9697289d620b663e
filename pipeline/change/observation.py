"""What the keyframes of one visit observed at the surface voxels of the other.

A voxel counts as *hit* when the other visit measured a surface there, as *free* when it saw through it,
and as neither when something stood in front of it: occluded is not observed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, rotate_points
from pipeline.mapping.colours import log_colour
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.surface import FusedSurface
from pipeline.mapping.voxel_blocks import VoxelBlocks
from pipeline.settings import ObservationSettings

_KERNEL = np.ones((3, 3), np.uint8)
_FAR_M = 99.0


@dataclass(frozen=True)
class DepthWindow:
    """A depth image and its extremes over 3x3 pixels.

    Attributes:
        depth: (h, w) metres, 0 = no measurement.
        nearest: (h, w) smallest measured depth around each pixel; far away where there is none.
        farthest: (h, w) largest depth around each pixel.
        complete_nearest: (h, w) smallest depth, 0 as soon as one pixel around lacks a measurement.
    """

    depth: NDArray[np.float32]
    nearest: NDArray[np.float32]
    farthest: NDArray[np.float32]
    complete_nearest: NDArray[np.float32]

    @classmethod
    def of(cls, depth: NDArray[np.float32]) -> DepthWindow:
        """Extremes of a depth image."""
        filled = np.where(depth > 0, depth, np.float32(_FAR_M))
        return cls(depth, cv2.erode(filled, _KERNEL), cv2.dilate(depth, _KERNEL), cv2.erode(depth, _KERNEL))


@dataclass(frozen=True)
class Glimpse:
    """What one keyframe observed at the voxels of a surface.

    Attributes:
        voxels: (V,) the voxels it observed.
        is_free: (V,) seen through; the others were hit.
        colour_voxels: (C,) voxels whose colour it saw well.
        log_colours: (C, 3) log RGB it saw there, the keyframe's exposure taken out.
    """

    voxels: NDArray[np.int32]
    is_free: NDArray[np.bool_]
    colour_voxels: NDArray[np.int32]
    log_colours: NDArray[np.float32]


def glimpse(
    surface: FusedSurface,
    candidates: NDArray[np.intp],
    window: DepthWindow,
    rgb: NDArray[np.uint8],
    log_gain: NDArray[np.float64],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
    settings: ObservationSettings,
) -> Glimpse:
    """Compare a keyframe's depth with the voxels of a surface.

    Args:
        surface: of the other visit.
        candidates: voxels that may be in view.
        window, rgb: the keyframe's depth and colour at the camera's size.
        log_gain: (3,) the keyframe's exposure.
    """
    points = surface.points_world[candidates] - T_world_camera[:3, 3].astype(np.float32)
    points_camera = rotate_points(T_world_camera[:3, :3].T, points)
    pixels, depth = camera.project(points_camera)
    column, row = np.rint(pixels).astype(np.int32).T
    inside = (depth > settings.near_m) & (column >= 1) & (row >= 1)
    inside &= (column < camera.width - 1) & (row < camera.height - 1)
    kept = np.flatnonzero(inside)
    column, row, depth = column[kept], row[kept], depth[kept]
    voxels = candidates[kept].astype(np.int32)
    ray = points[kept] / np.maximum(np.linalg.norm(points[kept], axis=1, keepdims=True), 1e-9)
    facing = -np.einsum("vc,vc->v", ray, surface.normals_world[voxels])
    cosine = np.clip(np.abs(facing), 0.2, 1.0)
    least_m = max(settings.tolerance_voxels * surface.voxel_size_m, settings.tolerance_m)
    tolerance = least_m + settings.tolerance_per_metre * depth

    behind = window.complete_nearest[row, column]
    is_free = (behind > 0) & ((behind - depth) * cosine > tolerance)
    slack = tolerance / np.sqrt(cosine)
    measured = window.depth[row, column]
    is_hit = (measured > 0) & ~is_free
    is_hit &= (window.nearest[row, column] - slack < depth) & (depth < window.farthest[row, column] + slack)
    observed = is_free | is_hit
    well_seen = is_hit & (np.abs(measured - depth) < slack) & (facing > settings.colour_min_cosine)
    colours = log_colour(rgb[row[well_seen], column[well_seen]]) - log_gain.astype(np.float32)
    return Glimpse(voxels[observed], is_free[observed], voxels[well_seen], colours)


def glimpses(
    observed: SessionGeometry, observer: SessionGeometry, settings: ObservationSettings, max_depth_m: float
) -> Iterator[Glimpse]:
    """What each keyframe of ``observer`` saw at the voxels of ``observed``, in recording order."""
    blocks = VoxelBlocks(observed.surface.points_world, observed.surface.voxel_size_m)
    for k, keyframe in enumerate(observer.keyframes):
        camera = observer.strided_camera(k)
        candidates = blocks.in_view(camera, keyframe.T_world_camera, max_depth_m)
        window = DepthWindow.of(observer.store.depth(k))
        yield glimpse(
            observed.surface,
            candidates,
            window,
            observer.store.rgb(k),
            observer.log_gains[k],
            camera,
            keyframe.T_world_camera,
            settings,
        )


class Observation:
    """Running sums of glimpses per voxel.

    Attributes:
        free_count, hit_count: (M,) keyframes that saw through, or hit, each voxel.
    """

    def __init__(self, voxel_count: int) -> None:
        self.free_count = np.zeros(voxel_count, np.uint16)
        self.hit_count = np.zeros(voxel_count, np.uint16)
        self._colour_sum = np.zeros((voxel_count, 3), np.float32)
        self._colour_count = np.zeros(voxel_count, np.uint16)

    def add(self, seen: Glimpse) -> None:
        """Add one keyframe's glimpse (each voxel occurs at most once in it)."""
        self.free_count[seen.voxels[seen.is_free]] += 1
        self.hit_count[seen.voxels[~seen.is_free]] += 1
        self._colour_sum[seen.colour_voxels] += seen.log_colours
        self._colour_count[seen.colour_voxels] += 1

    def to_sparse(self) -> dict[str, NDArray[np.generic]]:
        """The entries of the voxels that were observed, as plain arrays."""
        voxels = np.flatnonzero((self.free_count > 0) | (self.hit_count > 0) | (self._colour_count > 0))
        return {
            "voxels": voxels.astype(np.int32),
            "free_count": self.free_count[voxels],
            "hit_count": self.hit_count[voxels],
            "colour_sum": self._colour_sum[voxels],
            "colour_count": self._colour_count[voxels],
        }

    def add_sparse(self, entries: Mapping[str, NDArray[Any]]) -> None:
        """Add what ``to_sparse`` gave."""
        voxels = entries["voxels"]
        self.free_count[voxels] += entries["free_count"]
        self.hit_count[voxels] += entries["hit_count"]
        self._colour_sum[voxels] += entries["colour_sum"]
        self._colour_count[voxels] += entries["colour_count"]

    @property
    def is_observed(self) -> NDArray[np.bool_]:
        """(M,) whether any keyframe saw the voxel or through it."""
        return (self.free_count > 0) | (self.hit_count > 0)

    @property
    def has_colour(self) -> NDArray[np.bool_]:
        """(M,) whether the other visit's colour is known."""
        return self._colour_count > 0

    @property
    def log_colours(self) -> NDArray[np.float32]:
        """(M, 3) the other visit's mean log RGB; zeros where ``has_colour`` is false."""
        return self._colour_sum / np.maximum(self._colour_count, 1).astype(np.float32)[:, None]

    def is_contradicted(self, settings: ObservationSettings) -> NDArray[np.bool_]:
        """(M,) for an observation by the voxels' own visit: whether too many of its views deny them."""
        free, hit = self.free_count.astype(np.int32), self.hit_count.astype(np.int32)
        return free > settings.own_free_ratio * (free + hit)

    def is_seen_through(self, settings: ObservationSettings) -> NDArray[np.bool_]:
        """(M,) whether the voxel is empty in the other visit: mostly free, and not by one stray pixel."""
        free, hit = self.free_count.astype(np.int32), self.hit_count.astype(np.int32)
        enough = (free >= settings.min_free) | ((free >= 1) & (hit == 0))
        return enough & (free > settings.free_ratio * (free + hit))
