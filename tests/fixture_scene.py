"""The two visits behind the small result: a hall of textured boxes, painted by exact ray-box intersection.

World: metres, z up, floor at z = 0, wall at y = 3. The cameras walk along x and look at the wall; the
previous visit sees x from about -1.2 to 6.7 m, the current one from about 0.8 to 8.7 m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, invert_rigid, transform_points
from pipeline.result import ChangeLabel, MatchCase

CAMERA = PinholeCamera(width=320, height=240, fx=277.0, fy=277.0, cx=159.5, cy=119.5)
CAMERA_X_M = {0: np.linspace(0.5, 5.0, 6), 1: np.linspace(2.5, 7.0, 6)}
LIGHT = {0: 1.0, 1: 0.85}
FLOOR_Z_M, WALL_Y_M = 0.0, 3.0

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class SceneObject:
    """A box in one or both visits; ``centre`` stands on the floor, ``size`` in metres."""

    object_id: int
    label: ChangeLabel
    case: MatchCase
    colour: tuple[int, int, int]
    boxes: dict[int, Box]  # session -> (low corner, high corner)


def _on_floor(x: float, y: float, size: tuple[float, float, float]) -> Box:
    return (x - size[0] / 2, y - size[1] / 2, 0.0), (x + size[0] / 2, y + size[1] / 2, size[2])


def _scene() -> tuple[SceneObject, ...]:
    L, C = ChangeLabel, MatchCase
    crate, tall, flat, cube = (0.6, 0.5, 0.5), (0.4, 0.4, 1.2), (0.8, 0.4, 0.3), (0.4, 0.4, 0.4)
    both = [
        (1, L.STATIC, C.CONFIDENT, (178, 120, 70), (1.6, 1.6, crate), (1.6, 1.6, crate)),
        (2, L.STATIC, C.CONFIDENT, (90, 110, 160), (3.4, 2.5, (1.2, 0.4, 1.5)), (3.4, 2.5, (1.2, 0.4, 1.5))),
        (3, L.STATIC, C.PARTIAL, (60, 140, 90), (5.9, 2.0, tall), (5.9, 2.0, tall)),
        (4, L.MOVED, C.CONFIDENT, (200, 60, 60), (2.3, 0.9, cube), (3.1, 0.7, cube)),
        (5, L.MOVED, C.CONFIDENT, (220, 190, 60), (4.6, 0.9, flat), (5.4, 0.8, (0.4, 0.8, 0.3))),
    ]
    current = [
        (6, L.APPEARED, C.NONE, (150, 70, 170), (2.4, 2.2, tall)),
        (7, L.APPEARED, C.LOOKALIKE, (230, 230, 225), (4.5, 2.3, (0.5, 0.5, 0.9))),
    ]
    previous = [
        (8, L.DISAPPEARED, C.LOOKALIKE, (40, 45, 60), (4.5, 2.3, (0.6, 0.5, 0.8))),
        (9, L.DISAPPEARED, C.NONE, (240, 140, 40), (3.7, 1.3, crate)),
        (10, L.UNKNOWN, C.NONE, (120, 200, 210), (-0.4, 1.8, crate)),
    ]
    late = [
        (11, L.UNKNOWN, C.NONE, (200, 130, 150), (8.0, 1.9, crate)),
        (12, L.APPEARED, C.NONE, (30, 120, 200), (6.4, 1.0, cube)),
    ]
    objects = [
        SceneObject(i, label, case, colour, {0: _on_floor(*before), 1: _on_floor(*after)})
        for i, label, case, colour, before, after in both
    ]
    objects += [SceneObject(i, la, c, col, {0: _on_floor(*place)}) for i, la, c, col, place in previous]
    objects += [SceneObject(i, la, c, col, {1: _on_floor(*place)}) for i, la, c, col, place in current + late]
    return tuple(sorted(objects, key=lambda item: item.object_id))


OBJECTS = _scene()


@dataclass(frozen=True)
class View:
    """What one camera sees of one visit: (H, W, 3) RGB, (H, W) metres, (H, W) object ids."""

    rgb: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    object_ids: NDArray[np.uint16]


def camera_pose(session: int, k: int) -> NDArray[np.float64]:
    """``T_world_camera`` of keyframe ``k``: at y = -2.4 m, 1.5 m high, looking along +y and 15 deg down."""
    down = np.deg2rad(15.0 + 2.0 * session)
    yaw = np.deg2rad(4.0 * np.sin(k + session))
    forward = np.array([np.sin(yaw) * np.cos(down), np.cos(yaw) * np.cos(down), -np.sin(down)])
    right = np.array([np.cos(yaw), -np.sin(yaw), 0.0])
    T_world_camera = np.eye(4)
    T_world_camera[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    T_world_camera[:3, 3] = [CAMERA_X_M[session][k], -2.4, 1.5]
    return T_world_camera


def render(session: int, T_world_camera: NDArray[np.float64]) -> View:
    """Paint the boxes of a visit, its floor and its wall."""
    rays_camera = CAMERA.backproject(np.ones((CAMERA.height, CAMERA.width), dtype=np.float32))
    rays = T_world_camera[:3, :3] @ rays_camera.reshape(-1, 3).T.astype(np.float64)  # (3, H * W)
    origin = T_world_camera[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / rays
        depth = np.minimum(
            np.where(rays[2] < 0, (FLOOR_Z_M - origin[2]) * inverse[2], np.inf),
            np.where(rays[1] > 0, (WALL_Y_M - origin[1]) * inverse[1], np.inf),
        )
        ids = np.zeros(len(depth), dtype=np.uint16)
        for item in OBJECTS:
            if session in item.boxes:
                enter, leave = np.zeros(len(depth)), np.full(len(depth), np.inf)
                for axis, (low, high) in enumerate(zip(*item.boxes[session], strict=True)):
                    to_low = (low - origin[axis]) * inverse[axis]
                    to_high = (high - origin[axis]) * inverse[axis]
                    np.maximum(enter, np.minimum(to_low, to_high), out=enter)
                    np.minimum(leave, np.maximum(to_low, to_high), out=leave)
                hit = (enter < leave) & (enter > 0) & (enter < depth)
                depth[hit], ids[hit] = enter[hit], item.object_id
    points = origin + (rays * depth).T
    return View(
        rgb=_paint(session, points, ids).reshape(CAMERA.height, CAMERA.width, 3),
        depth_m=depth.astype(np.float32).reshape(CAMERA.height, CAMERA.width),
        object_ids=ids.reshape(CAMERA.height, CAMERA.width),
    )


def _paint(session: int, points: NDArray[np.float64], ids: NDArray[np.uint16]) -> NDArray[np.uint8]:
    colours = np.full((max(item.object_id for item in OBJECTS) + 1, 3), 150.0)
    offset = np.zeros((len(colours), 3))
    for item in OBJECTS:
        colours[item.object_id] = item.colour
        if session in item.boxes:
            offset[item.object_id] = item.boxes[session][0]  # texture travels with what moved
    local = points - offset[ids]
    cells = np.floor(local / np.where(ids > 0, 0.1, 0.5)[:, None] + 1e-6).sum(axis=1)
    shade = np.where(cells % 2 == 0, 1.0, 0.82) * (0.85 + 0.1 * np.sin(local[:, 0] * 5.0)) * LIGHT[session]
    return np.clip(colours[ids] * shade[:, None], 0, 255).astype(np.uint8)


def seen_by(
    points_world: NDArray[np.float64], views: list[View], poses: list[NDArray[np.float64]], tolerance_m: float
) -> NDArray[np.bool_]:
    """(N,) whether any of the views looks at or through each point."""
    seen = np.zeros(len(points_world), dtype=bool)
    for view, T_world_camera in zip(views, poses, strict=True):
        pixels, depth = CAMERA.project(transform_points(invert_rigid(T_world_camera), points_world))
        column, row = np.rint(pixels).astype(int).T
        inside = (depth > 0) & (column >= 0) & (column < CAMERA.width) & (row >= 0) & (row < CAMERA.height)
        surface = view.depth_m[np.where(inside, row, 0), np.where(inside, column, 0)]
        seen |= inside & (depth <= surface + tolerance_m)
    return seen
