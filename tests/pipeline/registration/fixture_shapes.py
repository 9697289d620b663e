"""Sampled surfaces with known normals, for tests of registration; metres."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

VOXEL_M = 0.03

Surface = tuple[NDArray[np.float32], NDArray[np.float32]]


def rectangle(u: tuple[float, ...], v: tuple[float, ...], corner: tuple[float, ...], seed: int) -> Surface:
    """Points on the parallelogram that two edges span, one per voxel; the normal is along u x v."""
    edges = np.array([u, v], float)
    rng = np.random.default_rng(seed)
    area = np.linalg.norm(np.cross(*edges))
    points = rng.random((int(area / VOXEL_M**2), 2)) @ edges + corner
    normal = np.cross(*edges) / area
    return points.astype(np.float32), np.tile(normal, (len(points), 1)).astype(np.float32)


def ball(centre: tuple[float, ...], radius: float, seed: int) -> Surface:
    """Points on a sphere, facing outwards."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(int(4 * np.pi * radius**2 / VOXEL_M**2), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return (centre + radius * normals).astype(np.float32), normals.astype(np.float32)


def together(*parts: Surface) -> Surface:
    points, normals = zip(*parts, strict=True)
    return np.concatenate(points), np.concatenate(normals)


def hollow(seed: int) -> Surface:
    """A place without flat ground or walls: balls of several sizes lying about."""
    spots = np.random.default_rng(7).uniform(-2, 2, (9, 3))
    return together(*(ball(tuple(spot), 0.25 + 0.08 * k, seed * 100 + k) for k, spot in enumerate(spots)))


def corridor(seed: int) -> Surface:
    """Two walls and a floor along x, the same everywhere."""
    return together(
        rectangle((6, 0, 0), (0, 2, 0), (-3, -1, 0), seed),
        rectangle((6, 0, 0), (0, 0, -2.5), (-3, -1, 2.5), seed + 50),
        rectangle((6, 0, 0), (0, 0, 2.5), (-3, 1, 0), seed + 90),
    )


def noisy(surface: Surface, seed: int, points_m: float = 0.004, normals_rad: float = 0.05) -> Surface:
    """A surface as a sensor would have fused it."""
    points, normals = surface
    rng = np.random.default_rng(seed)
    turned = normals + rng.normal(0, normals_rad, normals.shape)
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    along = rng.normal(0, points_m, (len(points), 1)) * normals
    return (points + along).astype(np.float32), turned.astype(np.float32)


def motion(shift: tuple[float, ...], turn_deg: tuple[float, ...]) -> NDArray[np.float64]:
    """(4, 4) of a shift (metres) and a rotation vector (degrees)."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.radians(np.array(turn_deg, float)))[0]
    T[:3, 3] = shift
    return T
