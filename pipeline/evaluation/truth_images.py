"""Ground-truth points drawn into a camera: which true object stands at each pixel.

Points are drawn twice as squares with a depth test: once as wide as the points' spacing appears, which
keeps silhouettes but leaves holes between points that are thinned to voxels, and once ``WIDE`` times that,
which closes surfaces but grows them. An object's pixels are those of the first drawing after a morphological
closing over one wide square; where closings of several objects meet, the nearest surface of the wide drawing
wins. Against the exact masks of a generated office this gives a mean IoU of 0.93 (0.77 and 0.86 with either
drawing alone).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.camera import PinholeCamera, invert_rigid, transform_points

NOTHING = -1
MAX_SPLAT_PX = 15
WIDE = 2.0
_NEAR_M = 0.05
_SPACING_SAMPLE = 20_000


def point_spacing_m(points_world: NDArray[np.float32]) -> float:
    """Median distance from a point to its nearest neighbour."""
    if len(points_world) < 2:
        return 0.0
    step = max(1, len(points_world) // _SPACING_SAMPLE)
    distances, _ = cKDTree(points_world).query(points_world[::step], k=2)
    return float(np.median(distances[:, 1]))


def object_image(
    points_world: NDArray[np.float32],
    object_id: NDArray[np.integer],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
    spacing_m: float,
) -> NDArray[np.int64]:
    """(H, W) object at each pixel, 0 = background or nothing.

    Args:
        points_world: (N, 3) metres, of one visit; object_id: (N,) their objects, 0 = background.
        spacing_m: distance between neighbouring points, see :func:`point_spacing_m`.
    """
    fine, depth = _drawn(points_world, object_id, camera, T_world_camera, spacing_m)
    wide, _ = _drawn(points_world, object_id, camera, T_world_camera, WIDE * spacing_m)
    image = np.zeros_like(fine)
    closings = {}
    for number in np.unique(fine[fine > 0]).tolist():
        mine = fine == number
        width = int(np.ceil(WIDE * spacing_m * camera.fx / float(np.median(depth[mine])))) | 1
        closings[number] = _closed(mine, width)
        image[mine] = number
    for number, closed in closings.items():
        image[closed & (wide == number)] = number
    return image


def nearest_point_image(
    points_world: NDArray[np.float32],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
    spacing_m: float,
) -> NDArray[np.int64]:
    """(H, W) row of the nearest point that covers each pixel; ``NOTHING`` where none does.

    Every point is a square as wide as ``spacing_m`` appears at its distance (rounded up, at most
    ``MAX_SPLAT_PX`` pixels), so that surfaces close; the nearest point hides what lies behind.
    """
    in_camera = transform_points(invert_rigid(T_world_camera), np.asarray(points_world, dtype=np.float32))
    pixels, depth = camera.project(in_camera)
    column, row = np.round(pixels[:, 0]), np.round(pixels[:, 1])
    margin = MAX_SPLAT_PX
    inside = (depth > _NEAR_M) & (np.abs(column - camera.width / 2) < camera.width / 2 + margin)
    inside &= np.abs(row - camera.height / 2) < camera.height / 2 + margin
    chosen = np.flatnonzero(inside)
    column, row = column[chosen].astype(np.int64), row[chosen].astype(np.int64)
    width_px = np.ceil(spacing_m * camera.fx / depth[chosen]).astype(np.int64)
    width_px = np.clip(width_px, 1, MAX_SPLAT_PX)
    # Depth in tenths of a millimetre before the row: the smallest key is the nearest point.
    key = (depth[chosen] * 1e4).astype(np.uint64) << np.uint64(32) | chosen.astype(np.uint64)
    empty = np.iinfo(np.uint64).max
    image = np.full(camera.height * camera.width, empty, dtype=np.uint64)
    for down in range(int(width_px.max(initial=0))):
        for right in range(int(width_px.max(initial=0))):
            wide = width_px > max(down, right)
            v, u = row + down - (width_px - 1) // 2, column + right - (width_px - 1) // 2
            here = wide & (v >= 0) & (v < camera.height) & (u >= 0) & (u < camera.width)
            np.minimum.at(image, v[here] * camera.width + u[here], key[here])
    rows = (image & np.uint64(0xFFFFFFFF)).astype(np.int64)
    return np.where(image == empty, NOTHING, rows).reshape(camera.height, camera.width)


def _drawn(
    points_world: NDArray[np.float32],
    object_id: NDArray[np.integer],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.float64],
    spacing_m: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Object and depth of the nearest point at each pixel; 0 and infinity where there is none."""
    rows = nearest_point_image(points_world, camera, T_world_camera, spacing_m)
    hit = rows != NOTHING
    owner, depth = np.zeros(rows.shape, dtype=np.int64), np.full(rows.shape, np.inf)
    owner[hit] = object_id[rows[hit]]
    T_camera_world = invert_rigid(T_world_camera)
    depth[hit] = points_world[rows[hit]] @ T_camera_world[2, :3] + T_camera_world[2, 3]
    return owner, depth


def _closed(mask: NDArray[np.bool_], width: int) -> NDArray[np.bool_]:
    """Closing with a square; padded, so that the image's border does not erode it."""
    padded = np.pad(mask.astype(np.uint8), width)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((width, width), dtype=np.uint8))
    return np.asarray(closed[width:-width, width:-width] > 0)
