"""Colours of one keyframe brought to the light of another that sees the same place.

One gain per channel is what labels are decided on. Between visits weeks apart it isn't enough for a picture:
automatic white balance mixes channels, saturation and contrast are set per frame, a lamp or a window lights
one side. Here log colours are mapped by an affine function of themselves and of the place in the image,
fitted robustly to the patches that both keyframes see.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.perception.protocols import PatchWarp

MIN_SHARED_PATCHES = 60
_DARKEST, _BRIGHTEST = 4.0, 255.0
_WELL_EXPOSED = (8.0, 245.0)
_BLUR_PATCHES = 0.6
# Colours are taken from the middle of the log range so that the offset is a gain.
_MIDDLE_LOG = 4.5
# Pull towards "only a gain" per squared unit: a scene of few colours cannot tell contrast from gain.
_COLOUR_RIDGE, _PLACE_RIDGE = 0.1, 0.01
_ROUNDS = 6
_RESIDUAL_FLOOR = 0.05


def shared_colours(
    colour0: NDArray[np.float32], colour1: NDArray[np.float32], warp: PatchWarp
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
    """What both keyframes show at the patches of the current one.

    Args:
        colour0, colour1: (H_f, W_f, 3) mean patch colours, 0..255.
        warp: where the patches of ``colour1`` lie in ``colour0``.

    Returns:
        (H_f, W_f, 3) colours of the previous keyframe, those of the current one (both lightly blurred), and
        (H_f, W_f) where both are seen and well exposed.
    """
    expected = warped(cv2.GaussianBlur(colour0, (0, 0), _BLUR_PATCHES), warp)
    observed = np.asarray(cv2.GaussianBlur(colour1, (0, 0), _BLUR_PATCHES), np.float32)
    low, high = _WELL_EXPOSED
    usable = warp.is_visible.copy()
    for image in (expected, observed):
        usable &= (image.min(axis=-1) > low) & (image.max(axis=-1) < high)
    return expected, observed, usable


def transferred_colours(
    colour0: NDArray[np.float32], colour1: NDArray[np.float32], warp: PatchWarp
) -> NDArray[np.float32]:
    """The current keyframe's patch colours as they would look in the previous one's light.

    Iteratively re-weighted ridge regression of the log ratio (Geman-McClure-like weights shared by the
    channels); what changed is an outlier to it.

    Args:
        colour0, colour1: (H_f, W_f, 3) mean patch colours, 0..255.
        warp: where the patches of ``colour1`` lie in ``colour0``.

    Returns:
        (H_f, W_f, 3) 0..255; ``colour1`` itself when too few patches are shared.
    """
    expected, observed, usable = shared_colours(colour0, colour1, warp)
    if usable.sum() < MIN_SHARED_PATCHES:
        return colour1
    terms = _terms(observed)[usable]
    ratio = (np.log(expected[usable]) - np.log(observed[usable])).astype(np.float64)
    ridge = np.diag([0.0, *[_COLOUR_RIDGE] * 3, *[_PLACE_RIDGE] * 2])
    weights = np.ones(len(terms))
    coefficients = np.zeros((terms.shape[1], 3))
    for _ in range(_ROUNDS):
        weighted = terms * (weights / weights.sum())[:, None]
        coefficients = np.linalg.solve(weighted.T @ terms + ridge, weighted.T @ ratio)
        residual = np.linalg.norm(ratio - terms @ coefficients, axis=1)
        scale = max(1.48 * float(np.median(residual)), _RESIDUAL_FLOOR)
        weights = 1.0 / (1.0 + (residual / scale) ** 2) ** 2
    log_colours = np.log(np.clip(colour1, _DARKEST, _BRIGHTEST)) + _terms(colour1) @ coefficients
    return np.clip(np.exp(log_colours), 0, 255).astype(np.float32)


def warped(image: NDArray[np.float32], warp: PatchWarp) -> NDArray[np.float32]:
    """(H_f, W_f, c) of the previous keyframe, read where the patches of the current one lie in it."""
    column, row = (np.ascontiguousarray(warp.positions[..., axis]) for axis in range(2))
    sampled = cv2.remap(image, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(sampled, np.float32)


def _terms(colour: NDArray[np.float32]) -> NDArray[np.float64]:
    """(H_f, W_f, 6): one, the log colour, and the place in widths of the image from its middle."""
    rows, columns = colour.shape[:2]
    logs = np.log(np.clip(colour, _DARKEST, _BRIGHTEST)).astype(np.float64) - _MIDDLE_LOG
    y, x = np.mgrid[:rows, :columns].astype(np.float64)
    place = np.stack([(x - columns / 2) / columns, (y - rows / 2) / columns], axis=-1)
    return np.concatenate([np.ones((rows, columns, 1)), logs, place], axis=-1)
