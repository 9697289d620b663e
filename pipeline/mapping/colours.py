"""Mean log colour of every voxel, with the exposure of each keyframe taken out.

Auto exposure and white balance change between the keyframes of one visit; without this, a wall that was
seen in two exposures looks changed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MIN_SHARED_PIXELS = 200
_DARKEST, _BRIGHTEST = 4, 255


def log_colour(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Natural logarithm of colours, clipped away from zero; any shape."""
    return np.log(np.clip(rgb, _DARKEST, _BRIGHTEST).astype(np.float32))


def within_faces(values: NDArray[np.floating], normals_world: NDArray[np.floating]) -> NDArray[np.float64]:
    """(n,) values less the mean of their face (the six axis directions): light changes whole faces.

    What is left is texture, whichever side a lamp stands on.

    Args:
        values: (n,) of points, such as log brightness.
        normals_world: (n, 3) unit.
    """
    axis = np.abs(normals_world).argmax(axis=1)
    face = axis * 2 + (normals_world[np.arange(len(axis)), axis] > 0)
    mean = np.bincount(face, values, 6) / np.maximum(np.bincount(face, minlength=6), 1)
    return np.asarray(values - mean[face], np.float64)


class VoxelColours:
    """Incremental mean of log colours per raw voxel, each keyframe first brought to the exposure so far."""

    def __init__(self) -> None:
        self._sums = np.zeros((1 << 16, 3))
        self._counts = np.zeros(1 << 16, np.int64)
        self.log_gains: list[NDArray[np.float64]] = []

    def add(self, raw_voxels: NDArray[np.int32], rgb: NDArray[np.uint8]) -> None:
        """Fuse the colours of one keyframe.

        Args:
            raw_voxels: (P,) raw voxel of each pixel.
            rgb: (P, 3) uint8.
        """
        colours = log_colour(rgb).astype(np.float64)
        top = int(raw_voxels.max()) + 1 if len(raw_voxels) else 0
        while len(self._counts) < top:
            self._sums = np.concatenate([self._sums, np.zeros_like(self._sums)])
            self._counts = np.concatenate([self._counts, np.zeros_like(self._counts)])
        known = self._counts[raw_voxels] > 0
        gain = np.zeros(3)
        if int(known.sum()) >= MIN_SHARED_PIXELS:
            voxels = raw_voxels[known]
            gain = np.median(colours[known] - self._sums[voxels] / self._counts[voxels, None], axis=0)
        self.log_gains.append(gain)
        # Only the voxels in view are touched: the map may be a hundred times larger.
        for channel in range(3):
            np.add.at(self._sums[:, channel], raw_voxels, colours[:, channel] - gain[channel])
        np.add.at(self._counts, raw_voxels, 1)

    def finish(self, remap: NDArray[np.int32], voxel_count: int) -> NDArray[np.float32]:
        """(voxel_count, 3) mean log RGB of the voxels that ``remap`` keeps."""
        raw = np.flatnonzero(remap >= 0)
        means = np.zeros((voxel_count, 3), np.float32)
        means[remap[raw]] = self._sums[raw] / np.maximum(self._counts[raw], 1)[:, None]
        return means
