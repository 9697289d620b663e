"""A surface seen along gravity: where each voxel stands in plan, and how high."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.components import Floats, Indices, Mask


def plane_axes(
    normal: NDArray[np.floating], hint: NDArray[np.floating] | None = None
) -> tuple[Floats, Floats]:
    """Two unit vectors that span the plane of ``normal`` (3,); the first follows ``hint`` where it can."""
    normal = np.asarray(normal, np.float64)
    if hint is None or np.linalg.norm(np.cross(normal, hint)) < 1e-6:
        hint = np.eye(3)[np.abs(normal).argmin()]
    first = hint - normal * (normal @ hint)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


@dataclass(frozen=True)
class GravityView:
    """Plan and height of every voxel, in voxels, about the centre of the surface.

    The plan axes follow the longest direction of the surface, so that turning or shifting the world about
    gravity leaves every raster (almost) unchanged.

    Attributes:
        plan: (M, 2) horizontal position, voxels.
        height: (M,) height along ``up``, voxels.
        centred: (M, 3) points about their mean, metres.
        up: (3,) unit vector against gravity.
        axis: (3,) horizontal unit vector of the first plan coordinate.
    """

    plan: Floats
    height: Floats
    centred: Floats
    up: Floats
    axis: Floats

    @classmethod
    def of(cls, surface: FusedSurface) -> GravityView:
        """View of a surface along its ``up_world``."""
        points = np.asarray(surface.points_world, np.float64)
        centred = points - points.mean(axis=0) if len(points) else points
        up = np.asarray(surface.up_world, np.float64)
        up = up / np.linalg.norm(up)
        first, second = plane_axes(up)
        plan = centred @ np.stack([first, second], axis=1)
        if len(points) > 2:
            _, vectors = np.linalg.eigh(plan.T @ plan)
            main = vectors[:, 1]
            if np.sum((plan @ main) ** 3) < 0:
                main = -main
            first = first * main[0] + second * main[1]
            second = np.cross(up, first)
            plan = centred @ np.stack([first, second], axis=1)
        return cls(plan / surface.voxel_size_m, centred @ up / surface.voxel_size_m, centred, up, first)


@dataclass(frozen=True)
class HullMask:
    """The convex hull of some cells, drawn into a raster with one cell per unit.

    Attributes:
        corner: (2,) cell of ``inside[0, 0]``.
        inside: (nx, ny) cells in the hull.
    """

    corner: Indices
    inside: Mask

    @classmethod
    def around(cls, positions: Floats, margin: int) -> HullMask:
        """Hull of ``positions`` (n, 2) with room for a dilation by ``margin`` cells."""
        cells = np.floor(positions).astype(np.int64)
        corner = cells.min(axis=0) - margin - 1
        shape = cells.max(axis=0) + margin + 2 - corner
        hull = cv2.convexHull((cells - corner).astype(np.int32)[:, None, ::-1])
        image = np.zeros((int(shape[0]), int(shape[1])), np.uint8)
        cv2.fillConvexPoly(image, hull, 1)
        return cls(corner, image > 0)

    @property
    def area(self) -> int:
        """Cells in the hull."""
        return int(self.inside.sum())

    def dilated(self, cells: int) -> HullMask:
        """The hull grown by ``cells`` cells on every side."""
        grown = cv2.dilate(self.inside.astype(np.uint8), np.ones((2 * cells + 1, 2 * cells + 1), np.uint8))
        return HullMask(self.corner, grown > 0)

    def contains(self, positions: Floats) -> Mask:
        """Which of ``positions`` (n, 2) lie in the hull."""
        cells = np.floor(positions).astype(np.int64) - self.corner
        inside: Mask = np.all((cells >= 0) & (cells < self.inside.shape), axis=1)
        inside[inside] = self.inside[cells[inside, 0], cells[inside, 1]]
        return inside
