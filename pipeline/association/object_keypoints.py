"""Keypoints on the surfaces of single objects: where a print, a sticker or a seam can be found again.

SIFT (Lowe, 2004) is read off the whole images, which show a print far finer than fused voxels do. Depth
lifts every keypoint to a point with a frame (its normal, and its direction in the surface) and a size in
metres, so that one pair of keypoints already tells the whole motion of an object.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, rotate_points, transform_points
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects

_VIEWS_PER_OBJECT = 5
# All keypoints of a visit are compared with all of the other: the more objects, the fewer of each.
_KEYPOINTS_PER_VISIT = 60_000
_KEYPOINTS_PER_VIEW = (30, 250)
_MARGIN_PX = 12
_CONTRAST = 0.02
# Seen at a flatter angle, a keypoint's neighbourhood is too foreshortened to be found again.
_LEAST_COSINE = 0.35
DESCRIPTOR_SIZE = 128


@dataclass(frozen=True)
class ObjectKeypoints:
    """Keypoints of one object from the keyframes that see it best.

    Attributes:
        points_world: (n, 3) metres.
        R_world_keypoint: (n, 3, 3) columns: direction in the surface, the third axis the normal.
        sizes_m: (n,) diameter of the neighbourhood described.
        descriptors: (n, 128) unit vectors (RootSIFT: Arandjelovic and Zisserman, 2012).
    """

    points_world: NDArray[np.float64]
    R_world_keypoint: NDArray[np.float64]
    sizes_m: NDArray[np.float64]
    descriptors: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.points_world)


def no_keypoints() -> ObjectKeypoints:
    """Of an object without any."""
    return ObjectKeypoints(
        np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0), np.zeros((0, DESCRIPTOR_SIZE), np.float32)
    )


def object_keypoints(
    geometry: SessionGeometry,
    objects: SessionObjects,
    image: Callable[[int], NDArray[np.uint8]],
    instance: int,
) -> ObjectKeypoints:
    """The keypoints of an instance (counted from 1).

    Args:
        geometry, objects: of the visit.
        image: (H, W, 3) RGB of a keyframe at processing size.
    """
    most = np.clip(_KEYPOINTS_PER_VISIT // (objects.count * _VIEWS_PER_OBJECT), *_KEYPOINTS_PER_VIEW)
    pixels = objects.view_pixels[:, instance]
    views = np.argsort(-pixels, kind="stable")[:_VIEWS_PER_OBJECT]
    found = [
        _of_view(geometry, objects.mask(geometry, k) == instance, image(k), k, int(most))
        for k in views[pixels[views] > 0].tolist()
    ]
    if not found:
        return no_keypoints()
    return ObjectKeypoints(
        np.concatenate([of_view.points_world for of_view in found]),
        np.concatenate([of_view.R_world_keypoint for of_view in found]),
        np.concatenate([of_view.sizes_m for of_view in found]),
        np.concatenate([of_view.descriptors for of_view in found]),
    )


def _of_view(
    geometry: SessionGeometry, is_object: NDArray[np.bool_], rgb: NDArray[np.uint8], k: int, most: int
) -> ObjectKeypoints:
    pixel, diameter_px, angle_rad, descriptors = _detected(rgb, is_object, geometry.stride, most)
    last_row, last_column = np.array(is_object.shape) - 1
    cell = np.clip(np.round(pixel / geometry.stride).astype(np.int64), 0, [last_column, last_row])
    depth, voxels = geometry.store.depth(k), geometry.store.voxels(k)
    is_on = is_object[cell[:, 1], cell[:, 0]] & (depth[cell[:, 1], cell[:, 0]] > 0)
    if not is_on.any():
        return no_keypoints()
    pixel, angle_rad = pixel[is_on], angle_rad[is_on]
    diameter_px, descriptors = diameter_px[is_on], descriptors[is_on]
    at = cell[is_on, 1], cell[is_on, 0]
    camera, T = geometry.keyframes[k].camera, geometry.keyframes[k].T_world_camera
    normals = rotate_points(T[:3, :3].T, geometry.surface.normals_world[voxels[at]])
    points, frames, is_seen_well = _lifted(camera, pixel, angle_rad, depth[at], normals)
    root = np.sqrt(descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9))
    return ObjectKeypoints(
        transform_points(T, points[is_seen_well]).astype(np.float64),
        T[:3, :3] @ frames[is_seen_well],
        (diameter_px * points[:, 2] / camera.fx)[is_seen_well],
        root[is_seen_well].astype(np.float32),
    )


def _detected(
    rgb: NDArray[np.uint8], is_object: NDArray[np.bool_], stride: int, most: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
    """Pixels (n, 2), diameters (pixels), directions (radians) and SIFT descriptors around an object."""
    rows, columns = np.nonzero(is_object)
    top, left = (max(0, int(low.min()) * stride - _MARGIN_PX) for low in (rows, columns))
    bottom, right = (int(high.max()) * stride + _MARGIN_PX for high in (rows, columns))
    grey = cv2.cvtColor(np.ascontiguousarray(rgb[top:bottom, left:right]), cv2.COLOR_RGB2GRAY)
    sift = cv2.SIFT_create(most, contrastThreshold=_CONTRAST)  # type: ignore[attr-defined]  # not in its stubs
    keypoints, descriptors = sift.detectAndCompute(grey, None)
    if descriptors is None:
        return np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros((0, DESCRIPTOR_SIZE), np.float32)
    found = np.array([(*keypoint.pt, keypoint.size, keypoint.angle) for keypoint in keypoints])
    pixel = found[:, :2] + np.array([left, top])
    return pixel, found[:, 2], np.deg2rad(found[:, 3]), descriptors


def _lifted(
    camera: PinholeCamera,
    pixel: NDArray[np.float64],
    angle_rad: NDArray[np.float64],
    depth_m: NDArray[np.floating],
    normals: NDArray[np.floating],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Points (n, 3), frames (n, 3, 3) and which are seen at a good angle; camera frame, metres."""
    scale = np.array([camera.fx, camera.fy])
    level = np.zeros(len(pixel))
    ray = np.column_stack([(pixel - [camera.cx, camera.cy]) / scale, level + 1])
    points = ray * depth_m[:, None]
    # Where the ray of the neighbouring pixel meets the surface.
    step = np.column_stack([np.cos(angle_rad) / camera.fx, np.sin(angle_rad) / camera.fy, level])
    towards = ((ray + step) * normals).sum(axis=1)
    towards = np.where(np.abs(towards) < 1e-6, 1e-6, towards)
    along = (ray + step) * ((points * normals).sum(axis=1) / towards)[:, None] - points
    along -= (along * normals).sum(axis=1, keepdims=True) * normals
    length = np.linalg.norm(along, axis=1)
    along /= np.maximum(length, 1e-12)[:, None]
    cosine = -(ray * normals).sum(axis=1) / np.linalg.norm(ray, axis=1)
    frames = np.stack([along, np.cross(normals, along), normals], axis=2)
    return points, frames, (cosine > _LEAST_COSINE) & (length > 1e-9)
