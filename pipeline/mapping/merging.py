"""Merging lifted masks into objects across keyframes (paper, Sec. III-B.2, after ConceptGraphs).

A mask joins an object when their voxels overlap and they look alike; where little of an object has been
lifted yet, its points are projected into the image instead and compared with the mask there (2D tracking).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.settings import MergeSettings


@dataclass
class _Track:
    """An object under construction."""

    token_sum: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def similarity(self, token: NDArray[np.floating]) -> float:
        norm = float(np.linalg.norm(self.token_sum))
        return float(self.token_sum @ token) / norm if norm > 0 else 1.0


class ObjectMerger:
    """Voxel ownership of objects, built keyframe by keyframe.

    Args:
        voxel_count: M, voxels of the surface.
        settings: overlap and similarity from which masks merge.
        masks_are_tracks: mask numbers already mean the same object in every keyframe; they are taken as
            they are, and nothing is merged.
    """

    def __init__(self, voxel_count: int, settings: MergeSettings, *, masks_are_tracks: bool) -> None:
        self._settings = settings
        self._masks_are_tracks = masks_are_tracks
        self._owner = np.zeros(voxel_count, np.int32)
        self._votes = np.zeros(voxel_count, np.int32)
        self._tracks: dict[int, _Track] = {}
        self._last_number = 0

    def add(
        self,
        masks: NDArray[np.int32],
        voxels: NDArray[np.int32],
        tokens: dict[int, NDArray[np.floating]] | None = None,
        projected_voxels: NDArray[np.int32] | None = None,
    ) -> None:
        """Add the masks of one keyframe.

        Args:
            masks: (h, w) mask number of each strided pixel, 0 = none.
            voxels: (h, w) surface voxel of each strided pixel, -1 = none.
            tokens: unit feature vector of each mask, by number; needed unless masks are tracks.
            projected_voxels: (h, w) surface voxel that projects to each pixel, -1 = none, for 2D tracking;
                None = no object is tracked in 2D.
        """
        lifted = (masks > 0) & (voxels >= 0)
        if not lifted.any():
            return
        numbers, of_voxels = masks[lifted], voxels[lifted]
        if self._masks_are_tracks:
            self._claim(of_voxels, numbers)
            return
        projected = np.zeros_like(masks)
        if projected_voxels is not None:
            visible = projected_voxels >= 0
            projected[visible] = self._owner[projected_voxels[visible]]
        for number in np.unique(numbers):
            token = None if tokens is None else tokens.get(int(number))
            mask_voxels = np.unique(of_voxels[numbers == number])
            owner = self._matching_object(mask_voxels, projected, masks == number, token)
            if owner is None:
                self._last_number += 1
                owner = self._last_number
                self._tracks[owner] = _Track()
            self._claim(mask_voxels, np.full(len(mask_voxels), owner, np.int32))
            track = self._tracks[owner]
            if token is not None:
                track.token_sum = token.astype(np.float64) + (track.token_sum if len(track.token_sum) else 0)

    def _matching_object(
        self,
        mask_voxels: NDArray[np.int32],
        projected: NDArray[np.int32],
        mask: NDArray[np.bool_],
        token: NDArray[np.floating] | None,
    ) -> int | None:
        owners = self._owner[mask_voxels]
        shared = np.bincount(owners, minlength=self._last_number + 1)
        pixels = np.bincount(projected[mask], minlength=self._last_number + 1)
        best: tuple[float, int] | None = None
        for candidate in np.flatnonzero((shared > 0) | (pixels > 0)).tolist():
            if candidate == 0:
                continue
            if (
                token is not None
                and self._tracks[candidate].similarity(token) < self._settings.min_similarity
            ):
                continue
            size = int((self._owner == candidate).sum())
            overlap = shared[candidate] / max(1, min(len(mask_voxels), size))
            if overlap < self._settings.min_overlap:
                union = int(mask.sum()) + int((projected == candidate).sum()) - int(pixels[candidate])
                overlap = pixels[candidate] / max(1, union)
                if overlap < self._settings.min_image_overlap:
                    continue
            if best is None or overlap > best[0]:
                best = (float(overlap), candidate)
        return None if best is None else best[1]

    def _claim(self, voxels: NDArray[np.int32], owners: NDArray[np.int32]) -> None:
        """Vote for owners (majority vote with one counter per voxel, after Boyer and Moore)."""
        agrees = self._owner[voxels] == owners
        np.add.at(self._votes, voxels[agrees], 1)
        np.subtract.at(self._votes, voxels[~agrees], 1)
        lost = ~agrees & (self._votes[voxels] <= 0)
        self._owner[voxels[lost]] = owners[lost]
        self._votes[voxels[lost]] = 1

    def finish(self) -> NDArray[np.int32]:
        """(M,) object of each voxel, 0 = none."""
        return self._owner.copy()
