"""Connected pieces of a surface, and how to get at their voxels without looping over all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

Mask = NDArray[np.bool_]
Indices = NDArray[np.int64]
Floats = NDArray[np.float64]


def linked(count: int, first: Indices, second: Indices) -> Indices:
    """Component number 0, 1, ... of each of ``count`` nodes linked by the edges first[i]-second[i]."""
    graph = coo_matrix((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def edges_among(neighbours: csr_matrix, mask: Mask) -> tuple[Indices, Indices]:
    """Both ends (i < j) of every edge whose two voxels are in ``mask`` (M,)."""
    inside = np.flatnonzero(mask)
    rows = neighbours[inside]
    first = np.repeat(inside, np.diff(rows.indptr))
    second = rows.indices.astype(np.int64)
    keep = (first < second) & mask[second]
    return first[keep], second[keep]


@dataclass(frozen=True)
class Pieces:
    """A partition of some voxels into pieces 0..count-1; voxels outside have number -1.

    Attributes:
        number: (M,) piece of each voxel, -1 where it belongs to none.
        sizes: (count,) voxels per piece.
        order: voxels sorted by piece; those of piece c are ``order[starts[c] : starts[c + 1]]``.
        starts: (count + 1,) bounds of the pieces in ``order``.
    """

    number: Indices
    sizes: Indices
    order: Indices
    starts: Indices

    @classmethod
    def of(cls, mask: Mask, neighbours: csr_matrix) -> Pieces:
        """Connected components of the voxels in ``mask``, numbered by their first voxel."""
        inside = np.flatnonzero(mask)
        place = np.full(len(mask), -1, np.int64)
        place[inside] = np.arange(len(inside))
        first, second = edges_among(neighbours, mask)
        number = np.full(len(mask), -1, np.int64)
        number[inside] = linked(len(inside), place[first], place[second])
        return cls.from_numbers(number)

    @classmethod
    def from_numbers(cls, number: Indices) -> Pieces:
        """From compact piece numbers per voxel (-1 = none)."""
        inside = np.flatnonzero(number >= 0)
        order = inside[np.argsort(number[inside], kind="stable")]
        count = int(number.max(initial=-1)) + 1
        sizes = np.bincount(number[inside], minlength=count).astype(np.int64)
        return cls(number, sizes, order, np.concatenate([[0], np.cumsum(sizes)]))

    @property
    def count(self) -> int:
        """Number of pieces."""
        return len(self.sizes)

    def voxels_of(self, pieces: Indices) -> Indices:
        """The voxels of the given pieces, one piece after the other."""
        sizes = self.sizes[pieces]
        offsets = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        return self.order[np.repeat(self.starts[pieces], sizes) + offsets]

    def share(self, voxels: Indices, chosen: Mask) -> Floats:
        """(count,) share of each piece's voxels that are ``voxels[chosen]``."""
        hits = np.bincount(self.number[voxels[chosen]], minlength=self.count)
        return hits / np.maximum(self.sizes, 1)


def cells_per_piece(pieces: Pieces, cells: Indices) -> Indices:
    """(count,) distinct cells that each piece occupies; cells (M, 2) are integer coordinates."""
    if not len(pieces.order):
        return np.zeros(pieces.count, np.int64)
    local = cells[pieces.order]
    local = local - local.min(axis=0)
    span = local.max(axis=0) + 1
    number = pieces.number[pieces.order]
    key = np.unique((number * span[0] + local[:, 0]) * span[1] + local[:, 1])
    return np.bincount(key // (span[0] * span[1]), minlength=pieces.count).astype(np.int64)


def first_seen_order(labels: Indices, min_voxels: int) -> NDArray[np.int32]:
    """Labels (M,) with 0 = none made compact 1..n in the order of their first voxel; small ones dropped."""
    values, first, inverse, counts = np.unique(
        labels, return_index=True, return_inverse=True, return_counts=True
    )
    kept = np.flatnonzero((values > 0) & (counts >= min_voxels))
    renamed = np.zeros(len(values), np.int32)
    renamed[kept[np.argsort(first[kept], kind="stable")]] = np.arange(1, len(kept) + 1)
    return renamed[inverse.reshape(-1)]


class DisjointSets:
    """Union-find over 0..count-1; the root of a union is the root of its second part."""

    def __init__(self, count: int):
        self._parent = list(range(count))

    def find(self, node: int) -> int:
        """Root of the set that holds ``node``."""
        parent = self._parent
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    def join(self, part: int, whole: int) -> None:
        """Put the set of ``part`` into the set of ``whole``."""
        self._parent[self.find(part)] = self.find(whole)

    def roots(self) -> Indices:
        """(count,) root of every node."""
        return np.array([self.find(node) for node in range(len(self._parent))], np.int64)
