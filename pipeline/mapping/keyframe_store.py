"""What is kept of each keyframe while a run lasts: small arrays on disk, read when needed.

Memory then does not grow with the recording. Depth is kept in millimetres, at the geometry stride.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.store.files import read_npy, write_array, writing

MAX_STORED_DEPTH_M = 65.0


class KeyframeStore:
    """Per-keyframe arrays of one visit, at the geometry stride.

    ``k`` is the position among the visit's keyframes. ``voxels`` gives raw numbers until ``remap`` is set.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        self.remap: NDArray[np.int32] | None = None

    def _path(self, kind: str, k: int) -> Path:
        return self._folder / f"{kind}_{k:05d}.npy"

    def save(
        self, k: int, depth: NDArray[np.float32], rgb: NDArray[np.uint8], raw_voxels: NDArray[np.int32]
    ) -> None:
        """Store depth (h, w) metres, blurred colour (h, w, 3) and raw voxel numbers (h, w), -1 = none."""
        write_array(self._path("depth", k), np.round(depth * 1000).astype(np.uint16))
        write_array(self._path("rgb", k), rgb)
        write_array(self._path("voxels", k), raw_voxels)

    def depth(self, k: int) -> NDArray[np.float32]:
        """(h, w) metres, 0 = no measurement."""
        return read_npy(self._path("depth", k)).astype(np.float32) * np.float32(1e-3)

    def rgb(self, k: int) -> NDArray[np.uint8]:
        """(h, w, 3) slightly blurred colour of the strided pixels."""
        return read_npy(self._path("rgb", k))

    def voxels(self, k: int) -> NDArray[np.int32]:
        """(h, w) surface voxel of each pixel, -1 = none."""
        raw = read_npy(self._path("voxels", k))
        if self.remap is None:
            return raw
        return np.where(raw >= 0, self.remap[np.maximum(raw, 0)], -1).astype(np.int32)
