"""How well a change heatmap ranks changed patches above unchanged ones: AUC, plain and of like texture.

Boxes around changed objects hold textured things while most of the rest is bare floor and wall, so texture
alone, with no comparison, already ranks well. The second figure removes that: patches are parted at the
deciles of the texture of the *changed* patches, the AUC is taken within each part, and the parts are
averaged by their number of changed patches.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

TEXTURE_PARTS = 10
_GRADIENT_APERTURE = 3
_TEXTURE_SIGMA_PATCHES = 1.0


def auc(scores: NDArray[np.floating], changed: NDArray[np.bool_]) -> float | None:
    """Chance that a changed patch scores above an unchanged one, ties half; None without both kinds."""
    positives = int(np.count_nonzero(changed))
    negatives = len(changed) - positives
    if positives == 0 or negatives == 0:
        return None
    rank_sum = float(rankdata(scores)[changed].sum())
    return (rank_sum - positives * (positives + 1) / 2) / (positives * negatives)


def like_texture_auc(
    scores: NDArray[np.floating],
    changed: NDArray[np.bool_],
    texture: NDArray[np.floating],
    parts: int = TEXTURE_PARTS,
) -> float | None:
    """AUC among patches of like texture; None where no part holds changed and unchanged patches.

    Args:
        scores, changed, texture: (N,) of each patch; see :func:`patch_texture`.
        parts: how many parts of equally many changed patches.
    """
    if not changed.any():
        return None
    borders = np.quantile(texture[changed], np.linspace(0, 1, parts + 1)[1:-1])
    part = np.digitize(texture, borders)
    total, weight = 0.0, 0
    for number in range(parts):
        here = part == number
        value = auc(scores[here], changed[here])
        if value is not None:
            count = int(np.count_nonzero(changed[here]))
            total += value * count
            weight += count
    return total / weight if weight else None


def patch_texture(rgb: NDArray[np.uint8], grid_shape: tuple[int, int]) -> NDArray[np.float32]:
    """Mean gradient magnitude of the grey image in every patch, smoothed over neighbouring patches.

    Args:
        rgb: (H, W, 3).
        grid_shape: (H_f, W_f) patches.

    Returns:
        (H_f, W_f) float32.
    """
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
    magnitude = cv2.magnitude(
        cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=_GRADIENT_APERTURE),
        cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=_GRADIENT_APERTURE),
    )
    means = cv2.resize(magnitude, grid_shape[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(means, (0, 0), _TEXTURE_SIGMA_PATCHES), dtype=np.float32)


def patches_in_boxes(
    boxes_px: Sequence[Sequence[float]], grid_shape: tuple[int, int], image_size: tuple[int, int]
) -> NDArray[np.bool_]:
    """(H_f, W_f) patches whose centre lies in a box.

    Args:
        boxes_px: (x0, y0, x1, y1) each, pixels of the image.
        grid_shape: (H_f, W_f) patches.
        image_size: (width, height) pixels.
    """
    rows, columns = grid_shape
    x = (np.arange(columns) + 0.5) / columns * image_size[0]
    y = (np.arange(rows) + 0.5) / rows * image_size[1]
    inside = np.zeros(grid_shape, dtype=bool)
    for x0, y0, x1, y1 in boxes_px:
        inside |= ((y >= y0) & (y < y1))[:, None] & ((x >= x0) & (x < x1))[None, :]
    return inside
