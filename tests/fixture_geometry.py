"""Visits that exist only in memory, and their mapping: for tests that need a surface, submaps and a store."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.mapping.front_end import KeyframeSinks, SessionGeometry, map_session
from pipeline.perception.embedded.descriptor import GradientColourDescriptor
from pipeline.session import Frame, Session
from pipeline.settings import Settings

SMALL_CAMERA = PinholeCamera(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)


def pose(position: Sequence[float], forward: Sequence[float], up: Sequence[float] = (0, 0, 1)) -> NDArray:
    """``T_world_camera`` of a camera at ``position`` (metres) that looks along ``forward``."""
    z = np.asarray(forward, float) / np.linalg.norm(forward)
    x = np.cross(z, np.asarray(up, float))
    x /= np.linalg.norm(x)
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T_world_camera[:3, 3] = position
    return T_world_camera


def plane_depth(
    camera: PinholeCamera, T_world_camera: NDArray, normal: Sequence[float], distance_m: float
) -> NDArray[np.float32]:
    """Exact depth (h, w) of the plane ``normal . x = distance_m``; 0 where a ray misses it."""
    rays_camera = camera.backproject(np.ones((camera.height, camera.width), np.float32)).astype(float)
    rays = rays_camera @ T_world_camera[:3, :3].T
    n = np.asarray(normal, float)
    with np.errstate(divide="ignore"):
        depth = (distance_m - n @ T_world_camera[:3, 3]) / (rays @ n)
    return np.where(np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)


def checkers(camera: PinholeCamera, step_px: int = 8) -> NDArray[np.uint8]:
    """A chequered image (H, W, 3) of mid greys."""
    row, column = np.mgrid[: camera.height, : camera.width]
    grey = np.where((row // step_px + column // step_px) % 2 == 0, 90, 160).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def memory_session(
    camera: PinholeCamera,
    poses: Sequence[NDArray],
    depths: Sequence[NDArray],
    images: Sequence[NDArray] | None = None,
    **fields: Any,
) -> Session:
    """A session whose frames are the given arrays."""
    images = images or [checkers(camera)] * len(poses)

    def give(array: NDArray) -> Callable[[], NDArray]:
        return lambda: array

    frames = tuple(
        Frame(k, f"frame {k}", camera, np.asarray(pose, float), float(k), give(rgb), give(depth))
        for k, (pose, rgb, depth) in enumerate(zip(poses, images, depths, strict=True))
    )
    return Session("memory", Path("memory"), "memory", frames, **fields)


def map_in_memory(
    session: Session,
    folder: Path,
    settings: Settings,
    voxel_size_m: float,
    *,
    sinks: KeyframeSinks | None = None,
    warn: Callable[[str], None] = lambda line: None,
) -> SessionGeometry:
    """Front-end of all frames of a session; images and features are dropped unless sinks are given."""
    return map_session(
        session,
        range(len(session.frames)),
        voxel_size_m,
        GradientColourDescriptor(settings.descriptor),
        settings,
        folder,
        sinks or KeyframeSinks(lambda k, rgb: None, lambda k, features: None),
        on_keyframe=lambda done: None,
        warn=warn,
    )
