"""Procedural texture tiles: seamless noise, wood, masonry, cloth, print; all drawn from the generator given.

Every function returns an (S, S, 3) uint8 sRGB tile. Colours are RGB triples in [0, 255].
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, rfft2

Tile = NDArray[np.uint8]
Colour = Sequence[float] | NDArray[np.float64]
FloatMap = NDArray[np.float32]


def noise(rng: np.random.Generator, size: int, slope: float = 1.2, stretch: float = 1.0) -> FloatMap:
    """Seamless fractal noise, (size, size), zero mean and unit deviation.

    Args:
        rng: source of randomness.
        size: texels along an edge.
        slope: amplitude falls with frequency to this power; 0 = white.
        stretch: grain: features are this many times longer along the rows.
    """
    white = rng.standard_normal((size, size), dtype=np.float32)
    field = irfft2(rfft2(white) * _falloff(size, slope, stretch), s=(size, size))
    return (field / max(float(field.std()), 1e-9)).astype(np.float32)


@lru_cache(maxsize=64)
def _falloff(size: int, slope: float, stretch: float) -> FloatMap:
    """Amplitude of each frequency of a real FFT, (size, size // 2 + 1); zero for the mean."""
    frequency_y = np.fft.fftfreq(size)[:, None] * size
    frequency_x = np.fft.rfftfreq(size)[None, :] * size * stretch
    radius = np.hypot(frequency_y, frequency_x)
    radius[0, 0] = np.inf
    return (radius**-slope).astype(np.float32)


def mottled(
    rng: np.random.Generator, colour: Colour, contrast: float = 0.1, slope: float = 1.1, size: int = 256
) -> Tile:
    """Paint, plastic or plaster: a colour with fractal shading and fine grain."""
    shade = noise(rng, size, slope) * contrast + noise(rng, size, 0.2) * contrast * 0.35
    return shaded(colour, shade)


def shaded(colour: Colour, shade: FloatMap) -> Tile:
    """A colour times (1 + shade), with a slight drift of hue."""
    base = np.asarray(colour, dtype=np.float32)
    drift = np.stack([shade * 1.08, shade, shade * 0.9], axis=-1)
    return np.clip(base * (1 + drift), 0, 255).astype(np.uint8)


def wood(rng: np.random.Generator, colour: Colour, planks: int = 3, size: int = 256) -> Tile:
    """Planks along the rows with grain, growth rings and a few knots."""
    tile = np.empty((size, size, 3), dtype=np.float32)
    edges = np.linspace(0, size, planks + 1).astype(int)
    grain = noise(rng, size, 1.0, stretch=9.0)
    rings = noise(rng, size, 1.7, stretch=4.0)
    for low, high in pairwise(edges):
        shift = int(rng.integers(size))
        rows = np.roll(rings, shift, axis=1)[low:high]
        shade = 0.09 * np.sin(rows * rng.uniform(5, 9)) + 0.12 * np.roll(grain, shift, axis=1)[low:high]
        tile[low:high] = shaded(np.asarray(colour) * rng.uniform(0.82, 1.15), shade)
        for _ in range(rng.integers(0, 3)):
            centre = (int(rng.integers(8, size - 8)), int(rng.integers(high - low)) + low)
            cv2.ellipse(tile, centre, (7, 4), 0, 0, 360, [float(c) * 0.55 for c in colour], -1, cv2.LINE_AA)
        if planks > 1:
            tile[low : low + 2] *= 0.5
    return tile.astype(np.uint8)


def masonry(
    rng: np.random.Generator, colour: Colour, mortar: Colour, rows: int = 8, columns: int = 4, size: int = 256
) -> Tile:
    """Bricks or paving in running bond, each stone of its own shade."""
    tile = np.asarray(mottled(rng, mortar, 0.12, 0.6, size), dtype=np.float32)
    grain = noise(rng, size, 0.8) * 0.09
    joint = max(1, size // (rows * 14))
    ys = np.linspace(0, size, rows + 1).astype(int)
    for row in range(rows):
        shift = (row % 2) * size // (2 * columns)
        xs = np.linspace(0, size, columns + 1).astype(int)
        for column in range(columns):
            stone = np.asarray(colour, dtype=np.float32) * rng.normal(1.0, 0.13) * rng.normal(1, 0.015, 3)
            at = (np.arange(xs[column] + joint, xs[column + 1]) + shift) % size
            block = slice(ys[row] + joint, ys[row + 1])
            tile[block, at] = stone * (1 + grain[block][:, at])[..., None]
    return np.clip(tile, 0, 255).astype(np.uint8)


def speckled(rng: np.random.Generator, colour: Colour, contrast: float = 0.25, size: int = 512) -> Tile:
    """Asphalt, terrazzo or concrete: grains, stains, and cracks or patches."""
    shade = noise(rng, size, 0.45) * contrast * 0.5 + noise(rng, size, 1.6) * contrast * 0.35
    tile = shaded(colour, shade)
    for _ in range(int(rng.integers(2, 6))):
        walk = np.cumsum(rng.normal(0, 9, (14, 2)), axis=0) + rng.uniform(0, size, 2)
        factor = rng.uniform(0.5, 0.75)
        tone = [float(c) * factor for c in colour]
        cv2.polylines(tile, [walk.astype(np.int32)], False, tone, int(rng.integers(1, 3)), cv2.LINE_AA)
    for _ in range(int(rng.integers(3, 9))):
        factor = rng.uniform(0.65, 1.2)
        blot(rng, tile, [float(c) * factor for c in colour])
    return tile


def blot(rng: np.random.Generator, tile: Tile, colour: Sequence[float]) -> None:
    """Paint a translucent irregular spot into the tile, in place."""
    size = tile.shape[0]
    angles = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    radii = rng.uniform(0.4, 1.0, 14) * rng.uniform(0.02, 0.09) * size
    outline = np.stack([np.cos(angles), np.sin(angles)], 1) * radii[:, None] + rng.uniform(0, size, 2)
    layer = tile.copy()
    cv2.fillPoly(layer, [outline.astype(np.int32)], [float(c) for c in colour], cv2.LINE_AA)
    cv2.addWeighted(layer, 0.6, tile, 0.4, 0, dst=tile)


def carpet(rng: np.random.Generator, colour: Colour, cells: int = 4, size: int = 512) -> Tile:
    """Carpet squares of changing pile direction with flecks."""
    tile = np.empty((size, size, 3), dtype=np.uint8)
    step = size // cells
    along, across = noise(rng, size, 0.35, 5.0), noise(rng, size, 0.35, 5.0).T
    for row in range(cells):
        for column in range(cells):
            block = np.s_[row * step : (row + 1) * step, column * step : (column + 1) * step]
            pile = along if (row + column) % 2 else across
            tile[block] = shaded(np.asarray(colour) * rng.normal(1, 0.09), pile[block] * 0.13)
    flecks = rng.integers(0, size, (size * 3, 2))
    tones = np.clip(np.asarray(colour) * rng.uniform(0.4, 1.9, (len(flecks), 3)), 0, 255)
    tile[flecks[:, 0], flecks[:, 1]] = tones
    return tile


def cloth(rng: np.random.Generator, colours: Sequence[Colour], bands: int = 8, size: int = 256) -> Tile:
    """Striped or plain woven cloth; ``bands`` = 0 is plain."""
    weave = noise(rng, size, 0.3) * 0.06 + noise(rng, size, 1.5) * 0.07
    tile = shaded(colours[0], weave)
    if bands:
        stripe = (np.arange(size) * bands // size) % len(colours)
        for index, colour in enumerate(colours):
            chosen = stripe == index
            tile[:, chosen] = shaded(colour, weave)[:, chosen]
    return tile


def leaves(rng: np.random.Generator, colour: Colour, size: int = 256) -> Tile:
    """Foliage: overlapping bright and dark leaves."""
    tile = shaded(np.asarray(colour) * 0.55, noise(rng, size, 0.9) * 0.2)
    for _ in range(420):
        tone = np.clip(np.asarray(colour) * rng.uniform(0.55, 1.5) * rng.normal(1, 0.08, 3), 0, 255)
        axes = (int(rng.integers(5, 12)), int(rng.integers(2, 5)))
        centre = tuple(int(v) for v in rng.integers(0, size, 2))
        cv2.ellipse(tile, centre, axes, float(rng.uniform(0, 180)), 0, 360, tone.tolist(), -1, cv2.LINE_AA)
    return tile
