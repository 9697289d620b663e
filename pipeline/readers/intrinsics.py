"""Intrinsics as archives state them: checked, with lens distortion, and what undoes it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.errors import InputError

FIELD_OF_VIEW_DEG = (2.0, 170.0)


@dataclass(frozen=True)
class Distortion:
    """Brown-Conrady coefficients of OpenCV's five-parameter model."""

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    def __bool__(self) -> bool:
        return any((self.k1, self.k2, self.p1, self.p2, self.k3))


def number(values: Mapping[str, Any], key: str, where: str, default: float | None = None) -> float:
    """A finite number of a JSON object.

    Raises:
        InputError: missing without a default, or not a finite number.
    """
    value = values.get(key)
    if value is None:
        value = default
    if value is None:
        raise InputError(f"{where}: {key!r} is missing", "a number is expected")
    try:
        converted = float(value) if isinstance(value, int | float) else math.nan
    except OverflowError:
        converted = math.inf
    if isinstance(value, bool) or not math.isfinite(converted):
        raise InputError(f"{where}: {key!r} is {value!r:.40}", "a finite number is expected")
    return converted


def checked_camera(camera: PinholeCamera, where: str) -> PinholeCamera:
    """The camera itself, if a real one could have these intrinsics.

    Raises:
        InputError: sizes or focal lengths that are not positive, an absurd field of view, or a principal
            point farther outside the image than half its size.
    """
    hint = "fx, fy, cx, cy are in pixels of the stored image"
    for name, value in (("width", camera.width), ("height", camera.height)):
        if value < 1:
            raise InputError(f"{where}: wrong intrinsics, {name} is {value}", hint)
    for axis, size, focal, centre in (
        ("x", camera.width, camera.fx, camera.cx),
        ("y", camera.height, camera.fy, camera.cy),
    ):
        if not (math.isfinite(focal) and focal > 0):
            raise InputError(f"{where}: wrong intrinsics, f{axis} is {focal:g}", hint)
        fov = math.degrees(2 * math.atan(size / (2 * focal)))
        if not FIELD_OF_VIEW_DEG[0] <= fov <= FIELD_OF_VIEW_DEG[1]:
            raise InputError(
                f"{where}: wrong intrinsics, f{axis} = {focal:g} means a field of view of {fov:.1f} deg", hint
            )
        if not -0.5 * size <= centre <= 1.5 * size:
            raise InputError(
                f"{where}: wrong intrinsics, c{axis} = {centre:g} lies far outside the image of {size} px",
                hint,
            )
    return camera


@lru_cache(maxsize=8)
def undistortion_maps(
    camera: PinholeCamera, distortion: Distortion
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where each pixel of the undistorted image (same K) lies in the stored one: two (H, W) float32."""
    coefficients = np.array([distortion.k1, distortion.k2, distortion.p1, distortion.p2, distortion.k3])
    maps = cv2.initUndistortRectifyMap(
        camera.matrix, coefficients, np.eye(3), camera.matrix, (camera.width, camera.height), cv2.CV_32FC1
    )
    map_x, map_y = (np.asarray(grid, dtype=np.float32) for grid in maps)
    map_x.flags.writeable = map_y.flags.writeable = False
    return map_x, map_y


def undistort_colour(
    image: NDArray[np.uint8], camera: PinholeCamera, distortion: Distortion
) -> NDArray[np.uint8]:
    """Undistorted colour, (H, W, 3), bilinear; edges are continued so that no border looks like an object."""
    if not distortion:
        return image
    map_x, map_y = undistortion_maps(camera, distortion)
    warped = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, dtype=np.uint8)


def undistort_counts(
    counts: NDArray[np.uint16], camera: PinholeCamera, distortion: Distortion
) -> NDArray[np.uint16]:
    """Undistorted depth, (H, W), nearest: averaging across an edge invents surfaces in mid-air."""
    if not distortion:
        return counts
    map_x, map_y = undistortion_maps(camera, distortion)
    warped = cv2.remap(counts, map_x, map_y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
    return np.asarray(warped, dtype=np.uint16)
