"""Texture tiles of a scene with their mip levels in one flat pool, sampled by texture coordinates."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_LEVELS = 11  # tiles of up to 1024 texels


class TextureAtlas:
    """Square, wrapping RGB tiles; sampling picks the mip level whose texels are as large as a pixel."""

    def __init__(self) -> None:
        self._texels: list[NDArray[np.uint8]] = []
        self._length = 0
        self._offsets: list[list[int]] = []
        self._sizes: list[int] = []
        self._gloss: list[float] = []
        self._macro: list[float] = []
        self._pool = np.zeros((0, 3), dtype=np.uint8)

    def add(self, image: NDArray[np.uint8], gloss: float = 0.0, macro: float = 0.0) -> int:
        """Add a tile and return its number.

        Args:
            image: (S, S, 3) uint8 sRGB, S a power of two; it repeats in both directions.
            gloss: 0 = matt ... 1 = glass; gives highlights, and holes in the depth.
            macro: contrast of stains wider than the tile, so that a large surface does not repeat.
        """
        size = image.shape[0]
        if image.shape != (size, size, 3) or size & (size - 1) or size > 1 << (_LEVELS - 1):
            raise ValueError(f"a tile is (S, S, 3) with S a power of two up to 1024, got {image.shape}")
        offsets = []
        level = image
        while True:
            offsets.append(self._length)
            self._texels.append(level.reshape(-1, 3))
            self._length += level.shape[0] ** 2
            if level.shape[0] == 1:
                break
            half = level.shape[0] // 2
            level = cv2.resize(level, (half, half), interpolation=cv2.INTER_AREA).reshape(half, half, 3)
        offsets += [offsets[-1]] * (_LEVELS - len(offsets))
        self._offsets.append(offsets)
        self._sizes.append(size)
        self._gloss.append(gloss)
        self._macro.append(macro)
        return len(self._sizes) - 1

    @property
    def gloss(self) -> NDArray[np.float32]:
        """(tiles,) gloss of each tile."""
        return np.array(self._gloss, dtype=np.float32)

    @property
    def macro(self) -> NDArray[np.float32]:
        """(tiles,) contrast of wide stains of each tile."""
        return np.array(self._macro, dtype=np.float32)

    def sample(
        self, tile: NDArray[np.integer], uv: NDArray[np.float32], footprint: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Bilinear colours.

        Args:
            tile: (N,) tile numbers.
            uv: (N, 2) texture coordinates, 1 = one tile.
            footprint: (N,) size of a pixel on the surface, in tiles.

        Returns:
            (N, 3) linear RGB in [0, 1].
        """
        if len(self._pool) != self._length:
            self._pool = np.concatenate(self._texels)
        size = np.array(self._sizes, dtype=np.float32)[tile]
        level = np.rint(np.log2(np.maximum(footprint * size, 1.0))).astype(np.int32)
        level = np.minimum(level, np.log2(size).astype(np.int32))
        edge = size.astype(np.int32) >> level
        base = np.array(self._offsets, dtype=np.int32)[tile, level]
        position = uv * edge[:, None].astype(np.float32) - 0.5
        corner = np.floor(position)
        weight = (position - corner).astype(np.float32)
        low = corner.astype(np.int32) & (edge - 1)[:, None]
        high = (low + 1) & (edge - 1)[:, None]
        row_low, row_high = base + low[:, 1] * edge, base + high[:, 1] * edge
        wu, wv = weight[:, :1], weight[:, 1:]
        take = self._pool.take
        upper = take(row_low + low[:, 0], axis=0) * (1 - wu) + take(row_low + high[:, 0], axis=0) * wu
        lower = take(row_high + low[:, 0], axis=0) * (1 - wu) + take(row_high + high[:, 0], axis=0) * wu
        colour = (upper * (1 - wv) + lower * wv) * np.float32(1 / 255)
        return colour * colour  # gamma 2: close to sRGB's and cheap to undo
