"""What real cameras make of a perfect view: exposure, grain, blur; noisy depth with holes; pose errors."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.synthetic.render import View
from pipeline.synthetic.world import SensorSettings

_MIDDLE_GREY = 0.20  # linear intensity that auto-exposure aims at


def expose(
    view: View, exposure: float, sensor: SensorSettings, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """The colour image, (H, W, 3) uint8 sRGB-like: partial auto-exposure with jitter, blur and grain.

    Args:
        view: what a perfect camera sees.
        exposure: of the visit, as a factor.
        sensor: grain, blur and jitter.
        rng: source of the noise.
    """
    mean = float(view.radiance.mean())
    gain = exposure * (_MIDDLE_GREY / max(mean, 1e-4)) ** 0.6 * np.exp(rng.normal(0, sensor.exposure_jitter))
    image = np.sqrt(np.clip(view.radiance * np.float32(gain), 0, 4))
    image = np.where(image > 0.8, 0.8 + 0.2 * np.tanh((image - 0.8) * 2.5), image).astype(np.float32)
    image = cv2.GaussianBlur(image, (0, 0), sensor.image_blur_px)
    grain = rng.standard_normal(image.shape[:2], dtype=np.float32)
    tint = rng.standard_normal(image.shape[:2], dtype=np.float32) * np.float32(0.5)
    image += (grain * np.float32(sensor.image_noise))[..., None]
    image[..., 0] += tint * np.float32(sensor.image_noise)
    image[..., 2] -= tint * np.float32(sensor.image_noise)
    return (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)


def measure(view: View, sensor: SensorSettings, rng: np.random.Generator) -> NDArray[np.float32]:
    """The depth image, (H, W) float32 metres, 0 = hole.

    Noise grows with z^2 and is correlated over a few pixels; holes open on surfaces seen flat, along
    occluding edges, on glass, and towards the end of the range.
    """
    depth = view.depth
    known = np.isfinite(depth)
    z = np.where(known, depth, 0).astype(np.float32)
    shape = depth.shape
    fine = rng.standard_normal(shape, dtype=np.float32)
    coarse = cv2.resize(
        rng.standard_normal((max(shape[0] // 6, 1), max(shape[1] // 6, 1)), dtype=np.float32),
        (shape[1], shape[0]),
        interpolation=cv2.INTER_CUBIC,
    )
    deviation = sensor.depth_noise_m + sensor.depth_noise_per_m * z * z
    measured = z + deviation * (np.float32(0.75) * fine + np.float32(0.6) * coarse)
    step = np.maximum(sensor.disparity_step_m * z * z, 1e-3)
    measured = np.rint(measured / step) * step

    patchy = cv2.resize(
        rng.random((max(shape[0] // 24, 2), max(shape[1] // 24, 2)), dtype=np.float32),
        (shape[1], shape[0]),
        interpolation=cv2.INTER_LINEAR,
    )
    chance = 0.6 * patchy + 0.4 * rng.random(shape, dtype=np.float32)
    hole = ~known | (z < sensor.min_range_m) | (z > sensor.max_range_m)
    hole |= view.cosine < sensor.hole_cosine * (0.4 + chance)
    hole |= view.gloss * sensor.gloss_holes > chance
    hole |= z > sensor.max_range_m * (0.8 + 0.4 * chance)
    far = np.where(known, z, np.float32(1e3))
    kernel = np.ones((3, 3), dtype=np.uint8)
    jump = cv2.dilate(far, kernel) - cv2.erode(far, kernel) > 0.04 + 0.03 * z
    hole |= jump & (rng.random(shape, dtype=np.float32) < 0.75)
    return np.where(hole, np.float32(0), measured).astype(np.float32)


def misplace(
    path: NDArray[np.float64], sensor: SensorSettings, rng: np.random.Generator
) -> NDArray[np.float64]:
    """The path as the recording's odometry reports it: slowly drifting errors of the given rms.

    Args:
        path: true T_world_camera, (frames, 4, 4).
        sensor: ``pose_noise_m`` is the rms length of the shift, ``pose_noise_deg`` the rms angle.
        rng: source of the noise.
    """
    reported = path.copy()
    memory = 0.7
    error = rng.standard_normal(6)
    for index in range(len(path)):
        if index:
            error = memory * error + np.sqrt(1 - memory**2) * rng.standard_normal(6)
        turn = error[3:] * np.deg2rad(sensor.pose_noise_deg) / np.sqrt(3)
        rotation, _ = cv2.Rodrigues(turn)
        reported[index, :3, :3] = path[index, :3, :3] @ rotation
        reported[index, :3, 3] += error[:3] * sensor.pose_noise_m / np.sqrt(3)
    return reported
