"""Dense patch correspondences of a co-visible pair (paper, Eq. 1-4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from pipeline.perception.protocols import PatchWarp
from pipeline.result import PatchLinks


@dataclass(frozen=True)
class DenseMatches:
    """The correlation matrix of a pair and its best matches in both directions.

    Attributes:
        correlation: C, (N0, N1) float32 (Eq. 1).
        forward: (N0,) q-hat(p), best current patch of every previous patch (Eq. 2, over rows).
        forward_score: (N0,) s(p, q-hat(p)) (Eq. 3).
        backward: (N1,) p-hat(q), best previous patch of every current patch (Eq. 2, over columns).
        backward_score: (N1,) s(p-hat(q), q).
    """

    correlation: NDArray[np.float32]
    forward: NDArray[np.int64]
    forward_score: NDArray[np.float32]
    backward: NDArray[np.int64]
    backward_score: NDArray[np.float32]

    def correspondences(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
        """C*, the union of both directions (Eq. 4), as previous patches, current patches and scores.

        A pair that is best both ways is one element of the union, not two.
        """
        previous = np.arange(len(self.forward))
        current = np.arange(len(self.backward))
        is_new = self.forward[self.backward] != current
        return (
            np.concatenate([previous, self.backward[is_new]]),
            np.concatenate([self.forward, current[is_new]]),
            np.concatenate([self.forward_score, self.backward_score[is_new]]),
        )

    def links(self, previous_shape: tuple[int, int], current_shape: tuple[int, int]) -> PatchLinks:
        """The matches as a result keeps them."""
        return PatchLinks(
            forward=self.forward.astype(np.uint16),
            forward_score=self.forward_score.astype(np.float16),
            backward=self.backward.astype(np.uint16),
            backward_score=self.backward_score.astype(np.float16),
            previous_shape=previous_shape,
            current_shape=current_shape,
        )


def match(features0: NDArray[np.float32], features1: NDArray[np.float32]) -> DenseMatches:
    """Match all patches of a pair.

    Args:
        features0: F0, (N0, d) of the previous keyframe.
        features1: F1, (N1, d) of the current keyframe.
    """
    with torch.inference_mode():
        correlation = torch.from_numpy(features0) @ torch.from_numpy(features1).T
        forward_score, forward = correlation.max(dim=1)
        backward_score, backward = correlation.max(dim=0)
    return DenseMatches(
        correlation.numpy(), forward.numpy(), forward_score.numpy(), backward.numpy(), backward_score.numpy()
    )


@dataclass(frozen=True)
class Nearby:
    """The patches around the expected place of each patch of a keyframe.

    The global best match forgives a look-alike anywhere in the image; what stands in the same place has to
    be compared with that place.

    Attributes:
        shape: (H_f, W_f) of the keyframe.
        visible: (V,) its patches that the other keyframe sees.
        around: (V, W) patches of the other keyframe around the place of each.
        into_count: number of patches of the other keyframe.
    """

    shape: tuple[int, int]
    visible: NDArray[np.int64]
    around: NDArray[np.int64]
    into_count: int

    def best(self, scores: NDArray[np.float32]) -> NDArray[np.float32]:
        """(H_f, W_f) best of the scores (N, N_into) around each place; NaN where it is not visible."""
        return self._drawn(np.take_along_axis(scores[self.visible], self.around, axis=1))

    def _drawn(self, scores: NDArray[np.float32]) -> NDArray[np.float32]:
        best = np.full(self.shape[0] * self.shape[1], np.nan, np.float32)
        if len(self.visible):
            best[self.visible] = scores.max(axis=1)
        return best.reshape(self.shape)

    def _needed(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which patches of the keyframe and of the other one take part."""
        own, other = np.zeros(self.shape[0] * self.shape[1], bool), np.zeros(self.into_count, bool)
        own[self.visible] = True
        other[self.around.reshape(-1)] = True
        return own, other


def nearby(warp: PatchWarp, into_shape: tuple[int, int], radius: int) -> Nearby:
    """The windows of a keyframe's patches.

    Args:
        warp: where its patches lie in the other keyframe.
        into_shape: (H_f, W_f) of the other keyframe.
        radius: patches searched in each direction.
    """
    rows, columns = into_shape
    height, width = warp.is_visible.shape
    visible = np.flatnonzero(warp.is_visible.reshape(-1))
    positions = warp.positions.reshape(-1, 2)[visible]
    column = np.rint(positions[:, 0]).astype(np.int64)
    row = np.rint(positions[:, 1]).astype(np.int64)
    offsets = np.arange(-radius, radius + 1)
    window_row = np.clip(row[:, None, None] + offsets[None, :, None], 0, rows - 1)
    window_column = np.clip(column[:, None, None] + offsets[None, None, :], 0, columns - 1)
    around = (window_row * columns + window_column).reshape(len(visible), len(offsets) ** 2)
    return Nearby((height, width), visible, around, rows * columns)


def best_of_both(
    features0: NDArray[np.float32], features1: NDArray[np.float32], nearby0: Nearby, nearby1: Nearby
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """``Nearby.best`` of the correlation in both directions, without the parts of it that nobody asks for.

    Args:
        features0, features1: as in :func:`match`.
        nearby0: windows of the previous keyframe in the current one. nearby1: the other way round.
    """
    (own0, other1), (own1, other0) = nearby0._needed(), nearby1._needed()
    needed0, needed1 = own0 | other0, own1 | other1
    # Its number among the needed ones, for every patch.
    number0, number1 = np.cumsum(needed0) - 1, np.cumsum(needed1) - 1
    with torch.inference_mode():
        scores = torch.from_numpy(features0[needed0]) @ torch.from_numpy(features1[needed1]).T
    flat, columns = scores.numpy().reshape(-1), scores.shape[1]
    return (
        nearby0._drawn(flat.take((number0 * columns)[nearby0.visible][:, None] + number1[nearby0.around])),
        nearby1._drawn(flat.take((number0 * columns)[nearby1.around] + number1[nearby1.visible][:, None])),
    )
