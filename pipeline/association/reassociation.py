"""Global re-association: an object first thought gone is found again elsewhere (paper, Fig. 2).

The two places of a moved object need not be in one view, so that no co-visible pair compares them. Here
the tokens of all unresolved objects of both visits are matched against each other at once, and the same
two scores and gates decide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.association.aggregation import MatchEvidence
from pipeline.association.assignment import associate
from pipeline.association.tokens import ObjectTokens
from pipeline.correspondence.matching import match
from pipeline.perception.protocols import FeatureExtractor
from pipeline.settings import AssociationSettings


@dataclass(frozen=True)
class FoundAgain:
    """A previous and a current object that are one.

    Attributes:
        previous, current: instances, counted from 1.
        sigma: mean of the match proportions from both sides; s_bar: mean confidence of the matches.
    """

    previous: int
    current: int
    sigma: float
    s_bar: float


def find_again(
    previous: Sequence[int],
    current: Sequence[int],
    previous_tokens: ObjectTokens,
    current_tokens: ObjectTokens,
    sizes_m: tuple[NDArray[np.floating], NDArray[np.floating]],
    extractor: FeatureExtractor,
    light: NDArray[np.float64] | None,
    settings: AssociationSettings,
    max_size_ratio: float,
) -> list[FoundAgain]:
    """One-to-one pairs among unresolved objects.

    Args:
        previous, current: unresolved instances of either visit, counted from 1.
        previous_tokens, current_tokens: their patches.
        sizes_m: (n, 2), (m, 2) diameter and height of the candidates, metres; order of the sequences.
        extractor: compares tokens.
        light: lighting difference of the visits.
        settings: the gates.
        max_size_ratio: objects whose sizes differ by more are not one.
    """
    tokens0 = [previous_tokens.of(instance) for instance in previous]
    tokens1 = [current_tokens.of(instance) for instance in current]
    owner0 = np.repeat(np.arange(1, len(previous) + 1), [len(t) for t in tokens0])
    owner1 = np.repeat(np.arange(1, len(current) + 1), [len(t) for t in tokens1])
    if not len(owner0) or not len(owner1):
        return []
    features0, features1 = extractor.comparable(
        np.concatenate([t for t in tokens0 if len(t)]), np.concatenate([t for t in tokens1 if len(t)]), light
    )
    matches = match(features0, features1)
    p, q, score = matches.correspondences()
    evidence = MatchEvidence.empty(len(previous), len(current))
    evidence.add(owner0[p], owner1[q], score)
    # From one side alone a large object swallows the matches of everything that resembles a part of it.
    sigma = (evidence.sigma + evidence.sigma_backward) / 2
    ratio = np.abs(np.log(sizes_m[0][:, None] / sizes_m[1][None]))
    sigma = np.where((ratio <= np.log(max_size_ratio)).all(axis=2), sigma, 0)
    pairs = associate(sigma, evidence.s_bar, settings.tau_sigma, settings.tau_s)
    return [
        FoundAgain(
            previous[row], current[column], float(sigma[row, column]), float(evidence.s_bar[row, column])
        )
        for row, column in pairs
    ]
