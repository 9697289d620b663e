"""Is the object still where it was? A log-odds score from geometry and appearance at its place.

The paper labels whatever finds no partner as changed (Eq. 8). With hand-made features and masks many
unchanged pieces of furniture find none, so that here the place itself has to speak: it was seen to be
empty, or something that looks different stands there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.change.evidence import ObjectEvidence
from pipeline.settings import ChangeSettings

_MAX_MEDIAN_RESIDUAL = 1.2


def change_log_odds(
    evidence: ObjectEvidence, appearance_scale: float, settings: ChangeSettings
) -> NDArray[np.float64]:
    """(K + 1,) log odds that an object is not at its place in the other visit; > 0 = changed.

    Args:
        appearance_scale: spread of the colour residual of the pair of visits; where appearance is noisy
            it counts less.
    """
    trust = min(1.0, settings.reliable_appearance_scale / max(appearance_scale, 1e-9))
    compared = np.minimum(1.0, evidence.compared_count / settings.min_compared_voxels)
    # A single voxel that happens to be comparable must not decide about an object.
    compared = np.where(evidence.compared_count >= settings.min_compared_voxels, compared, 0.0)
    median = np.minimum(evidence.median_residual, _MAX_MEDIAN_RESIDUAL)
    texture = (1.0 - evidence.texture_correlation) * evidence.texture_weight
    return (
        settings.bias
        + settings.seen_through_weight * evidence.seen_through
        + compared
        * (
            settings.residual_weight * trust * median
            + settings.tail_weight * evidence.tail_share
            + settings.texture_weight * trust * texture
        )
    )


def appearance_change(evidence: ObjectEvidence) -> NDArray[np.float64]:
    """(K + 1,) how differently the place looks, in [0, 1], for people; NaN where it was not compared."""
    texture = np.clip(1.0 - evidence.texture_correlation, 0, 1) * evidence.texture_weight
    change = np.maximum(evidence.tail_share, np.maximum(texture, 1 - np.exp(-evidence.median_residual)))
    return np.where(evidence.compared_count > 0, np.clip(change, 0, 1), np.nan)
