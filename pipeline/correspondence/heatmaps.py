"""2D change heatmaps of a keyframe: how different it looks and how different its shape is (paper, Fig. 3)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.perception.protocols import SimilarityScale

# The quietest quarter tells a keyframe's noise: rarely more than three quarters of what it sees is changed,
# and where it is, the limit keeps the change visible.
_QUIET_SHARE = 0.25
_MOST_NOISE = 2.0


def change_of_similarity(correlation: NDArray[np.floating], scale: SimilarityScale) -> NDArray[np.float64]:
    """Log odds of a change from a correlation, on the descriptor's own scale; NaN stays NaN."""
    return np.clip((scale.threshold - np.asarray(correlation, np.float64)) / scale.softness, -30, 30)


def without_noise(best_correlation: NDArray[np.float32], noise: float) -> NDArray[np.float32]:
    """Correlations of a keyframe, what they lack of one divided by how noisy the keyframe is.

    Exposure, blur and haze differ from keyframe to keyframe and make all of it look less alike.

    Args:
        best_correlation: (H_f, W_f), NaN = not co-visible.
        noise: what is usual, see ``SimilarityScale``; 0 = leave the correlations as they are.
    """
    lacking = 1 - best_correlation
    seen = lacking[np.isfinite(lacking)]
    if noise <= 0 or not len(seen):
        return best_correlation
    factor = np.clip(float(np.quantile(seen, _QUIET_SHARE)) / noise, 1.0, _MOST_NOISE)
    return (1 - lacking / np.float32(factor)).astype(np.float32)


def semantic_heatmap(
    best_correlation: NDArray[np.float32], scale: SimilarityScale, sigma_patches: float
) -> NDArray[np.float32]:
    """Change in [0, 1] from the best correlation of each patch.

    Args:
        best_correlation: (H_f, W_f), NaN = not co-visible.
        scale: how the descriptor's correlation reads; 0.5 lies at its threshold in a keyframe of usual noise.
        sigma_patches: Gaussian smoothing over co-visible patches.

    Returns:
        (H_f, W_f) float32, 1 = changed, NaN = not co-visible.
    """
    visible = np.isfinite(best_correlation)
    weight = visible.astype(np.float32)
    score = np.where(visible, without_noise(best_correlation, scale.noise), 0).astype(np.float32)
    if sigma_patches > 0:
        score = cv2.GaussianBlur(score, (0, 0), sigma_patches)
        weight = cv2.GaussianBlur(weight, (0, 0), sigma_patches)
    smoothed = score / np.maximum(weight, 1e-6)
    change = 1.0 / (1.0 + np.exp(-change_of_similarity(smoothed, scale)))
    return np.where(visible, change, np.nan).astype(np.float32)


def geometric_heatmap(
    own_depth: NDArray[np.float32],
    other_depth: NDArray[np.float32],
    own_is_current: bool,
) -> NDArray[np.float32]:
    """Signed depth difference against the other visit's surface seen from the same pose.

    Positive where the current visit has something nearer than the previous one (newly appeared
    foreground), negative where something nearer is gone; the same sign in the images of both visits.

    Args:
        own_depth: (h, w) metres measured by the keyframe, 0 = none.
        other_depth: (h, w) metres to the other visit's surface, 0 = none.
        own_is_current: whether the keyframe belongs to the current visit.

    Returns:
        (h, w) float32 metres, NaN = one of the two is unknown.
    """
    known = (own_depth > 0) & (other_depth > 0)
    difference = other_depth - own_depth if own_is_current else own_depth - other_depth
    return np.where(known, difference, np.nan).astype(np.float32)
