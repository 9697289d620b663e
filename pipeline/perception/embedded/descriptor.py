"""Dense features without weights: gradient orientations and colour, compared as one 168-d unit vector.

Orientation histograms of 3x3 cells around each patch (after Dalal and Triggs, CVPR 2005) on the image at
half size, plus the patch's mean colour lifted by random Fourier features (Rahimi and Recht, NeurIPS 2007),
so that their inner product falls off with colour distance and C = F0 F1^T stays the paper's.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.perception.embedded.colour_transfer import (
    MIN_SHARED_PATCHES,
    shared_colours,
    transferred_colours,
    warped,
)
from pipeline.perception.protocols import PatchWarp, SimilarityScale
from pipeline.settings import DescriptorSettings

ORIENTATIONS = 8
CELL_PX = 8  # at half size
CELL_BLUR_PX = 4.8
CENTRE_WEIGHT_SPREAD = 1.62
CONTRAST_FLOOR = 0.02
COLOUR_CHANNELS = 3
_GAIN_ROUNDS = 8
_GAIN_FLOOR = 0.05
# Median colour differences count this much against the kernel width: standard deviations with a margin.
_SPREAD_OF_MEDIAN = 2.5


class GradientColourDescriptor:
    """The embedded feature extractor. Stored per patch: mean BGR (3) and the gradient histogram (72)."""

    name = "embedded"
    weights_hash: str | None = None
    similarity = SimilarityScale(threshold=0.93, softness=0.02, noise=0.02)

    def __init__(self, settings: DescriptorSettings) -> None:
        self._settings = settings
        self._frequencies = _random_frequencies(settings.random_features)

    def describe(self, rgb: NDArray[np.uint8]) -> NDArray[np.float16]:
        """(H_f, W_f, 75) of an (H, W, 3) RGB image; patches of ``patch_px`` cover the whole image."""
        height, width = rgb.shape[:2]
        patch = self._settings.patch_px
        grid = (max(1, round(height / patch)), max(1, round(width / patch)))
        bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
        colour = cv2.resize(bgr, (grid[1], grid[0]), interpolation=cv2.INTER_AREA).astype(np.float32)
        histogram = _gradient_histograms(cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY), grid)
        return np.concatenate([colour, histogram], axis=-1).astype(np.float16)

    def light(
        self, previous: NDArray[np.float16], current: NDArray[np.float16], warp: PatchWarp
    ) -> NDArray[np.float64]:
        """Per-channel log gain, (3,)."""
        colours = [stored[..., :COLOUR_CHANNELS].astype(np.float32) for stored in (previous, current)]
        return log_gain(colours[0], colours[1], warp)

    def comparable(
        self,
        previous: NDArray[np.float16],
        current: NDArray[np.float16],
        light: NDArray[np.float64] | None,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """F0 (N0, 168) and F1 (N1, 168), the current colours brought to the previous visit's light."""
        gain = np.ones(COLOUR_CHANNELS) if light is None else np.exp(light)
        return self._unit_vectors(previous, np.ones(COLOUR_CHANNELS)), self._unit_vectors(current, gain)

    def relit(
        self, previous: NDArray[np.float16], current: NDArray[np.float16], warp: PatchWarp
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """F0 and F1 with light, white balance and saturation of the pair taken out.

        A Lab channel in which the pair still differs after that counts less.
        """
        colour0, colour1 = (
            stored[..., :COLOUR_CHANNELS].astype(np.float32) for stored in (previous, current)
        )
        lab0 = self._weighted_lab(colour0)
        lab1 = self._weighted_lab(transferred_colours(colour0, colour1, warp))
        difference = np.abs(warped(lab0, warp) - lab1)[warp.is_visible]
        if len(difference):
            spread = _SPREAD_OF_MEDIAN * np.median(difference, axis=0)
            certainty = 1 / np.sqrt(1 + (spread / self._settings.colour_sigma_lab) ** 2)
            lab0, lab1 = lab0 * certainty, lab1 * certainty
        return self._lifted(lab0, previous), self._lifted(lab1, current)

    def _unit_vectors(self, stored: NDArray[np.float16], gain: NDArray[np.float64]) -> NDArray[np.float32]:
        patches = stored.reshape(-1, 1, stored.shape[-1])
        colours = patches[..., :COLOUR_CHANNELS].astype(np.float32) * gain.astype(np.float32)
        return self._lifted(self._weighted_lab(colours), patches)

    def _weighted_lab(self, bgr: NDArray[np.float32]) -> NDArray[np.float32]:
        """(h, w, 3) Lab of colours in 0..255, lightness by its weight."""
        lab = cv2.cvtColor(np.clip(bgr / 255.0, 0, 1).astype(np.float32), cv2.COLOR_BGR2Lab)
        return np.asarray(lab * np.array([self._settings.lightness_weight, 1, 1], np.float32))

    def _lifted(self, weighted_lab: NDArray[np.float32], stored: NDArray[np.float16]) -> NDArray[np.float32]:
        """(N, 168) of (h, w, 3) colours and the histograms of the stored patches that they belong to."""
        lab = weighted_lab.reshape(-1, COLOUR_CHANNELS)
        phase = (lab / np.float32(self._settings.colour_sigma_lab)) @ self._frequencies
        lifted = np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
        lifted /= np.sqrt(np.float32(self._settings.random_features))
        share = np.float32(self._settings.colour_weight)
        histogram = stored.reshape(-1, stored.shape[-1])[:, COLOUR_CHANNELS:].astype(np.float32)
        unit = np.concatenate([np.sqrt(share) * lifted, np.sqrt(1 - share) * histogram], axis=1)
        return np.asarray(unit, np.float32)


def log_gain(
    colour0: NDArray[np.float32], colour1: NDArray[np.float32], warp: PatchWarp
) -> NDArray[np.float64]:
    """Per-channel log gain that brings the current image's light to the previous one's, (3,).

    Robust mean (iteratively re-weighted, Geman-McClure-like weights shared by the channels) over patches
    that see the same place; zeros when too few do.

    Args:
        colour0, colour1: (H_f, W_f, 3) mean patch colours, 0..255.
        warp: where the patches of ``colour1`` lie in ``colour0``.
    """
    expected, observed, usable = shared_colours(colour0, colour1, warp)
    if usable.sum() < MIN_SHARED_PATCHES:
        return np.zeros(3)
    difference = np.log(expected[usable]).astype(np.float64) - np.log(observed[usable])
    weights = np.ones(len(difference))
    gain = np.zeros(3)
    for _ in range(_GAIN_ROUNDS):
        gain = weights @ difference / weights.sum()
        residual = np.linalg.norm(difference - gain, axis=1)
        scale = max(1.48 * float(np.median(residual)), _GAIN_FLOOR)
        weights = 1.0 / (1.0 + (residual / scale) ** 2) ** 2
    return gain


def _gradient_histograms(grey: NDArray[np.uint8], grid: tuple[int, int]) -> NDArray[np.float32]:
    """(H_f, W_f, 72): 3x3 cells of 8 signed orientations around each patch centre, root-normalised."""
    half = cv2.resize(grey.astype(np.float32) / 255.0, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    dx = cv2.Sobel(half, cv2.CV_32F, 1, 0, ksize=3)
    dy = cv2.Sobel(half, cv2.CV_32F, 0, 1, ksize=3)
    magnitude, angle = cv2.cartToPolar(dx, dy)
    bins = angle * np.float32(ORIENTATIONS / (2 * np.pi))
    rows, columns = grid
    centre_x = (np.arange(columns) + 0.5) / columns * half.shape[1] - 0.5
    centre_y = (np.arange(rows) + 0.5) / rows * half.shape[0] - 0.5
    offsets = (-1, 0, 1)
    out = np.empty((rows, columns, len(offsets) ** 2, ORIENTATIONS), np.float32)
    for orientation in range(ORIENTATIONS):
        # Linear interpolation between neighbouring orientations, wrapping around the circle.
        away = np.abs(bins - orientation)
        weight = np.maximum(0, 1 - np.minimum(away, ORIENTATIONS - away))
        channel = cv2.GaussianBlur(magnitude * weight, (0, 0), CELL_BLUR_PX)
        for cell, (dy_cell, dx_cell) in enumerate((y, x) for y in offsets for x in offsets):
            fall_off = np.exp(-(dx_cell**2 + dy_cell**2) / CENTRE_WEIGHT_SPREAD)
            x = np.broadcast_to((centre_x + dx_cell * CELL_PX).astype(np.float32), (rows, columns))
            y = np.broadcast_to((centre_y + dy_cell * CELL_PX).astype(np.float32)[:, None], (rows, columns))
            out[:, :, cell, orientation] = fall_off * cv2.remap(
                channel,
                np.ascontiguousarray(x),
                np.ascontiguousarray(y),
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )
    flat = out.reshape(rows, columns, -1)
    flat = np.sqrt(flat / (np.linalg.norm(flat, axis=-1, keepdims=True) + CONTRAST_FLOOR))
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    # A patch without any gradient (plain or overexposed) has no preferred orientation; a zero vector would
    # make an unchanged white wall look changed.
    even = np.float32(1 / np.sqrt(flat.shape[-1]))
    return np.where(length > 1e-6, flat / np.maximum(length, 1e-6), even)


def _random_frequencies(count: int) -> NDArray[np.float32]:
    """(3, count) orthogonal random frequencies of a Gaussian kernel of unit width; fixed seed."""
    generator = np.random.default_rng(0)
    blocks = []
    for _ in range(-(-count // 3)):
        rotation, _ = np.linalg.qr(generator.normal(size=(3, 3)))
        blocks.append(rotation * np.sqrt(generator.chisquare(3, 3)))
    return np.concatenate(blocks, axis=1)[:, :count].astype(np.float32)
