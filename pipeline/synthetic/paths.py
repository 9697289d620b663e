"""Camera paths: smooth curves of positions and of what the camera looks at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Points = NDArray[np.float64]


def look_at(position: Points, target: Points, roll: float = 0.0) -> NDArray[np.float64]:
    """T_world_camera (4, 4) of an OpenCV camera at ``position`` that looks at ``target``; world z is up.

    Args:
        position: (3,) metres.
        target: (3,) metres, not straight above or below.
        roll: turn about the optical axis, radians.
    """
    forward = np.asarray(target, dtype=np.float64) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2] = c * right + s * down, -s * right + c * down, forward
    T[:3, 3] = position
    return T


def along(waypoints: Points, frames: int) -> Points:
    """``frames`` points evenly spaced in time on a smooth curve through the waypoints, (frames, 3)."""
    curve = PchipInterpolator(np.arange(len(waypoints)), waypoints)
    return curve(np.linspace(0, len(waypoints) - 1, frames))


def walk(
    positions: Points, targets: Points, frames: int, rng: np.random.Generator, sway_m: float = 0.03
) -> NDArray[np.float64]:
    """Keyframes along waypoints of position and target, with the sway of someone who carries the camera.

    Args:
        positions: (N, 3) waypoints, metres.
        targets: (N, 3) what the camera looks at when it is there, metres.
        frames: keyframes to return.
        rng: source of the sway.
        sway_m: deviation of positions; targets sway three times as much.

    Returns:
        (frames, 4, 4) T_world_camera.
    """
    at = along(positions, frames) + rng.normal(0, sway_m, (frames, 3))
    look = along(targets, frames) + rng.normal(0, 3 * sway_m, (frames, 3))
    rolls = rng.normal(0, np.deg2rad(1.0), frames)
    return np.stack([look_at(p, t, r) for p, t, r in zip(at, look, rolls, strict=True)])
