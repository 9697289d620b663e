"""Is the object still where it was? A log-odds score from geometry and appearance at its place.

The paper labels whatever finds no partner as changed (Eq. 8). With hand-made features and masks many
unchanged pieces of furniture find none, so that here the place itself has to speak: it was seen to be
empty, or something that looks different stands there.

How different unchanged things look depends on the place: on its light, its textures, the error of its
poses. So appearance is judged against the other objects of the same two visits, most of which stayed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.change.evidence import ObjectEvidence
from pipeline.settings import ChangeSettings

# Objects that stand for "unchanged" when a place is judged by the others: not seen through, well compared.
_REFERENCE_SEEN_THROUGH = 0.3
_REFERENCE_VOXELS = 30
# As many made-up objects as this keep visits of few objects from being judged by themselves alone.
_PRIOR_OBJECTS = 10
# An object of this many compared voxels counts half.
_RELIABLE_VOXELS = 150
# Colours may speak for a change this many spreads further than patches do.
PATCH_ALLOWANCE = 1.0
_CLIP_LOW, _CLIP_HIGH = -3.0, 8.0
_TAIL_FLOOR = 0.02
_FULL_TEXTURE = 0.1
# Median and robust spread of unchanged objects over the development scenes.
_DISSIMILARITY = (-2.1, 0.7)
_RESIDUAL = (0.16, 0.09)
_TEXTURE_LOSS = (-1.4, 0.45)
_TAIL = (-3.4, 0.55)
_PATTERN = (-1.1, 0.3)
# An object of this many pattern pixels counts half.
_RELIABLE_PIXELS = 60


def change_log_odds(
    evidence: ObjectEvidence, appearance_scale: float, settings: ChangeSettings
) -> NDArray[np.float64]:
    """(K + 1,) log odds that an object is not at its place in the other visit; > 0 = changed.

    Colours are compared voxel by voxel, where a pose error of a centimetre makes any printed surface look
    changed; patches are compared within a window, which forgives it. So colours count only as far as the
    patches look unlike as well, and not at all where the two visits' colours hardly agree anywhere: there
    only what was seen to be empty has changed.

    Args:
        appearance_scale: spread of the colour residual between the visits, log units.
    """
    seen_through, patches, residual, texture, tail, pattern, here, elsewhere = change_features(evidence).T
    return (
        settings.bias
        + settings.seen_through_weight * seen_through
        + appearance_trust(appearance_scale, settings)
        * (
            settings.dissimilarity_weight * patches
            + settings.residual_weight * residual
            + settings.texture_weight * texture
            + settings.tail_weight * tail
        )
        + settings.pattern_weight * pattern
        + settings.print_here_weight * here
        + settings.print_elsewhere_weight * elsewhere
    )


def change_features(evidence: ObjectEvidence) -> NDArray[np.float64]:
    """(K + 1, 8) what the weights apply to.

    Seen-through share, and in spreads from the unchanged objects: patch dissimilarity, colour residual, lost
    texture correlation, share of unexplained colours, lost fine pattern. Then the logarithms of the places
    of its print that were found again, here and elsewhere.
    """
    patches = _relative(
        evidence, np.nan_to_num(evidence.dissimilarity), _DISSIMILARITY, np.isfinite(evidence.dissimilarity)
    )
    residual = _relative(evidence, evidence.median_residual, _RESIDUAL)
    texture = _relative(evidence, _texture_loss(evidence), _TEXTURE_LOSS) * _textured(evidence)
    tail = _relative(evidence, np.log(evidence.tail_share + _TAIL_FLOOR), _TAIL)
    shown = evidence.pattern_pixels / (evidence.pattern_pixels + _RELIABLE_PIXELS)
    pattern = (
        _relative(evidence, _pattern_loss(evidence), _PATTERN, evidence.pattern_pixels > 0, may_widen=False)
        * shown
    )
    aligned = np.maximum(patches, pattern) + PATCH_ALLOWANCE
    colours = np.minimum(np.stack([residual, texture, tail], axis=1), aligned[:, None])
    # An object of few compared voxels scatters: it counts less.
    weight = evidence.compared_count / (evidence.compared_count + _RELIABLE_VOXELS)
    appearance = np.concatenate([patches[:, None], colours], axis=1) * weight[:, None]
    prints = np.log1p(np.stack([evidence.print_here, evidence.print_elsewhere], axis=1))
    return np.concatenate([evidence.seen_through[:, None], appearance, pattern[:, None], prints], axis=1)


def appearance_trust(appearance_scale: float, settings: ChangeSettings) -> float:
    """How far appearance may speak, in [0, 1], by the colour residual's spread between the visits."""
    full, none = settings.full_appearance_scale, settings.no_appearance_scale
    return float(np.clip((none - appearance_scale) / max(none - full, 1e-9), 0.0, 1.0))


def appearance_change(evidence: ObjectEvidence) -> NDArray[np.float64]:
    """(K + 1,) how differently the place looks, in [0, 1], for people; NaN where it was not compared."""
    texture = np.clip(1.0 - evidence.texture_correlation, 0, 1) * _textured(evidence)
    change = np.maximum(evidence.tail_share, np.maximum(texture, 1 - np.exp(-evidence.median_residual)))
    return np.where(evidence.compared_count > 0, np.clip(change, 0, 1), np.nan)


def _texture_loss(evidence: ObjectEvidence) -> NDArray[np.float64]:
    # Fisher's transform: a correlation of 0.95 instead of 0.99 says as much as 0.4 instead of 0.8.
    return -np.arctanh(np.clip(evidence.texture_correlation, -0.9, 0.99))


def _pattern_loss(evidence: ObjectEvidence) -> NDArray[np.float64]:
    return -np.arctanh(np.clip(np.nan_to_num(evidence.pattern_correlation), -0.9, 0.99))


def _textured(evidence: ObjectEvidence) -> NDArray[np.float64]:
    """How much the texture may count: nothing on plain surfaces, all on printed ones."""
    return np.clip(evidence.texture / _FULL_TEXTURE, 0, 1)


def _relative(
    evidence: ObjectEvidence,
    values: NDArray[np.float64],
    prior: tuple[float, float],
    is_known: NDArray[np.bool_] | None = None,
    *,
    may_widen: bool = True,
) -> NDArray[np.float64]:
    """Values in spreads from the middle of these visits' objects, most of which are unchanged.

    Args:
        prior: median to start from, and spread.
        is_known: where a value exists; elsewhere the outcome is 0 (no evidence).
        may_widen: objects of noisier visits than those of development scatter more: take their spread.
    """
    known = evidence.compared_count > 0 if is_known is None else is_known & (evidence.compared_count > 0)
    reference = known & (evidence.seen_through < _REFERENCE_SEEN_THROUGH)
    reference &= evidence.compared_count >= _REFERENCE_VOXELS
    reference[:1] = False
    centre, spread = prior
    count = int(reference.sum())
    if count:
        own = float(np.median(values[reference]))
        # Where many objects changed, the upper side of the values is theirs.
        below = own - values[reference & (values <= own)]
        share = count / (count + _PRIOR_OBJECTS)
        centre = share * own + (1 - share) * centre
        if may_widen:
            spread = max(spread, share * 1.48 * float(np.median(below)) + (1 - share) * spread)
    return np.where(known, np.clip((values - centre) / spread, _CLIP_LOW, _CLIP_HIGH), 0.0)
