"""Does the fine pattern of a surface look the same in a keyframe of the other visit, pixel by pixel?

Patches of 8 or 16 pixels tell a mug from a book; of two cars of one model and colour they see the same car.
What differs is the pattern: stickers, stains, print. Here the other visit's image is warped onto the
keyframe by its depth, everything coarser than the pattern is taken out of both (light, shading, paint), and
the rest is correlated in small windows, searched over a few pixels so that pose errors are forgiven.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import invert_rigid, transform_points
from pipeline.mapping.colours import log_colour
from pipeline.mapping.front_end import SessionGeometry
from pipeline.settings import PatternSettings

_NEAR_M = 0.1
# A pixel of the other keyframe shows the same surface if its depth agrees this well.
_DEPTH_TOLERANCE_M, _DEPTH_TOLERANCE_RATIO = 0.02, 0.03
_MIN_SHARED_PIXELS = 500
# The quietest windows of an image show its noise.
_NOISE_PERCENTILE = 8
_MIN_WINDOW_FILL = 0.6
# Windows count from this multiple of the noise, and fully from that on.
_PATTERN_FROM, _PATTERN_FULL = 2.0, 10.0
_NOISE_FLOOR = 1e-5
_SCALE_MATCHED = 1.2


@dataclass
class PatternAgreement:
    """Sums over the pixels of every instance of one visit, (K + 1,) each.

    Attributes:
        weight: pixels that show a pattern, by how far it stands out of the noise.
        correlation: sum of weight times the best local correlation.
    """

    weight: NDArray[np.float64]
    correlation: NDArray[np.float64]

    @classmethod
    def empty(cls, instances: int) -> PatternAgreement:
        """Nothing compared yet for K instances."""
        return cls(*(np.zeros(instances + 1) for _ in range(2)))

    def add(self, other: PatternAgreement) -> None:
        """Add the sums of another comparison."""
        self.weight += other.weight
        self.correlation += other.correlation

    @property
    def mean_correlation(self) -> NDArray[np.float64]:
        """(K + 1,) in [-1, 1]; NaN where no pattern was compared."""
        return np.where(self.weight > 0, self.correlation / np.maximum(self.weight, 1e-9), np.nan)


def compare_pattern(
    own: SessionGeometry,
    k: int,
    other: SessionGeometry,
    k_other: int,
    instances: NDArray[np.int32],
    count: int,
    settings: PatternSettings,
) -> PatternAgreement:
    """Compare what one keyframe shows of every instance with a keyframe of the other visit.

    Args:
        own, k: the keyframe. other, k_other: the keyframe that it is compared with.
        instances: (h, w) instance of each strided pixel of keyframe ``k``, 0 = none.
        count: K.
        settings: window, search radius and what counts as pattern.
    """
    agreement = PatternAgreement.empty(count)
    warped, is_shared, scale = warp_into(own, k, other, k_other)
    inside = is_shared & (instances > 0)
    if int(inside.sum()) < _MIN_SHARED_PIXELS:
        return agreement
    own_colours = _smoothed(log_colour(own.store.rgb(k)), scale)
    window = _bounds(inside, settings.window_pixels)
    local, weight = local_correlation(own_colours[window], warped[window], is_shared[window], settings)
    # Across an outline the pattern is that of two things.
    shown = instances[window]
    outline = cv2.morphologyEx(shown.astype(np.float32), cv2.MORPH_GRADIENT, np.ones((5, 5), np.uint8)) > 0
    solid = cv2.erode(is_shared[window].astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    used = (shown > 0) & solid & ~outline & (weight > 0)
    instance, weights, values = shown[used], weight[used], local[used]
    agreement.weight += np.bincount(instance, weights, count + 1)
    agreement.correlation += np.bincount(instance, weights * values, count + 1)
    return agreement


def warp_into(
    own: SessionGeometry, k: int, other: SessionGeometry, k_other: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_], float]:
    """The other keyframe as seen from keyframe ``k``.

    Returns:
        (h, w, 3) its log colours, (h, w) where it shows the same surface, and how many of its pixels lie in
        one of keyframe ``k`` along a line (above 1: it saw the place from nearer).
    """
    depth = own.store.depth(k)
    camera, other_camera = own.strided_camera(k), other.strided_camera(k_other)
    T_other_own = invert_rigid(other.keyframes[k_other].T_world_camera) @ own.keyframes[k].T_world_camera
    points = transform_points(T_other_own, camera.backproject(depth).reshape(-1, 3).astype(np.float32))
    pixels, z = other_camera.project(points)
    valid = (depth.reshape(-1) > 0) & (z > _NEAR_M)
    pixels = np.where(valid[:, None], pixels, -10).astype(np.float32).reshape(*depth.shape, 2)
    z = np.where(valid, z, 0).astype(np.float32).reshape(depth.shape)
    other_depth = other.store.depth(k_other)
    seen = cv2.remap(other_depth, pixels, None, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT)
    tolerance = _DEPTH_TOLERANCE_M + _DEPTH_TOLERANCE_RATIO * z
    is_shared = (z > 0) & (seen > 0) & (np.abs(seen - z) < tolerance)
    scale = 1.0
    if is_shared.any():
        per_own = depth[is_shared] / camera.fx
        scale = float(np.median(per_own / (z[is_shared] / other_camera.fx)))
    colours = _smoothed(log_colour(other.store.rgb(k_other)), 1 / scale)
    warped = cv2.remap(colours, pixels, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, np.float32), is_shared, scale


def local_correlation(
    own: NDArray[np.float32],
    other: NDArray[np.float32],
    is_shared: NDArray[np.bool_],
    settings: PatternSettings,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Normalised correlation of two aligned images in a window around every pixel, best over small shifts.

    Args:
        own, other: (h, w, 3) log colours.
        is_shared: (h, w) pixels that show the same surface.

    Returns:
        (h, w) correlation, damped where there is only noise; (h, w) weight in [0, 1]: how far the stronger
        of the two patterns stands out of the noise.
    """
    radius, size = settings.search_radius_pixels, settings.window_pixels
    filled = _box(is_shared.astype(np.float32), size)
    own, other = _pattern(own, is_shared, settings), _pattern(other, is_shared, settings)
    energy0, energy1 = _box(_dot(own, own), size), _box(_dot(other, other), size)
    noise0, noise1 = (
        max(float(np.percentile(energy[is_shared], _NOISE_PERCENTILE)), _NOISE_FLOOR)
        for energy in (energy0, energy1)
    )
    norm0, norm1 = 1 / np.sqrt(energy0 + noise0), 1 / np.sqrt(energy1 + noise1)
    other, norm1 = _padded(other, radius), _padded(norm1, radius)
    best = np.full(is_shared.shape, -1, np.float32)
    rows, columns = is_shared.shape
    for down in range(2 * radius + 1):
        for right in range(2 * radius + 1):
            shifted = (slice(down, down + rows), slice(right, right + columns))
            correlation = _box(_dot(own, other[shifted]), size)
            correlation *= norm0
            correlation *= norm1[shifted]
            np.maximum(best, correlation, out=best)
    strength = np.maximum(energy0, energy1) / ((noise0 + noise1) / 2)
    weight = np.clip((strength - _PATTERN_FROM) / (_PATTERN_FULL - _PATTERN_FROM), 0, 1)
    weight[(filled < _MIN_WINDOW_FILL) | ~is_shared] = 0
    return best, weight.astype(np.float32)


def _pattern(
    log_colours: NDArray[np.float32], is_valid: NDArray[np.bool_], settings: PatternSettings
) -> NDArray[np.float32]:
    """Band-pass of the valid pixels (normalised convolution): 0 where nothing is valid."""
    valid = is_valid.astype(np.float32)
    masked = log_colours * valid[..., None]
    levels = []
    for sigma in (settings.finest_pixels, settings.coarsest_pixels):
        share = np.maximum(cv2.GaussianBlur(valid, (0, 0), sigma), 1e-3)
        levels.append(cv2.GaussianBlur(masked, (0, 0), sigma) / share[..., None])
    return np.ascontiguousarray((levels[0] - levels[1]) * valid[..., None])


def _smoothed(log_colours: NDArray[np.float32], scale: float) -> NDArray[np.float32]:
    """Blurred to the resolution of an image with ``1 / scale`` of the pixels along a line."""
    ratio = 1 / max(scale, 1e-3)
    if ratio <= _SCALE_MATCHED:
        return log_colours
    return np.asarray(cv2.GaussianBlur(log_colours, (0, 0), 0.5 * np.sqrt(ratio**2 - 1)), np.float32)


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(cv2.transform(cv2.multiply(a, np.ascontiguousarray(b)), np.ones((1, 3), np.float32)))


def _box(image: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    return np.asarray(cv2.boxFilter(image, -1, (size, size), borderType=cv2.BORDER_CONSTANT), np.float32)


def _padded(image: NDArray[np.float32], radius: int) -> NDArray[np.float32]:
    return np.asarray(
        cv2.copyMakeBorder(image, radius, radius, radius, radius, cv2.BORDER_CONSTANT, value=0), np.float32
    )


def _bounds(mask: NDArray[np.bool_], margin: int) -> tuple[slice, slice]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(0, int(rows[0]) - margin), int(rows[-1]) + margin + 1),
        slice(max(0, int(columns[0]) - margin), int(columns[-1]) + margin + 1),
    )
