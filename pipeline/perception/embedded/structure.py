"""Walls, floors and ceilings: large planes, or stretches of rough ground, that hide nothing.

A table top or a car roof is large too, but something is seen behind it or beside and below it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.components import Floats, Indices, Mask, Pieces
from pipeline.perception.embedded.gravity_view import GravityView, HullMask, plane_axes
from pipeline.settings import DiscoverySettings

_REFERENCE_VOXEL_M = 0.02
_CELL_VOXELS = 4.0
_BEHIND_VOXELS = 4.0
_SCORED_VOXELS = 8000
_MIN_INLIERS = 100
_LEVEL_COSINE = 0.97
_SLOPE_COSINE = 0.8
_WALL_COSINE = 0.2
_FLAT_COSINE = 0.999


@dataclass(frozen=True)
class Plane:
    """A structural plane: points with ``normal_world @ point = offset_m``, seen from the normal's side.

    Attributes:
        normal_world: (3,) unit normal.
        offset_m: distance of the plane from the world's origin along the normal, metres.
        area_m2: area of the cells that voxels of the plane occupy.
        kind: what the plane is to somebody standing in the place.
    """

    normal_world: Floats
    offset_m: float
    area_m2: float
    kind: str


@dataclass(frozen=True)
class Structure:
    """What does not belong to any object.

    Attributes:
        is_structure: (M,) voxels of walls, floors, ceilings and ground.
        planes: the planes found, as ``wall``, ``floor`` or ``ceiling``; rough ground has none.
        floor: index in ``planes`` of the largest floor, -1 when there is none.
    """

    is_structure: Mask
    planes: tuple[Plane, ...]
    floor: int


def find_structure(surface: FusedSurface, settings: DiscoverySettings, seed: int) -> Structure:
    """Voxels of walls, floors, ceilings and ground of a surface of M voxels.

    Planes come from one-point RANSAC; each connected patch of a plane is judged by itself.
    """
    count = len(surface.points_world)
    if count < _MIN_INLIERS:
        return Structure(np.zeros(count, np.bool_), (), -1)
    search = _PlaneSearch(surface, GravityView.of(surface), settings, np.random.default_rng(seed))
    for _ in range(settings.structure_rounds):
        if not search.next_plane():
            break
    search.take_rough_ground()
    floors = [i for i, plane in enumerate(search.planes) if plane.kind == "floor"]
    floor = max(floors, key=lambda i: search.planes[i].area_m2, default=-1)
    return Structure(search.is_structure, tuple(search.planes), floor)


class _PlaneSearch:
    """The state of the search: what is left to explain, and what has been found."""

    def __init__(
        self, surface: FusedSurface, view: GravityView, settings: DiscoverySettings, rng: np.random.Generator
    ):
        self._voxel = surface.voxel_size_m
        self._view = view
        self._points = view.centred
        self._origin = np.asarray(surface.points_world, np.float64).mean(axis=0)
        self._normals = np.asarray(surface.normals_world, np.float64)
        broad = self._normals + surface.neighbours @ self._normals
        self._broad_normals = broad / np.maximum(np.linalg.norm(broad, axis=1, keepdims=True), 1e-9)
        self._neighbours = surface.neighbours
        self._settings = settings
        self._rng = rng
        scale = max(1.0, self._voxel / _REFERENCE_VOXEL_M) ** 2
        self._wall_area = settings.wall_area_m2 * scale
        self._level_area = settings.level_area_m2 * scale
        self._left = np.ones(len(self._points), np.bool_)
        self.is_structure = np.zeros(len(self._points), np.bool_)
        self.planes: list[Plane] = []

    def next_plane(self) -> bool:
        """Find the largest plane left and take its structural patches; False when none is worth it."""
        left = np.flatnonzero(self._left)
        if len(left) < _MIN_INLIERS:
            return False
        scored = left[self._rng.integers(len(left), size=min(_SCORED_VOXELS, len(left)))]
        found = self._best_hypothesis(scored)
        if found is None:
            return False
        normal, offset, votes = found
        if votes < 0.008 * len(scored):
            return False
        normal, offset = self._refined(normal, offset, left)
        self._take_patches(normal, offset)
        return True

    def _best_hypothesis(self, scored: Indices) -> tuple[Floats, float, int] | None:
        chosen = self._rng.choice(scored, self._settings.structure_hypotheses)
        raw = self._broad_normals[chosen]
        cosine = raw @ self._view.up
        upright = np.abs(cosine) < _WALL_COSINE
        level = np.abs(cosine) > _LEVEL_COSINE
        snapped = np.where(upright[:, None], raw - cosine[:, None] * self._view.up, 0.0)
        snapped /= np.maximum(np.linalg.norm(snapped, axis=1, keepdims=True), 1e-9)
        snapped = np.where(level[:, None], np.sign(cosine)[:, None] * self._view.up, snapped)
        sloping = cosine > _SLOPE_COSINE
        normals = np.concatenate([snapped[upright | level], raw[sloping]])
        if not len(normals):
            return None
        through = self._points[np.concatenate([chosen[upright | level], chosen[sloping]])]
        offsets = np.einsum("ij,ij->i", normals, through)
        distance = np.abs(self._points[scored] @ normals.T - offsets)
        aligned = self._normals[scored] @ normals.T > 0.85
        votes = ((distance < 1.2 * self._voxel) & aligned).sum(axis=0)
        best = int(votes.argmax())
        return normals[best], float(offsets[best]), int(votes[best])

    def _refined(self, normal: Floats, offset: float, left: Indices) -> tuple[Floats, float]:
        points, normals = self._points[left], self._normals[left]
        for _ in range(4):
            near = (np.abs(points @ normal - offset) < 2 * self._voxel) & (normals @ normal > 0.8)
            if near.sum() < _MIN_INLIERS:
                break
            chosen = points[near]
            centre = np.ones(len(chosen)) @ chosen / len(chosen)
            chosen -= centre
            _, vectors = np.linalg.eigh(chosen.T @ chosen)
            fitted = vectors[:, 0] * np.sign(vectors[:, 0] @ normal)
            if fitted @ normal < 0.98:
                break
            normal, offset = fitted, float(centre @ fitted)
        return normal, offset

    def _take_patches(self, normal: Floats, offset: float) -> None:
        distance = self._points @ normal - offset
        aligned = self._normals @ normal
        near = np.abs(distance) < 2 * self._voxel
        inliers = self._left & near & (aligned > 0.75)
        self._left &= ~inliers
        tilt = float(normal @ self._view.up)
        is_level = abs(tilt) > _SLOPE_COSINE
        axes = np.stack(plane_axes(normal, self._view.axis if is_level else self._view.up), axis=1)
        plane_view = self._points @ axes / (_CELL_VOXELS * self._voxel)
        patches = _Patches(plane_view, np.flatnonzero(inliers))
        area = patches.occupied * (_CELL_VOXELS * self._voxel) ** 2
        behind = patches.count_inside(np.flatnonzero(distance < -_BEHIND_VOXELS * self._voxel))
        limit = self._settings.level_hidden if is_level else self._settings.wall_hidden
        large = area > (self._level_area if is_level else self._wall_area)
        for patch in np.flatnonzero(large & (behind < limit * patches.inliers)):
            if patch == 0:
                continue
            if tilt > 0 and is_level and self._is_raised(patches.mask(int(patch)), patches, distance):
                continue
            grown = patches.voxels_in_dilated(int(patch))
            taken = inliers & (patches.number == patch)
            taken |= grown & (distance < 1.6 * self._voxel) & (distance > -4 * self._voxel)
            kind = "wall" if not is_level else "floor" if tilt > 0 else "ceiling"
            if kind == "floor":
                band = (np.abs(distance) < self._settings.floor_band_voxels * self._voxel) & (aligned > 0.8)
                if tilt < _FLAT_COSINE:  # a slope carried on for ever would cut through what stands far off
                    band &= HullMask.around(plane_view[taken], 1).contains(plane_view)
                taken |= band
            self.is_structure |= taken
            self._left &= ~taken
            world_offset = offset + float(normal @ self._origin)
            self.planes.append(Plane(normal, world_offset, float(area[patch]), kind))

    def _is_raised(self, mask: NDArray[np.uint8], patches: _Patches, distance: Floats) -> bool:
        """Whether the surface goes on lower, just outside the patch, along much of its border."""
        ring = (cv2.dilate(mask, np.ones((5, 5), np.uint8)) > 0) & (mask == 0)
        cells = patches.cells
        in_ring = ring[cells[:, 0], cells[:, 1]]
        seen = np.zeros(ring.shape, np.bool_)
        seen[cells[in_ring, 0], cells[in_ring, 1]] = True
        below = in_ring & (distance < -_BEHIND_VOXELS * self._voxel)
        lower = np.zeros(ring.shape, np.bool_)
        lower[cells[below, 0], cells[below, 1]] = True
        return bool(lower.sum() > self._settings.raised_border * max(1, seen.sum()))

    def take_rough_ground(self) -> None:
        """Take large connected stretches that face up, are no plane, and have nothing below or beside."""
        facing_up = ~self.is_structure & (self._normals @ self._view.up > self._settings.support_up_cosine)
        stretches = Pieces.of(facing_up, self._neighbours)
        least_voxels = 0.5 * self._level_area / self._voxel**2
        plan = (self._view.plan[:, 0] / _CELL_VOXELS, self._view.plan[:, 1] / _CELL_VOXELS)
        for stretch in np.flatnonzero(stretches.sizes > least_voxels):
            members = stretches.voxels_of(np.array([stretch]))
            around = self._around(plan, members)
            patches = _Patches(
                np.stack([axis[around] for axis in plan], axis=1), np.searchsorted(around, members)
            )
            area = patches.occupied.sum() * (_CELL_VOXELS * self._voxel) ** 2
            if area < self._level_area:
                continue
            ground = patches.height_map(self._view.height[members], np.searchsorted(around, members))
            above = self._view.height[around] - ground[patches.cells[:, 0], patches.cells[:, 1]]
            hidden = np.count_nonzero((patches.number > 0) & (above < -_BEHIND_VOXELS))
            if hidden >= self._settings.level_hidden * len(members):
                continue
            if self._is_raised((patches.raster > 0).astype(np.uint8), patches, above * self._voxel):
                continue
            self.is_structure[members] = True
            band = np.abs(above) < self._settings.floor_band_voxels
            self.is_structure[around[band & facing_up[around] & (patches.number > 0)]] = True

    @staticmethod
    def _around(plan: tuple[Floats, Floats], members: Indices) -> Indices:
        """Voxels, in order, in the plan's rectangle around ``members`` and three cells beyond."""
        inside = np.ones(len(plan[0]), np.bool_)
        for axis in plan:
            inside &= (axis > axis[members].min() - 3) & (axis < axis[members].max() + 3)
        return np.flatnonzero(inside)


class _Patches:
    """Connected patches (1, 2, ...) of a plane's inliers in a raster laid over all voxels.

    Attributes:
        cells: (M, 2) cell of every voxel.
        raster: patch of every cell, 0 = none; gaps of one cell are closed.
        number: (M,) patch in whose cells the voxel lies, whether an inlier or not.
        occupied: cells per patch that hold inliers.
        inliers: inliers per patch.
    """

    def __init__(self, plane_view: Floats, inliers: Indices):
        # One axis at a time: numpy reduces tall, narrow arrays slowly.
        axes = [np.floor(plane_view[:, axis]).astype(np.int64) for axis in (0, 1)]
        axes = [cells - cells.min() + 2 for cells in axes]
        self.cells = np.stack(axes, axis=1)
        image = np.zeros([int(cells.max()) + 3 for cells in axes], np.uint8)
        image[axes[0][inliers], axes[1][inliers]] = 1
        closed = cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        count, raster = cv2.connectedComponents(closed, connectivity=8)
        self.raster = raster
        self.number = raster[self.cells[:, 0], self.cells[:, 1]]
        self.occupied = np.bincount(raster[image > 0], minlength=count)
        self.inliers = np.bincount(self.number[inliers], minlength=count)

    def count_inside(self, voxels: Indices) -> Indices:
        """How many of ``voxels`` lie in the cells of each patch."""
        return np.bincount(self.number[voxels], minlength=len(self.inliers))

    def mask(self, patch: int) -> NDArray[np.uint8]:
        """Raster of one patch."""
        return (self.raster == patch).astype(np.uint8)

    def voxels_in_dilated(self, patch: int) -> Mask:
        """(M,) voxels in the cells of a patch or beside them."""
        grown = cv2.dilate(self.mask(patch), np.ones((3, 3), np.uint8)) > 0
        return grown[self.cells[:, 0], self.cells[:, 1]]

    def height_map(self, height: Floats, members: Indices) -> Floats:
        """Mean ``height`` of ``members`` (n,) per cell, carried on to the cells without any."""
        shape = self.raster.shape
        flat = self.cells[members, 0] * shape[1] + self.cells[members, 1]
        total = np.bincount(flat, height, shape[0] * shape[1])
        number = np.bincount(flat, minlength=shape[0] * shape[1])
        known = number > 0
        mean = np.where(known, total / np.maximum(number, 1), 0.0)
        empty = np.where(known, 0, 1).astype(np.uint8).reshape(shape)
        _, nearest = cv2.distanceTransformWithLabels(empty, cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL)
        lookup = np.zeros(int(nearest.max()) + 1)
        lookup[nearest.reshape(-1)[known]] = mean[known]
        return lookup[nearest]
