"""Which keyframes of the two visits see the same place, and where their patches lie in each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.mapping.front_end import SessionGeometry
from pipeline.perception.protocols import PatchWarp
from pipeline.result import CovisiblePair
from pipeline.settings import CorrespondenceSettings

_SPARSE = 4  # every n-th patch row and column takes part in the coarse ranking
_CANDIDATES_PER_PAIR = 4  # keyframes looked at closely for each one that is kept
_DEPTH_TOLERANCE_M = 0.1
_DEPTH_TOLERANCE_RATIO = 0.05
_NEAR_M = 0.1


@dataclass(frozen=True)
class PatchView:
    """A keyframe on its patch grid.

    Attributes:
        points_world: (H_f, W_f, 3) float32 surface point at the centre of each patch; NaN without depth.
        depth: (H_f, W_f) metres, 0 = none.
        camera: intrinsics whose pixels are patches.
        T_world_camera: (4, 4).
    """

    points_world: NDArray[np.float32]
    depth: NDArray[np.float32]
    camera: PinholeCamera
    T_world_camera: NDArray[np.float64]


def patch_view(geometry: SessionGeometry, k: int, grid: tuple[int, int]) -> PatchView:
    """A keyframe of a mapped visit on the patch grid (H_f, W_f) of its features."""
    keyframe = geometry.keyframes[k]
    rows, columns = grid
    depth_image = geometry.store.depth(k)
    height, width = depth_image.shape
    row = np.minimum(((np.arange(rows) + 0.5) / rows * height).astype(int), height - 1)
    column = np.minimum(((np.arange(columns) + 0.5) / columns * width).astype(int), width - 1)
    depth = depth_image[np.ix_(row, column)]
    camera = keyframe.camera.resized(columns, rows)
    points = camera.backproject(depth) @ keyframe.T_world_camera[:3, :3].T.astype(np.float32)
    points += keyframe.T_world_camera[:3, 3].astype(np.float32)
    points[depth <= 0] = np.nan
    return PatchView(points, depth, camera, keyframe.T_world_camera)


def patch_warp(of: PatchView, into: PatchView) -> PatchWarp:
    """Where the patches of one keyframe lie in another, and whether that one sees their place."""
    points = (of.points_world - into.T_world_camera[:3, 3].astype(np.float32)) @ into.T_world_camera[
        :3, :3
    ].astype(np.float32)
    positions, depth = into.camera.project(points)
    return PatchWarp(positions.astype(np.float32), _sees(into, positions, depth))


def _sees(view: PatchView, positions: NDArray[np.floating], depth: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether a view observes points at patch positions: inside, in front, and with nothing before them."""
    with np.errstate(invalid="ignore"):
        inside = (depth > _NEAR_M) & (positions[..., 0] > -0.5) & (positions[..., 1] > -0.5)
        inside &= positions[..., 0] < view.camera.width - 0.5
        inside &= positions[..., 1] < view.camera.height - 0.5
        column = np.clip(np.rint(np.where(inside, positions[..., 0], 0)), 0, view.camera.width - 1).astype(
            int
        )
        row = np.clip(np.rint(np.where(inside, positions[..., 1], 0)), 0, view.camera.height - 1).astype(int)
        measured = view.depth[row, column]
        tolerance = _DEPTH_TOLERANCE_M + _DEPTH_TOLERANCE_RATIO * depth
        # Where the other visit has no depth it still has colour; only a nearer surface hides the place.
        return inside & ((measured <= 0) | (measured > depth - tolerance))


class CovisibilityIndex:
    """Finds the co-visible keyframes of a visit.

    Args:
        views: its keyframes on their patch grids.
    """

    def __init__(self, views: list[PatchView]) -> None:
        self._views = views
        self._R_world_camera = np.array([v.T_world_camera[:3, :3] for v in views], np.float32)
        self._positions = np.array([v.T_world_camera[:3, 3] for v in views], np.float32)

    def best(self, view: PatchView, settings: CorrespondenceSettings) -> tuple[CovisiblePair, ...]:
        """Keyframes that see most of what ``view`` measured, best first; those above ``min_shared``."""
        sparse = view.points_world[::_SPARSE, ::_SPARSE].reshape(-1, 3)
        sparse = sparse[np.isfinite(sparse[:, 0])]
        if not len(sparse):
            return ()
        share = self._share_in_frustum(sparse)
        wanted = settings.pairs_per_keyframe
        candidates = np.argsort(-share, kind="stable")[: wanted * _CANDIDATES_PER_PAIR]
        measured = int(np.isfinite(view.points_world[..., 0]).sum())
        found = []
        for other in candidates[share[candidates] >= settings.min_shared]:
            visible = patch_warp(view, self._views[other]).is_visible
            shared = float(visible.sum()) / measured
            if shared >= settings.min_shared:
                found.append(CovisiblePair(int(other), round(shared, 4)))
        return tuple(sorted(found, key=lambda pair: (-pair.shared, pair.other_keyframe))[:wanted])

    def _share_in_frustum(self, points: NDArray[np.float32]) -> NDArray[np.float64]:
        """Share of points inside every keyframe's frustum, occlusion ignored: a cheap first ranking."""
        relative = points[None] - self._positions[:, None]
        points_camera = np.einsum("npc,ncd->npd", relative, self._R_world_camera)
        depth = np.maximum(points_camera[..., 2], 1e-6)
        fx, fy, cx, cy, width, height = np.array(
            [
                [v.camera.fx, v.camera.fy, v.camera.cx, v.camera.cy, v.camera.width, v.camera.height]
                for v in self._views
            ],
            np.float32,
        ).T[:, :, None]
        u = points_camera[..., 0] / depth * fx + cx
        v = points_camera[..., 1] / depth * fy + cy
        inside = (points_camera[..., 2] > _NEAR_M) & (u > -0.5) & (v > -0.5)
        inside &= (u < width - 0.5) & (v < height - 0.5)
        return inside.mean(axis=1)
