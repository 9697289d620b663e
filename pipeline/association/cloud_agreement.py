"""Clouds of single objects, and how well two of them agree under a rigid motion.

What a motion leaves unexplained is told apart from what could not be seen: a side that faced away from the
other visit's cameras speaks neither for nor against it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.mapping.colours import within_faces

# Points nearer than this many spacings are one surface.
_SAME_SURFACE_SPACINGS = 2.0
_SAME_FACING = 0.3
MIN_SHARED_POINTS = 8
# Surfaces seen at a flatter angle than this are not counted on to be measured.
_IN_VIEW_COSINE = 0.35
# Colour residual (norm over log RGB) of one pattern seen twice.
_SAME_RESIDUAL = 0.3
_LIKELIHOOD_LIMIT = 2.0
# Of an object so much must be shared for its colours to count in full.
ENOUGH_SHARED = 0.3


@dataclass(frozen=True)
class ObjectCloud:
    """What one visit saw of an object.

    Attributes:
        points_world: (n, 3) metres.
        normals_world: (n, 3) unit.
        log_colours: (n, 3) natural logarithm of RGB, in the light of the previous visit.
        viewpoints_world: (v, 3) camera centres that it was seen from, metres.
    """

    points_world: NDArray[np.floating]
    normals_world: NDArray[np.floating]
    log_colours: NDArray[np.floating]
    viewpoints_world: NDArray[np.floating]

    def __len__(self) -> int:
        return len(self.points_world)

    def sampled(self, size: int) -> ObjectCloud:
        """At most ``size`` points, evenly from the order in which they are stored (which is spatial)."""
        if len(self) <= size:
            return self
        rows = np.linspace(0, len(self) - 1, size).round().astype(np.int64)
        return ObjectCloud(
            self.points_world[rows], self.normals_world[rows], self.log_colours[rows], self.viewpoints_world
        )


@dataclass(frozen=True)
class ObjectRegistration:
    """The best rigid motion that was found between two clouds, and how well they agree under it.

    Attributes:
        T_world_motion: (4, 4), p_current = T p_previous, world frame.
        overlap_previous, overlap_current: of either cloud's points that face the other's viewpoints, the
            share that lies on the other's surface. What faces away could not be seen: it speaks neither way.
        shared: share of the smaller cloud's points that lie on the other's surface.
        likelihood: mean log-likelihood ratio of the colours there, same pattern against any pattern of these
            colours; 0 where the clouds have one colour each.
        colour_residual: median difference of the log colours there, after the gain of brightness.
        chroma_residual: median difference of the colours without brightness there; no gain is taken out.
        texture_correlation: of the brightness patterns there.
        texture: spread of log brightness there, the smaller of the two clouds'.
        gain: log brightness of the current cloud over that of the previous one.
    """

    T_world_motion: NDArray[np.float64]
    overlap_previous: float
    overlap_current: float
    shared: float
    likelihood: float
    colour_residual: float
    chroma_residual: float
    texture_correlation: float
    texture: float
    gain: float

    @property
    def overlap(self) -> float:
        """Mean of both shares."""
        return (self.overlap_previous + self.overlap_current) / 2

    @property
    def agreement(self) -> float:
        """Orders registrations of the same clouds: nothing in view is missing, the pattern is the same."""
        return 2 * (self.overlap - 1) + (0.5 + self.likelihood) * min(1.0, self.shared / ENOUGH_SHARED)


def agreement_under(
    previous: ObjectCloud,
    current: ObjectCloud,
    tree: cKDTree,
    rotation: NDArray[np.float64],
    translation: NDArray[np.float64],
    spacing_m: float,
) -> ObjectRegistration:
    """How well two clouds agree under a motion; ``tree`` holds the points of the current one."""
    moved = np.asarray(previous.points_world, np.float64) @ rotation.T + translation
    turned = np.asarray(previous.normals_world, np.float64) @ rotation.T
    target = np.asarray(current.points_world, np.float64)
    reach = _SAME_SURFACE_SPACINGS * spacing_m
    distance, nearest = tree.query(moved, distance_upper_bound=reach)
    shared = np.isfinite(distance)
    current_normals = np.asarray(current.normals_world, np.float64)
    shared[shared] = (turned[shared] * current_normals[nearest[shared]]).sum(axis=1) > _SAME_FACING
    backward, _ = cKDTree(moved).query(target, distance_upper_bound=reach)
    found = np.isfinite(backward)
    in_view = _faces_any(moved, turned, current.viewpoints_world)
    viewpoints = np.asarray(previous.viewpoints_world, np.float64) @ rotation.T + translation
    in_view_back = _faces_any(target, current_normals, viewpoints)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, translation
    overlap = (_share(shared, in_view | shared), _share(found, in_view_back | found))
    part = max(float(shared.mean()), float(found.mean()))
    if int(shared.sum()) < MIN_SHARED_POINTS:
        return ObjectRegistration(T, *overlap, part, -1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    own = np.asarray(previous.log_colours, np.float64)[shared]
    other = np.asarray(current.log_colours, np.float64)[nearest[shared]]
    grey0, grey1 = own.mean(axis=1), other.mean(axis=1)
    gain = float(np.median(grey1 - grey0))
    residual = np.linalg.norm(other - own - gain, axis=1)
    chroma = np.linalg.norm((other - grey1[:, None]) - (own - grey0[:, None]), axis=1)
    grey0, grey1 = within_faces(grey0, turned[shared]), within_faces(grey1, turned[shared])
    correlation = float(grey0 @ grey1 / np.sqrt((grey0 @ grey0) * (grey1 @ grey1) + 1e-9))
    return ObjectRegistration(
        T,
        *overlap,
        part,
        _likelihood(residual, previous, current),
        float(np.median(residual)),
        float(np.median(chroma)),
        correlation,
        float(min(grey0.std(), grey1.std())),
        gain,
    )


def _share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    return float(part[whole].mean()) if whole.any() else 0.0


def _faces_any(
    points: NDArray[np.float64], normals: NDArray[np.float64], viewpoints: NDArray[np.floating]
) -> NDArray[np.bool_]:
    """(n,) whether a point faces one of the viewpoints well enough to be measured from there."""
    ray = np.asarray(viewpoints, np.float64)[:, None] - points[None]
    cosine = np.einsum("vnd,nd->vn", ray, normals) / np.maximum(np.linalg.norm(ray, axis=2), 1e-9)
    return (cosine > _IN_VIEW_COSINE).any(axis=0)


def _likelihood(residual: NDArray[np.float64], previous: ObjectCloud, current: ObjectCloud) -> float:
    """Mean log ratio of two normal densities: residuals of one pattern, and of two points taken at random."""
    variance = sum(
        float(np.asarray(cloud.log_colours, np.float64).var(axis=0).sum()) for cloud in (previous, current)
    )
    same, any_two = _SAME_RESIDUAL**2, max(variance, _SAME_RESIDUAL**2)
    ratio = 1.5 * np.log(any_two / same) - residual**2 / 2 * (3 / same - 3 / any_two)
    return float(np.clip(ratio, -_LIKELIHOOD_LIMIT, _LIKELIHOOD_LIMIT).mean())
