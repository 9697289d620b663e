"""Images of a frame as most archives store them: depth registered to a colour image that may be distorted."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.errors import InputError
from pipeline.readers.filetree import FileTree
from pipeline.readers.images import read_colour, read_counts
from pipeline.readers.intrinsics import Distortion, undistort_colour, undistort_counts


@dataclass(frozen=True)
class StoredImages:
    """The two images of a frame; ``load_rgb`` and ``load_depth`` are the loaders of a ``Frame``."""

    tree: FileTree
    colour: str
    depth: str
    camera: PinholeCamera
    distortion: Distortion
    metres_per_count: float

    def load_rgb(self) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 RGB, undistorted.

        Raises:
            InputError: not readable, or not of the camera's size.
        """
        image = read_colour(self.tree, self.colour)
        rows, columns = image.shape[:2]
        if (columns, rows) != self._size:
            raise InputError(
                f"colour image {self.tree.where(self.colour)} is {columns} x {rows}, "
                f"but its intrinsics are for {self.camera.width} x {self.camera.height}",
                "the intrinsics must belong to the stored images",
            )
        return undistort_colour(image, self.camera, self.distortion)

    def load_depth(self) -> NDArray[np.float32]:
        """(H, W) float32 metres, undistorted; 0 = no measurement.

        Depth of another size but the same shape of image is brought to the colour image's size.

        Raises:
            InputError: not readable, not 16 bit, or of another shape than the colour image.
        """
        counts = read_counts(self.tree, self.depth)
        rows, columns = counts.shape
        if (columns, rows) != self._size:
            if not same_aspect((columns, rows), self._size):
                raise InputError(
                    f"depth image {self.tree.where(self.depth)} is {columns} x {rows}, "
                    f"but the colour image is {self.camera.width} x {self.camera.height}",
                    "register the depth to the colour image",
                )
            resized = cv2.resize(counts, self._size, interpolation=cv2.INTER_NEAREST_EXACT)
            counts = np.asarray(resized, dtype=np.uint16)
        counts = undistort_counts(counts, self.camera, self.distortion)
        return counts.astype(np.float32) * np.float32(self.metres_per_count)

    def stored_depth_size(self) -> tuple[int, int]:
        """(width, height) of the depth image on disk."""
        rows, columns = read_counts(self.tree, self.depth).shape
        return columns, rows

    @property
    def _size(self) -> tuple[int, int]:
        return self.camera.width, self.camera.height


def same_aspect(size_a: tuple[int, int], size_b: tuple[int, int]) -> bool:
    """Whether two (width, height) differ by scale only, within the rounding of one pixel."""
    (width_a, height_a), (width_b, height_b) = size_a, size_b
    return abs(width_a * height_b - width_b * height_a) <= max(width_a, height_a, width_b, height_b)
