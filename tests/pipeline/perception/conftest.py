"""Hand-made scenes: faces of boxes and sheets of ground on a voxel grid, with the owner of each voxel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from pipeline.mapping.surface import FusedSurface


def surface_from_samples(points, normals, voxel_m: float, up=(0.0, 0.0, 1.0)) -> tuple[FusedSurface, NDArray]:
    """Average samples (n, 3) per voxel; also gives the voxel of each sample."""
    points = np.asarray(points, np.float64).reshape(-1, 3)
    normals = np.asarray(normals, np.float64).reshape(-1, 3)
    keys = np.floor(points / voxel_m).astype(np.int64)
    _, voxel, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    voxel = voxel.reshape(-1)
    total = len(counts)

    def mean(values):
        return np.stack([np.bincount(voxel, values[:, i], total) for i in range(3)], 1) / counts[:, None]

    centres, directions = mean(points), mean(normals)
    pairs = (
        cKDTree(centres).query_pairs(1.9 * voxel_m, output_type="ndarray") if total else np.zeros((0, 2), int)
    )
    rows, cols = np.r_[pairs[:, 0], pairs[:, 1]], np.r_[pairs[:, 1], pairs[:, 0]]
    neighbours = coo_matrix((np.ones(len(rows), np.float32), (rows, cols)), shape=(total, total)).tocsr()
    directions = directions + neighbours @ directions / np.maximum(np.diff(neighbours.indptr), 1)[:, None]
    directions /= np.maximum(np.linalg.norm(directions, axis=1, keepdims=True), 1e-9)
    surface = FusedSurface(
        voxel_size_m=voxel_m,
        points_world=centres.astype(np.float32),
        normals_world=directions.astype(np.float32),
        lab=np.full((total, 3), 50, np.float32),
        sample_count=counts.astype(np.int32),
        neighbours=neighbours,
        up_world=np.asarray(up, np.float64),
        camera_positions_world=np.zeros((1, 3)),
    )
    return surface, voxel


@dataclass
class SceneBuilder:
    """Collects boxes; what lies inside another box is not seen and not sampled."""

    voxel_m: float = 0.02
    seed: int = 0
    boxes: list[tuple[NDArray, NDArray, int]] = field(default_factory=list)
    sheets: list[tuple[NDArray, NDArray, int]] = field(default_factory=list)
    owners: int = 0

    def box(self, low, high, owner: int | None = None) -> int:
        """Add a box; gives its owner number (1, 2, ...; pass one to add to that object, 0 = background)."""
        if owner is None:
            self.owners += 1
            owner = self.owners
        self.boxes.append((np.asarray(low, float), np.asarray(high, float), owner))
        return owner

    def sheet(self, height: Callable, low, high, owner: int = 0) -> None:
        """Add ground of the given height(x, y)."""
        step = self.voxel_m / 2.5
        x, y = np.meshgrid(np.arange(low[0], high[0], step), np.arange(low[1], high[1], step))
        x, y = x.ravel(), y.ravel()
        z = height(x, y)
        gradient_x = (height(x + 0.01, y) - height(x - 0.01, y)) / 0.02
        gradient_y = (height(x, y + 0.01) - height(x, y - 0.01)) / 0.02
        normals = np.stack([-gradient_x, -gradient_y, np.ones_like(x)], 1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        self.sheets.append((np.stack([x, y, z], 1), normals, owner))

    def room(self, width: float, depth: float, height: float) -> None:
        """Floor and three walls, seen from inside."""
        t = 0.1
        self.box((0, 0, -t), (width, depth, 0), owner=0)
        self.box((-t, 0, 0), (0, depth, height), owner=0)
        self.box((0, -t, 0), (width, 0, height), owner=0)
        self.box((0, depth, 0), (width, depth + t, height), owner=0)

    def samples(self) -> tuple[NDArray, NDArray, NDArray]:
        """Points, normals and owners of everything that could be seen."""
        rng = np.random.default_rng(self.seed)
        points, normals, owners = [], [], []
        step = self.voxel_m / 2.5
        for index, (low, high, owner) in enumerate(self.boxes):
            for axis in range(3):
                for side, face in ((low, -1.0), (high, 1.0)):
                    u, v = [a for a in range(3) if a != axis]
                    grid = np.meshgrid(
                        np.arange(low[u] + step / 2, high[u], step),
                        np.arange(low[v] + step / 2, high[v], step),
                    )
                    face_points = np.zeros((grid[0].size, 3))
                    face_points[:, u], face_points[:, v] = grid[0].ravel(), grid[1].ravel()
                    face_points[:, axis] = side[axis]
                    seen = np.ones(len(face_points), bool)
                    for other, (a, b, _) in enumerate(self.boxes):
                        if other != index:
                            seen &= ~((face_points > a - 1e-6) & (face_points < b + 1e-6)).all(1)
                    if owner == 0:  # the outside of walls and the underside of the floor
                        seen &= self._faces_inside(axis, side, face)
                    points.append(face_points[seen])
                    normals.append(np.tile(face * np.eye(3)[axis], (seen.sum(), 1)))
                    owners.append(np.full(seen.sum(), owner))
        for sheet_points, sheet_normals, owner in self.sheets:
            seen = np.ones(len(sheet_points), bool)
            for a, b, _ in self.boxes:
                seen &= ~((sheet_points > a - [0, 0, 9]) & (sheet_points < b)).all(1)
            points.append(sheet_points[seen])
            normals.append(sheet_normals[seen])
            owners.append(np.full(seen.sum(), owner))
        everything = np.concatenate(points)
        # Faces at round numbers would lie on the border of two voxels.
        everything += rng.normal(0, 0.05 * self.voxel_m, everything.shape) + 0.37 * self.voxel_m
        return everything, np.concatenate(normals), np.concatenate(owners)

    def _faces_inside(self, axis: int, side, face: float) -> bool:
        centre = np.mean([(a + b) / 2 for a, b, _ in self.boxes], axis=0)
        return bool((centre[axis] - side[axis]) * face > 0)

    def build(self) -> tuple[FusedSurface, NDArray]:
        """The surface and the owner of each voxel (the one with most samples)."""
        points, normals, owners = self.samples()
        surface, voxel = surface_from_samples(points, normals, self.voxel_m)
        votes = np.zeros((len(surface.points_world), owners.max() + 1))
        np.add.at(votes, (voxel, owners), 1)
        return surface, votes.argmax(1)


@pytest.fixture
def scene_builder() -> type[SceneBuilder]:
    return SceneBuilder


@pytest.fixture
def make_surface() -> Callable:
    return surface_from_samples
