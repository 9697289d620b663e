"""Errors of single poses: each keyframe of one visit laid on the other visit's surface.

No pose graph: the other visit's surface is fixed, so that every keyframe can be corrected on its own. Whether
that pays is tried on a few keyframes first; poses that are good already would only be disturbed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import rotate_points, rotation_angle_rad, transform_points
from pipeline.mapping.depth_geometry import depth_geometry
from pipeline.mapping.front_end import SessionGeometry
from pipeline.registration.sampling import sample_normal_space
from pipeline.registration.surface_fit import MotionPrior, SurfaceFit, SurfaceTarget
from pipeline.settings import RegistrationSettings, Settings

_TRIED = 6
_SEED = 0
_DRAWN_PER_SAMPLE = 12  # pixels among which the samples are chosen by direction
_REACH_PERCENTILE = 90.0
_THREADS = 2


@dataclass(frozen=True)
class KeyframeCorrections:
    """What single keyframes need.

    Attributes:
        T_world_reported: (4, 4) per keyframe, to apply to its pose; the identity where nothing is.
        corrected: how many keyframes are corrected.
        median_translation_m, median_rotation_deg: of the corrections, at the camera.
    """

    T_world_reported: tuple[NDArray[np.float64], ...]
    corrected: int
    median_translation_m: float
    median_rotation_deg: float


def register_keyframes(
    geometry: SessionGeometry,
    poses: Sequence[NDArray[np.float64]],
    target: SurfaceTarget,
    settings: Settings,
) -> KeyframeCorrections:
    """Lay each keyframe on the other visit's surface.

    Args:
        geometry: the visit whose keyframes are corrected.
        poses: (4, 4) ``T_world_camera`` to start from, for each keyframe.
        target: the other visit's surface.
        settings: of the run.
    """

    def correction(k: int) -> NDArray[np.float64] | None:
        fit = _fit(geometry, k, poses[k], target, settings)
        if fit is None or not _is_better(fit, poses[k], settings.registration):
            return None
        return fit.T_target_source

    count = len(poses)
    tried = np.unique(np.linspace(0, count - 1, _TRIED).round().astype(int))
    with ThreadPoolExecutor(_THREADS) as threads:
        found = dict(zip(tried, threads.map(correction, tried), strict=True))
        if 2 * sum(T is not None for T in found.values()) > len(tried):
            rest = [k for k in range(count) if k not in found]
            found |= dict(zip(rest, threads.map(correction, rest), strict=True))
        else:
            found = {}
    made = {k: T for k, T in found.items() if T is not None}
    moved_m = [np.linalg.norm((T @ poses[k] - poses[k])[:3, 3]) for k, T in made.items()]
    turned_rad = [rotation_angle_rad(np.eye(3), T[:3, :3]) for T in made.values()]
    return KeyframeCorrections(
        T_world_reported=tuple(made.get(k, np.eye(4)) for k in range(count)),
        corrected=len(made),
        median_translation_m=float(np.median(moved_m)) if made else 0.0,
        median_rotation_deg=float(np.rad2deg(np.median(turned_rad))) if made else 0.0,
    )


def _fit(
    geometry: SessionGeometry,
    k: int,
    T_world_camera: NDArray[np.float64],
    target: SurfaceTarget,
    settings: Settings,
) -> SurfaceFit | None:
    limits = settings.registration
    seen = depth_geometry(
        geometry.store.depth(k), geometry.strided_camera(k), settings.surface.min_incidence_cosine
    )
    points, normals = seen.points_camera[seen.is_reliable], seen.normals_camera[seen.is_reliable]
    if not len(points):
        return None
    rng = np.random.default_rng(_SEED)
    drawn = rng.choice(
        len(points), min(len(points), _DRAWN_PER_SAMPLE * limits.keyframe_samples), replace=False
    )
    chosen = drawn[sample_normal_space(normals[drawn], limits.keyframe_samples, rng)]
    points, normals = points[chosen], normals[chosen]
    far_m = float(np.percentile(np.linalg.norm(points, axis=1), _REACH_PERCENTILE))
    voxel_m = geometry.surface.voxel_size_m
    return target.fit(
        transform_points(T_world_camera, points),
        rotate_points(T_world_camera[:3, :3], normals),
        *limits.reaches_m(voxel_m, far_m),
        loose_below=limits.loose_below,
        prior=MotionPrior(
            T_world_camera[:3, 3],
            limits.keyframe_translation_m,
            math.radians(limits.keyframe_rotation_deg),
            limits.keyframe_matches,
        ),
    )


def _is_better(fit: SurfaceFit, T_world_camera: NDArray[np.float64], limits: RegistrationSettings) -> bool:
    if fit.cost_after > limits.keyframe_max_cost_ratio * fit.cost_before:
        return False
    T = fit.T_target_source
    shift_m = float(np.linalg.norm((T @ T_world_camera - T_world_camera)[:3, 3]))
    turn_deg = float(np.rad2deg(rotation_angle_rad(np.eye(3), T[:3, :3])))
    return shift_m <= limits.keyframe_max_translation_m and turn_deg <= limits.max_rotation_deg
