"""The small corrections that lay the current visit on the previous one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import rotate_points, rotation_angle_rad, transform_points
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.surface import FusedSurface
from pipeline.registration.keyframes import KeyframeCorrections, register_keyframes
from pipeline.registration.sampling import sample_normal_space
from pipeline.registration.surface_fit import SurfaceFit, SurfaceTarget
from pipeline.settings import RegistrationSettings, Settings

_SEED = 0
_REACH_PERCENTILE = 90.0


@dataclass(frozen=True)
class VisitFit:
    """How a whole visit lies on another one.

    Attributes:
        T_previous_current: (4, 4) to apply to the current visit's world; the identity when nothing is.
        fit: what was found; None without enough common surface.
        translation_m: shift of the middle of the current visit's surface, of what was found.
        rotation_deg: angle of what was found.
        reason: why nothing is applied, or "".
    """

    T_previous_current: NDArray[np.float64]
    fit: SurfaceFit | None
    translation_m: float
    rotation_deg: float
    reason: str


@dataclass(frozen=True)
class Registration:
    """What was found between two visits.

    Attributes:
        visit: the correction of the whole current visit.
        keyframes: the corrections of its keyframes, made after that one; None when not looked for.
        poses: (4, 4) corrected ``T_world_camera`` of each keyframe of the current visit.
    """

    visit: VisitFit
    keyframes: KeyframeCorrections | None
    poses: tuple[NDArray[np.float64], ...]

    @property
    def is_applied(self) -> bool:
        """Whether any pose is corrected."""
        return not self.visit.reason or (self.keyframes is not None and self.keyframes.corrected > 0)

    @property
    def warning(self) -> str | None:
        """A line for people when the visits clearly fit together otherwise, but not by a pose error."""
        if self.visit.reason != "too large":
            return None
        return (
            f"the visits fit together better when one is shifted by {self.visit.translation_m:.2f} m and "
            f"turned by {self.visit.rotation_deg:.1f} deg, more than a pose error: poses left as they are"
        )

    def quality(self) -> dict[str, Any]:
        """For the manifest: T_previous_current and how far to trust it (metres, degrees, shares)."""
        visit, fit = self.visit, self.visit.fit
        found: dict[str, Any] = {
            "T_previous_current": visit.T_previous_current.tolist(),
            "applied": not visit.reason,
            "reason": visit.reason,
        }
        if fit is not None:
            found |= {
                "translation_m": round(visit.translation_m, 5),
                "rotation_deg": round(visit.rotation_deg, 4),
                "residual_before_m": round(fit.residual_before_m, 5),
                "residual_after_m": round(fit.residual_after_m, 5),
                "cost_before": round(fit.cost_before, 4),
                "cost_after": round(fit.cost_after, 4),
                "matched": round(fit.matched, 4),
                "loose_directions": fit.loose_directions,
            }
        if self.keyframes is not None:
            found |= {
                "keyframes_corrected": self.keyframes.corrected,
                "keyframe_translation_m": round(self.keyframes.median_translation_m, 5),
                "keyframe_rotation_deg": round(self.keyframes.median_rotation_deg, 4),
            }
        return found


def register(previous: SessionGeometry, current: SessionGeometry, settings: Settings) -> Registration:
    """Find the corrections of the current visit's poses; what is not clearly better is left as it is."""
    surface = previous.surface
    poses = tuple(keyframe.T_world_camera for keyframe in current.keyframes)
    if not len(surface.points_world):
        return Registration(_left("no surface"), None, poses)
    target = SurfaceTarget(surface.points_world, surface.normals_world, surface.voxel_size_m)
    visit = register_visit(target, current.surface, settings.registration)
    if not visit.reason:
        poses = tuple(visit.T_previous_current @ pose for pose in poses)
    if visit.fit is None or not settings.registration.keyframes:
        return Registration(visit, None, poses)
    keyframes = register_keyframes(current, poses, target, settings)
    corrected = tuple(T @ pose for T, pose in zip(keyframes.T_world_reported, poses, strict=True))
    return Registration(visit, keyframes, corrected if keyframes.corrected else poses)


def register_visit(target: SurfaceTarget, current: FusedSurface, settings: RegistrationSettings) -> VisitFit:
    """The correction between two fused surfaces, and whether to make it."""
    points, normals = current.points_world, current.normals_world
    if not len(points):
        return _left("no surface")
    chosen = sample_normal_space(normals, settings.samples, np.random.default_rng(_SEED))
    middle = np.median(points, axis=0).astype(np.float64)
    radius_m = float(np.percentile(np.linalg.norm(points - middle, axis=1), _REACH_PERCENTILE))
    fit = target.fit(
        points[chosen],
        normals[chosen],
        *settings.reaches_m(current.voxel_size_m, radius_m),
        loose_below=settings.loose_below,
    )
    if fit is None:
        return _left("too little common surface")
    T = fit.T_target_source
    translation_m = float(np.linalg.norm(transform_points(T, middle[None])[0] - middle))
    rotation_deg = float(np.rad2deg(rotation_angle_rad(np.eye(3), T[:3, :3])))
    reason = ""
    if fit.cost_after > settings.max_cost_ratio * fit.cost_before:
        reason = "no clear gain"
    elif translation_m > settings.max_translation_m or rotation_deg > settings.max_rotation_deg:
        reason = "too large"
    return VisitFit(np.eye(4) if reason else T, fit, translation_m, rotation_deg, reason)


def moved_geometry(geometry: SessionGeometry, T_new_world: NDArray[np.float64]) -> SessionGeometry:
    """A mapped visit in another world frame: poses, surface and submaps; numbers of voxels stay."""
    surface, rotation = geometry.surface, T_new_world[:3, :3]
    keyframes = tuple(
        replace(keyframe, T_world_camera=T_new_world @ keyframe.T_world_camera)
        for keyframe in geometry.keyframes
    )
    moved = replace(
        surface,
        points_world=transform_points(T_new_world, surface.points_world.astype(np.float64)).astype(
            np.float32
        ),
        normals_world=rotate_points(rotation, surface.normals_world),
        up_world=rotation @ surface.up_world,
        camera_positions_world=np.array([k.T_world_camera[:3, 3] for k in keyframes]),
    )
    return replace(geometry, keyframes=keyframes, surface=moved, submaps=geometry.submaps.moved(T_new_world))


def _left(reason: str) -> VisitFit:
    return VisitFit(np.eye(4), None, 0.0, 0.0, reason)
