"""The small rigid correction that lays the current visit on the previous one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import rotate_points, rotation_angle_rad, transform_points
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.surface import FusedSurface
from pipeline.registration.sampling import sample_normal_space
from pipeline.registration.surface_fit import SurfaceFit, SurfaceTarget
from pipeline.settings import RegistrationSettings

_SEED = 0
_REACH_PERCENTILE = 90.0


@dataclass(frozen=True)
class VisitRegistration:
    """What was found between two visits, and whether it is applied.

    Attributes:
        T_previous_current: (4, 4) to apply to the current visit's world; the identity when nothing is.
        is_applied: whether the correction is made.
        fit: what was found; None without enough common surface.
        translation_m: shift of the middle of the current visit's surface, of what was found.
        rotation_deg: angle of what was found.
        reason: why nothing is applied, or "".
    """

    T_previous_current: NDArray[np.float64]
    is_applied: bool
    fit: SurfaceFit | None
    translation_m: float
    rotation_deg: float
    reason: str

    @property
    def warning(self) -> str | None:
        """A line for people when the visits clearly fit together otherwise, but not by a pose error."""
        if self.reason != "too large":
            return None
        return (
            f"the visits fit together better when one is shifted by {self.translation_m:.2f} m and turned by "
            f"{self.rotation_deg:.1f} deg, which is more than a pose error: the poses were left as they are"
        )

    def quality(self) -> dict[str, object]:
        """For the manifest: T_previous_current and how far to trust it (metres, degrees, shares)."""
        found: dict[str, object] = {
            "T_previous_current": self.T_previous_current.tolist(),
            "applied": self.is_applied,
            "reason": self.reason,
        }
        if self.fit is not None:
            found |= {
                "translation_m": round(self.translation_m, 5),
                "rotation_deg": round(self.rotation_deg, 4),
                "residual_before_m": round(self.fit.residual_before_m, 5),
                "residual_after_m": round(self.fit.residual_after_m, 5),
                "cost_before": round(self.fit.cost_before, 4),
                "cost_after": round(self.fit.cost_after, 4),
                "matched": round(self.fit.matched, 4),
                "loose_directions": self.fit.loose_directions,
            }
        return found


def register_visits(
    previous: FusedSurface, current: FusedSurface, settings: RegistrationSettings
) -> VisitRegistration:
    """Find the correction between two fused surfaces and decide whether to make it."""
    points, normals = current.points_world, current.normals_world
    if not len(points) or not len(previous.points_world):
        return _left("no surface")
    voxel_m = previous.voxel_size_m
    chosen = sample_normal_space(normals, settings.samples, np.random.default_rng(_SEED))
    middle = np.median(points, axis=0).astype(np.float64)
    distances = np.linalg.norm(points - middle, axis=1)
    turned_m = np.deg2rad(settings.reach_deg) * float(np.percentile(distances, _REACH_PERCENTILE))
    reach_m = max(settings.reach_m, settings.reach_voxels * voxel_m, turned_m)
    target = SurfaceTarget(previous.points_world, previous.normals_world, voxel_m, settings.loose_below)
    last_reach_m = settings.last_reach_voxels * voxel_m
    fit = target.fit(
        points[chosen], normals[chosen], max(min(reach_m, settings.max_reach_m), last_reach_m), last_reach_m
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
    applied = T if not reason else np.eye(4)
    return VisitRegistration(applied, not reason, fit, translation_m, rotation_deg, reason)


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


def _left(reason: str) -> VisitRegistration:
    return VisitRegistration(np.eye(4), False, None, 0.0, 0.0, reason)
