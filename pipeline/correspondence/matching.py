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
        scores = torch.from_numpy(features0) @ torch.from_numpy(features1).T
        forward_score, forward = scores.max(dim=1)
        backward_score, backward = scores.max(dim=0)
    return DenseMatches(
        scores.numpy(), forward.numpy(), forward_score.numpy(), backward.numpy(), backward_score.numpy()
    )


def correlation(features0: NDArray[np.float32], features1: NDArray[np.float32]) -> NDArray[np.float32]:
    """C alone, (N0, N1) (Eq. 1); arguments as in :func:`match`."""
    with torch.inference_mode():
        return np.asarray((torch.from_numpy(features0) @ torch.from_numpy(features1).T).numpy())


def best_nearby(
    scores: NDArray[np.float32], warp: PatchWarp, into_shape: tuple[int, int], radius: int
) -> NDArray[np.float32]:
    """Best correlation of each patch among those around its expected place.

    The global best match forgives a look-alike anywhere in the image; what stands in the same place has to
    be compared with that place.

    Args:
        scores: (N, N_into) correlations, rows are the patches of ``warp``.
        warp: where they lie in the other keyframe.
        into_shape: (H_f, W_f) of the other keyframe.
        radius: patches searched in each direction.

    Returns:
        (H_f, W_f) float32; NaN where the place is not visible.
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
    window = (window_row * columns + window_column).reshape(len(visible), len(offsets) ** 2)
    best = np.full(height * width, np.nan, np.float32)
    if len(visible):
        best[visible] = np.take_along_axis(scores[visible], window, axis=1).max(axis=1)
    return best.reshape(height, width)
