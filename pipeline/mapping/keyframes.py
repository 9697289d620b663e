"""Adaptive keyframe selection (paper, Sec. III-B.1)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import rotation_angle_rad
from pipeline.session import Session
from pipeline.settings import KeyframeSettings


def motion_thresholds(session: Session, settings: KeyframeSettings) -> tuple[float, float]:
    """(delta_x in metres, delta_theta in radians) for what measured the session's depth."""
    if session.depth_source == "learned":
        return settings.learned_translation_m, float(np.deg2rad(settings.learned_rotation_deg))
    return settings.sensor_translation_m, float(np.deg2rad(settings.sensor_rotation_deg))


def select_by_motion(
    poses: list[NDArray[np.float64]], translation_m: float, rotation_rad: float
) -> tuple[int, ...]:
    """Keep the first pose and each that differs from the last kept one by more than a threshold.

    Args:
        poses: T_world_camera, (4, 4) each, in recording order.
        translation_m: delta_x, metres.
        rotation_rad: delta_theta, radians.

    Returns:
        Positions in ``poses``, ascending.
    """
    kept: list[int] = []
    for position, T_world_camera in enumerate(poses):
        if kept:
            last = poses[kept[-1]]
            step_m = float(np.linalg.norm(T_world_camera[:3, 3] - last[:3, 3]))
            turn_rad = rotation_angle_rad(last[:3, :3], T_world_camera[:3, :3])
            if step_m <= translation_m and turn_rad <= rotation_rad:
                continue
        kept.append(position)
    return tuple(kept)


def median_step(poses: list[NDArray[np.float64]], translation_m: float, rotation_rad: float) -> float:
    """Median motion between consecutive poses, as a share of whichever threshold it comes closest to."""
    steps = [
        max(
            float(np.linalg.norm(after[:3, 3] - before[:3, 3])) / translation_m,
            rotation_angle_rad(before[:3, :3], after[:3, :3]) / rotation_rad,
        )
        for before, after in pairwise(poses)
    ]
    return float(np.median(steps)) if steps else 0.0


def select_keyframes(session: Session, settings: KeyframeSettings) -> tuple[int, ...]:
    """Positions in ``session.frames`` that become keyframes.

    All of them when selection is off, when the reader knows the archive to be sparse, or when consecutive
    frames are far apart already: a camera stream moves by a few hundredths of a threshold per frame, an
    archive of keyframes by a good part of one, and dropping those would only lose coverage.
    """
    everything = tuple(range(len(session.frames)))
    if not settings.select or session.is_sparse:
        return everything
    poses = [frame.T_world_camera for frame in session.frames]
    translation_m, rotation_rad = motion_thresholds(session, settings)
    if session.is_sparse is None and median_step(poses, translation_m, rotation_rad) >= settings.sparse_step:
        return everything
    return select_by_motion(poses, translation_m, rotation_rad)
