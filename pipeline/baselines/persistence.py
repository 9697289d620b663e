"""Object library, missing-object library and stationarity, updated keyframe by keyframe."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pipeline.settings import BaselineSettings

NOBODY = 0


@dataclass(frozen=True)
class Candidate:
    """An object of the current visit as one keyframe shows it.

    Attributes:
        embedding: (d,) unit vector.
        centroid_world: (3,) of what the keyframe sees of it, metres.
    """

    embedding: NDArray[np.floating]
    centroid_world: NDArray[np.floating]


class ObjectLibrary:
    """The previous visit's objects while the current visit is under way.

    Objects are numbered from 1; arrays have an unused entry 0. An object is in the library until its
    stationarity, the mean of a Beta distribution over seen and missed where expected, falls below
    ``missing_below``; from then on it is in the missing-object library, until a candidate brings it back.

    Args:
        embeddings: (K0 + 1, d) unit vectors of the previous objects.
        low_world, high_world: (K0 + 1, 3) their bounds, metres.
        current_count: K1, objects that the current visit will show.
        min_similarity: least cosine of two embeddings of one object.
        settings: thresholds.

    Attributes:
        hits, misses: (K0 + 1,) parameters of the Beta distribution.
        is_missing: (K0 + 1,).
        partner: (K0 + 1,) the current object that it is, 0 = none.
        identity: (K1 + 1,) the previous object that each current object is, 0 = none.
        similarity: (K1 + 1,) cosine at which that was decided; NaN without.
        was_observed: (K0 + 1,) it was seen, or missed, at least once.
    """

    def __init__(
        self,
        embeddings: NDArray[np.floating],
        low_world: NDArray[np.floating],
        high_world: NDArray[np.floating],
        current_count: int,
        min_similarity: float,
        settings: BaselineSettings,
    ) -> None:
        self._embeddings = np.asarray(embeddings, np.float64)
        self._low, self._high = low_world - settings.gate_m, high_world + settings.gate_m
        self._settings = settings
        self._min_similarity = min_similarity
        size = len(embeddings)
        self.hits = np.full(size, settings.prior_hits)
        self.misses = np.full(size, settings.prior_misses)
        self.is_missing = np.zeros(size, bool)
        self.was_observed = np.zeros(size, bool)
        self.partner = np.zeros(size, np.int64)
        self.identity = np.zeros(current_count + 1, np.int64)
        self.similarity = np.full(current_count + 1, np.nan)
        self._seen_embedding = np.zeros((current_count + 1, self._embeddings.shape[1]))

    @property
    def stationarity(self) -> NDArray[np.float64]:
        """(K0 + 1,) mean of the Beta distribution, in (0, 1)."""
        return self.hits / (self.hits + self.misses)

    def observe(self, candidates: Mapping[int, Candidate], expected_share: NDArray[np.floating]) -> None:
        """Take in one keyframe.

        Args:
            candidates: what it shows, by number of the current object.
            expected_share: (K0 + 1,) share of each previous object that would be in plain view if it were
                still in its place.
        """
        for number, candidate in candidates.items():
            self._seen_embedding[number] += candidate.embedding
        self._associate_in_place(candidates)
        self._find_among_missing([number for number in candidates if self.identity[number] == NOBODY])
        seen = {int(self.identity[number]) for number in candidates} - {NOBODY}
        for previous in seen:
            self.hits[previous] += 1
            self.was_observed[previous] = True
        self._miss(seen, expected_share)

    def _associate_in_place(self, candidates: Mapping[int, Candidate]) -> None:
        """New candidates with the objects whose bounds they lie in, one-to-one by cosine."""
        new = [number for number in candidates if self.identity[number] == NOBODY]
        free = np.flatnonzero(self.partner[1:] == NOBODY) + 1
        if not new or not len(free):
            return
        places = np.array([candidates[number].centroid_world for number in new])
        inside = (places[:, None] >= self._low[free]) & (places[:, None] <= self._high[free])
        self._pair(new, free, np.asarray(inside.all(axis=2), bool))

    def _find_among_missing(self, numbers: list[int]) -> None:
        """Current objects that are nobody yet with the missing-object library, wherever they are."""
        missing = np.flatnonzero(self.is_missing & (self.partner == NOBODY))
        if numbers and len(missing):
            self._pair(numbers, missing, np.ones((len(numbers), len(missing)), bool))

    def _pair(self, numbers: list[int], previous: NDArray[np.intp], allowed: NDArray[np.bool_]) -> None:
        cosine = self._cosine(numbers, previous)
        allowed = allowed & (cosine >= self._min_similarity)
        rows, columns = linear_sum_assignment(-np.where(allowed, cosine, -1.0))
        for row, column in zip(rows, columns, strict=True):
            if allowed[row, column]:
                number, object_number = numbers[row], int(previous[column])
                self.identity[number] = object_number
                self.similarity[number] = cosine[row, column]
                self.partner[object_number] = number
                self.is_missing[object_number] = False

    def _cosine(self, numbers: list[int], previous: NDArray[np.intp]) -> NDArray[np.float64]:
        seen = self._seen_embedding[numbers]
        seen = seen / np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-9)
        return np.asarray(seen @ self._embeddings[previous].T, np.float64)

    def _miss(self, seen: set[int], expected_share: NDArray[np.floating]) -> None:
        """Expected but not seen: less stationary, and missing in the end."""
        expected = np.asarray(expected_share) >= self._settings.min_expected_share
        expected[0] = False
        expected[list(seen)] = False
        missed = np.flatnonzero(expected & ~self.is_missing)
        self.misses[missed] += 1
        self.was_observed[missed] = True
        gone = missed[self.stationarity[missed] < self._settings.missing_below]
        for previous in gone.tolist():
            self.is_missing[previous] = True
            number = int(self.partner[previous])
            if number != NOBODY:
                self.partner[previous] = self.identity[number] = NOBODY
                self.similarity[number] = np.nan
        if len(gone):
            # What is new in this visit may have been seen before its old place was found empty.
            known = np.flatnonzero(np.any(self._seen_embedding != 0, axis=1) & (self.identity == NOBODY))
            self._find_among_missing(known.tolist())

    def best_similarity(self) -> NDArray[np.float64]:
        """(K1 + 1,) greatest cosine of each current object with any previous one; 0 without any."""
        best = np.zeros(len(self.identity))
        if len(self._embeddings) > 1 and len(best) > 1:
            everybody = list(range(1, len(best)))
            best[1:] = self._cosine(everybody, np.arange(1, len(self._embeddings))).max(axis=1)
        return best
