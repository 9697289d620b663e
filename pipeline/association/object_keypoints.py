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

from pipeline.camera import rotate_points, transform_points
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects

_VIEWS_PER_OBJECT = 5
_MAX_PER_VIEW, _MAX_PER_OBJECT = 250, 400
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
    pixels = objects.view_pixels[:, instance]
    views = np.argsort(-pixels, kind="stable")[:_VIEWS_PER_OBJECT]
    found = [
        _of_view(geometry, objects.mask(geometry, k) == instance, image(k), k)
        for k in views[pixels[views] > 0].tolist()
    ]
    found = [keypoints for keypoints in found if len(keypoints)]
    if not found:
        return no_keypoints()
    return ObjectKeypoints(
        *(
            np.concatenate([getattr(keypoints, name) for keypoints in found])
            for name in ("points_world", "R_world_keypoint", "sizes_m", "descriptors")
        )
    )


def _of_view(
    geometry: SessionGeometry, is_object: NDArray[np.bool_], rgb: NDArray[np.uint8], k: int
) -> ObjectKeypoints:
    stride = geometry.stride
    rows, columns = np.nonzero(is_object)
    top, left = max(0, rows.min() * stride - _MARGIN_PX), max(0, columns.min() * stride - _MARGIN_PX)
    bottom, right = rows.max() * stride + _MARGIN_PX, columns.max() * stride + _MARGIN_PX
    grey = cv2.cvtColor(np.ascontiguousarray(rgb[top:bottom, left:right]), cv2.COLOR_RGB2GRAY)
    sift = cv2.SIFT_create(_MAX_PER_VIEW, 3, _CONTRAST)
    keypoints, descriptors = sift.detectAndCompute(grey, None)
    if descriptors is None or not len(keypoints):
        return no_keypoints()
    pixel = np.array([keypoint.pt for keypoint in keypoints]) + [left, top]
    diameter, angle = np.array([(keypoint.size, np.deg2rad(keypoint.angle)) for keypoint in keypoints]).T
    cell = np.clip(np.round(pixel / stride).astype(int), 0, [is_object.shape[1] - 1, is_object.shape[0] - 1])
    depth, voxels = geometry.store.depth(k), geometry.store.voxels(k)
    column, row = cell.T
    kept = is_object[row, column] & (depth[row, column] > 0)
    camera, T = geometry.keyframes[k].camera, geometry.keyframes[k].T_world_camera
    pixel, diameter, angle, row, column = pixel[kept], diameter[kept], angle[kept], row[kept], column[kept]
    z = depth[row, column].astype(np.float64)
    normals = rotate_points(T[:3, :3].T, geometry.surface.normals_world[voxels[row, column]].astype(np.float64))
    focal = np.array([camera.fx, camera.fy])
    ray = np.column_stack([(pixel - [camera.cx, camera.cy]) / focal, np.ones(len(pixel))])
    points = ray * z[:, None]
    ahead = ray + np.column_stack([np.cos(angle) / camera.fx, np.sin(angle) / camera.fy, np.zeros(len(ray))])
    # Where the neighbouring ray meets the surface.
    ahead *= ((points * normals).sum(axis=1) / _away_from_zero((ahead * normals).sum(axis=1)))[:, None]
    along = ahead - points
    along -= (along * normals).sum(axis=1, keepdims=True) * normals
    length = np.linalg.norm(along, axis=1)
    cosine = -(ray * normals).sum(axis=1) / np.linalg.norm(ray, axis=1)
    good = (cosine > _LEAST_COSINE) & (length > 1e-9)
    along, normals = along[good] / length[good, None], normals[good]
    frames = np.stack([along, np.cross(normals, along), normals], axis=2)
    chosen = np.flatnonzero(kept)[good]
    root = np.sqrt(descriptors[chosen] / np.maximum(descriptors[chosen].sum(axis=1, keepdims=True), 1e-9))
    return ObjectKeypoints(
        transform_points(T, points[good]).astype(np.float64),
        T[:3, :3] @ frames,
        (diameter[good] * z[good] / camera.fx).astype(np.float64),
        root.astype(np.float32),
    )


def _away_from_zero(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.abs(values) < 1e-6, 1e-6, values)
