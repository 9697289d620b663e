"""Points, normals and trustworthy pixels of one depth image."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera

# A pixel next to a depth jump larger than the local slant explains lies on an occlusion edge.
EDGE_SLANT_FACTOR = 4.0
EDGE_OFFSET_M = 0.015
EDGE_PER_METRE = 0.008
NORMAL_STEP_PX = 2
_KERNEL = np.ones((3, 3), np.uint8)
_FAR_M = 1e3


@dataclass(frozen=True)
class DepthGeometry:
    """What one depth image says about surfaces, in the camera frame.

    Attributes:
        points_camera: (h, w, 3) float32 metres; the origin where there is no measurement.
        normals_camera: (h, w, 3) float32 unit normals that face the camera.
        is_reliable: (h, w) bool: measured, off occlusion edges and not seen at a grazing angle.
    """

    points_camera: NDArray[np.float32]
    normals_camera: NDArray[np.float32]
    is_reliable: NDArray[np.bool_]


def depth_geometry(
    depth: NDArray[np.float32], camera: PinholeCamera, min_incidence_cosine: float
) -> DepthGeometry:
    """Points, normals and reliability of a depth image.

    Args:
        depth: (h, w) metres, 0 = no measurement, of ``camera``.
        camera: intrinsics at this size.
        min_incidence_cosine: surfaces seen flatter than this are unreliable.
    """
    points = camera.backproject(depth)
    measured = depth > 0
    # Means over measured pixels only: holes are the origin, and would tilt every normal around them.
    share = cv2.blur(measured.astype(np.float32), (3, 3))
    smoothed = cv2.blur(points, (3, 3)) / np.maximum(share, 1e-3)[..., None]
    known = share > 1e-3
    step = NORMAL_STEP_PX
    horizontal = np.zeros_like(points)
    vertical = np.zeros_like(points)
    horizontal[:, step:-step] = smoothed[:, 2 * step :] - smoothed[:, : -2 * step]
    vertical[step:-step] = smoothed[2 * step :] - smoothed[: -2 * step]
    horizontal[:, step:-step][~(known[:, 2 * step :] & known[:, : -2 * step])] = 0
    vertical[step:-step][~(known[2 * step :] & known[: -2 * step])] = 0
    normals = _cross(horizontal, vertical)
    length = np.sqrt(np.einsum("hwc,hwc->hw", normals, normals))
    normals /= np.maximum(length, 1e-12)[..., None]
    distance = np.sqrt(np.einsum("hwc,hwc->hw", points, points))
    cosine = np.einsum("hwc,hwc->hw", normals, points) / np.maximum(distance, 1e-9)
    normals *= np.where(cosine > 0, -1, 1).astype(np.float32)[..., None]
    cosine = np.abs(cosine)

    nearest = cv2.erode(np.where(measured, depth, np.float32(_FAR_M)), _KERNEL)
    farthest = cv2.dilate(depth, _KERNEL)
    explained = EDGE_SLANT_FACTOR * depth / np.float32(camera.fx) / np.maximum(cosine, 0.12)
    on_edge = farthest - nearest > explained + EDGE_OFFSET_M + EDGE_PER_METRE * depth
    return DepthGeometry(
        points, normals, measured & (length > 1e-12) & ~on_edge & (cosine > min_incidence_cosine)
    )


def _cross(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    # np.cross on (h, w, 3) is several times slower than the three products written out.
    out = np.empty_like(a)
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out
