"""Texture tiles of a scene with their mip levels in one flat pool, sampled by texture coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_LEVELS = 11  # tiles of up to 1024 texels


class TextureAtlas:
    """Square, wrapping RGB tiles; sampling picks the mip level whose texels are as large as a pixel.

    Tiles are added while a scene is drawn; :meth:`sampler` then makes what its pictures are drawn with.
    """

    def __init__(self) -> None:
        self._texels: list[NDArray[np.uint8]] = []
        self._length = 0
        self._offsets: list[list[int]] = []
        self._sizes: list[int] = []
        self._gloss: list[float] = []
        self._macro: list[float] = []
        self._sampler: TextureSampler | None = None

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

    def sampler(self) -> TextureSampler:
        """What samples the tiles added so far; made once."""
        if self._sampler is not None and len(self._sampler.texels) == self._length:
            return self._sampler
        packed = cv2.cvtColor(np.concatenate(self._texels)[None], cv2.COLOR_RGB2RGBA)[0]
        self._sampler = TextureSampler(
            packed.reshape(-1).view(np.uint32),
            np.array(self._offsets, dtype=np.int32).reshape(-1),
            np.array(self._sizes, dtype=np.float32),
        )
        return self._sampler


@dataclass(frozen=True)
class TextureSampler:
    """The tiles of an atlas in tables of one number per texel or tile: one gather each.

    Attributes:
        texels: (texels,) red, green, blue and an unused byte of every mip level of every tile.
        offsets: (tiles * levels,) where a tile's mip level begins in ``texels``.
        sizes: (tiles,) edge of the finest level, texels.
    """

    texels: NDArray[np.uint32]
    offsets: NDArray[np.int32]
    sizes: NDArray[np.float32]

    def sample(
        self, tile: NDArray[np.integer], uv: NDArray[np.float32], footprint: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Bilinear colours.

        Args:
            tile: (N,) tile numbers.
            uv: (2, N) texture coordinates, 1 = one tile.
            footprint: (N,) size of a pixel on the surface, in tiles.

        Returns:
            (3, N) linear RGB in [0, 1].
        """
        size = self.sizes.take(tile)
        level = np.rint(np.log2(np.maximum(footprint * size, 1.0))).astype(np.int32)
        np.minimum(level, np.log2(self.sizes).astype(np.int32).take(tile), out=level)
        edge = size.astype(np.int32) >> level
        base = self.offsets.take(tile * np.int32(_LEVELS) + level)
        position = uv * edge.astype(np.float32)
        position -= np.float32(0.5)
        corner = np.floor(position)
        position -= corner
        (wu, wv), inverse = position, 1 - position
        low = corner.astype(np.int32)
        wrap = edge - 1
        low &= wrap
        high = low + 1
        high &= wrap
        row_low, row_high = low[1] * edge, high[1] * edge
        row_low += base
        row_high += base
        upper = self._channels(row_low + low[0]) * inverse[0]
        upper += self._channels(row_low + high[0]) * wu
        lower = self._channels(row_high + low[0]) * inverse[0]
        lower += self._channels(row_high + high[0]) * wu
        upper *= inverse[1]
        lower *= wv
        upper += lower
        upper *= np.float32(1 / 255)
        upper *= upper  # gamma 2: close to sRGB's and cheap to undo
        return upper

    def _channels(self, at: NDArray[np.int32]) -> NDArray[np.float32]:
        """(3, N) red, green and blue in [0, 255] of texels."""
        packed = self.texels.take(at).view(np.uint8).reshape(-1, 4)
        colours = np.empty((3, len(packed)), dtype=np.float32)
        colours[...] = packed.T[:3]
        return colours
