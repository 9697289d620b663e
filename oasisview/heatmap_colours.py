"""Colours of the two heatmaps, with their legends: cividis for semantic, purple to orange for geometric.

Both stay readable for every kind of colour vision. What was not seen by both visits is hatched, never
coloured, so that "no data" cannot be taken for "no change".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Anchors of matplotlib's cividis (CC0) and of ColorBrewer's PuOr, reversed, low to high.
CIVIDIS: tuple[str, ...] = (
    *("#00224e", "#123570", "#3b496c", "#575d6d", "#707173"),
    *("#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838"),
)
PURPLE_ORANGE_LIGHT: tuple[str, ...] = (
    *("#542788", "#8073ac", "#b2abd2", "#d8daeb", "#f7f7f7"),
    *("#fee0b6", "#fdb863", "#e08214", "#b35806"),
)
# The white centre of PuOr glares on a dark page: same hues, dark centre.
PURPLE_ORANGE_DARK: tuple[str, ...] = (
    *("#c9baff", "#9b83ea", "#6a52b8", "#3d3470", "#20222a"),
    *("#6b3a10", "#b5661a", "#ec9a3c", "#ffd39a"),
)

# Scores of matches crowd near 1: colours start where no match would be believed.
LOWEST_LINK_SCORE = 0.5
# Depth differences beyond this are drawn in the last colour.
GEOMETRIC_RANGE_M = 0.3


def rgb(colour: str) -> tuple[int, int, int]:
    """``#rrggbb`` as three numbers in 0..255."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def ramp(anchors: tuple[str, ...], steps: int = 256) -> NDArray[np.uint8]:
    """A table of (steps, 3) RGB through evenly spaced anchor colours."""
    table = np.array([rgb(anchor) for anchor in anchors], np.float64)
    at = np.linspace(0, len(anchors) - 1, steps)
    channels = [np.interp(at, np.arange(len(anchors)), table[:, channel]) for channel in range(3)]
    return np.round(np.stack(channels, axis=1)).astype(np.uint8)


_SEMANTIC = ramp(CIVIDIS)
_GEOMETRIC = {False: ramp(PURPLE_ORANGE_LIGHT), True: ramp(PURPLE_ORANGE_DARK)}


def gradient_css(anchors: tuple[str, ...]) -> str:
    """A colour bar of the anchors, for CSS ``background``."""
    return f"linear-gradient(90deg,{','.join(anchors)})"


def geometric_anchors(*, dark: bool) -> tuple[str, ...]:
    """The geometric heatmap's colours on a light or dark page."""
    return PURPLE_ORANGE_DARK if dark else PURPLE_ORANGE_LIGHT


def share_colour(value: float) -> tuple[str, str]:
    """Ground and text colour (CSS) of a cell that shows a share in [0, 1]."""
    red, green, blue = (int(c) for c in _SEMANTIC[round(255 * float(np.clip(np.nan_to_num(value), 0, 1)))])
    luminance = 0.299 * red + 0.587 * green + 0.114 * blue
    return f"#{red:02x}{green:02x}{blue:02x}", "#101216" if luminance > 120 else "#ffffff"


def link_colour(score: float) -> str:
    """Colour (CSS) of a patch match: dark where no match would be believed, bright where it is sure."""
    return share_colour((score - LOWEST_LINK_SCORE) / (1 - LOWEST_LINK_SCORE))[0]


def colour_semantic(heatmap: NDArray[np.floating], height: int, width: int) -> NDArray[np.uint8]:
    """A semantic heatmap as an image.

    Args:
        heatmap: (H_f, W_f) in [0, 1], NaN = not co-visible.
        height, width: size of the image.

    Returns:
        (height, width, 3) RGB; values are interpolated, NaN areas keep their patch edges.
    """
    unseen = _enlarged(np.isnan(heatmap), height, width)
    smooth = _interpolated(np.nan_to_num(heatmap), height, width)
    image = _SEMANTIC[np.round(np.clip(smooth, 0, 1) * 255).astype(np.uint8)]
    return _hatch(image, unseen, dark=True)


def colour_geometric(
    heatmap_m: NDArray[np.floating],
    height: int,
    width: int,
    *,
    dark: bool,
    range_m: float = GEOMETRIC_RANGE_M,
) -> NDArray[np.uint8]:
    """A geometric heatmap (signed metres, NaN = not co-visible) as a (height, width, 3) RGB image."""
    values = _enlarged(heatmap_m, height, width)
    unseen = np.isnan(values)
    scaled = np.clip(np.nan_to_num(values) / range_m / 2 + 0.5, 0, 1)
    image = _GEOMETRIC[dark][np.round(scaled * 255).astype(np.uint8)]
    return _hatch(image, unseen, dark=dark)


def _enlarged(array: NDArray, height: int, width: int) -> NDArray:
    rows = np.arange(height) * array.shape[0] // height
    columns = np.arange(width) * array.shape[1] // width
    return array[rows[:, None], columns[None, :]]


def _interpolated(array: NDArray[np.floating], height: int, width: int) -> NDArray[np.float64]:
    def blend(length: int, size: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        at = np.clip((np.arange(length) + 0.5) * size / length - 0.5, 0, size - 1)
        low = np.floor(at).astype(np.int64)
        return low, np.minimum(low + 1, size - 1), at - low

    top, bottom, down = blend(height, array.shape[0])
    left, right, across = blend(width, array.shape[1])
    rows = array[top] * (1 - down)[:, None] + array[bottom] * down[:, None]
    return rows[:, left] * (1 - across) + rows[:, right] * across


def hatched(image: NDArray[np.uint8], unseen: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """An (H, W, 3) picture with what is unknown (H, W) hatched as in the heatmaps."""
    return _hatch(image, unseen, dark=True)


def _hatch(image: NDArray[np.uint8], unseen: NDArray[np.bool_], *, dark: bool) -> NDArray[np.uint8]:
    rows, columns = np.indices(unseen.shape)
    stripe = ((rows + columns) // 5) % 2 == 0
    ground, line = (44, 70) if dark else (205, 228)
    image = image.copy()
    image[unseen & stripe] = line
    image[unseen & ~stripe] = ground
    return image
