"""Which pieces stand on a support, and which belong to what holds them (posts, boards' edges, loose bits)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from scipy.spatial import cKDTree

from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.components import (
    DisjointSets,
    Floats,
    Indices,
    Mask,
    Pieces,
    cells_per_piece,
)
from pipeline.perception.embedded.gravity_view import GravityView
from pipeline.perception.embedded.supports import Support
from pipeline.settings import DiscoverySettings

_GROUNDED_VOXELS = 3.2
_NEIGHBOURS = 24
_OWN_TOP = 2.0


@dataclass(frozen=True)
class _Contacts:
    """Pairs of a piece and a support it touches, sorted by piece; its voxels above and below the plane."""

    piece: Indices
    support: Indices
    above: Indices
    below: Indices


class Attachment:
    """Joins pieces (0 .. pieces.count - 1) and supports (numbered after the pieces) into objects."""

    def __init__(
        self,
        surface: FusedSurface,
        view: GravityView,
        pieces: Pieces,
        supports: list[Support],
        layer: Indices,
        settings: DiscoverySettings,
    ):
        self._voxel = surface.voxel_size_m
        self._points = np.asarray(surface.points_world, np.float64)
        self._view = view
        self._pieces = pieces
        self._supports = supports
        self._layer = layer
        self._settings = settings
        self._support_area = np.array([support.hull.dilated(1).area for support in supports], np.float64)
        self._footprint = cells_per_piece(pieces, np.floor(view.plan).astype(np.int64))
        self._is_item = np.zeros(pieces.count, np.bool_)
        self._sets = DisjointSets(pieces.count + len(supports))

    def nodes(self) -> Indices:
        """(M,) piece or support each voxel belongs to before anything is joined, -1 = structure."""
        return np.where(self._layer >= 0, self._pieces.count + self._layer, self._pieces.number)

    def roots(self) -> Indices:
        """(pieces + supports,) the object each of them ended up in."""
        return self._sets.roots()

    def settle_contacts(self) -> None:
        """Tell items, which touch supports only from above, from parts of the supports they touch."""
        if not self._supports or not self._pieces.count:
            return
        contacts = self._count_contacts()
        bounds = np.flatnonzero(np.diff(contacts.piece, prepend=-1, append=-1))
        for start, end in pairwise(bounds):
            piece = int(contacts.piece[start])
            support = contacts.support[start:end]
            above, below = contacts.above[start:end], contacts.below[start:end]
            is_under = below > np.maximum(2, 0.25 * above)
            under, over = support[is_under], support[~is_under & (above > 2)]
            covered = self._covered(piece)
            fits = np.array([self._fits(piece, covered, int(one)) for one in over], np.bool_)
            # Its own top carries things too, but is no board that it happens to touch from below.
            is_own_top = self._support_area[under] < _OWN_TOP * covered
            if len(over) and fits.all():
                is_post = bool((self._footprint[piece] < 0.02 * self._support_area[over]).all())
                pressed = below[is_under][~is_own_top] >= 0.15 * self._pieces.sizes[piece]
                if is_own_top.all() or not (is_post or pressed.any()):
                    self._is_item[piece] = True
                    for one in under[is_own_top]:
                        self._sets.join(self._pieces.count + int(one), piece)
                    continue
            for one in (*under, *over[~fits]):
                self._sets.join(piece, self._pieces.count + int(one))

    def _covered(self, piece: int) -> float:
        """Area of a piece in plan, inside included (sides alone stand for the whole box), voxels^2."""
        cells = np.floor(self._view.plan[self._pieces.voxels_of(np.array([piece]))])
        hull = cv2.convexHull(cells.astype(np.float32)[:, None])
        # Cells count whole: half a cell more on every side than between their corners.
        return float(cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, True) + 1)

    def _count_contacts(self) -> _Contacts:
        in_layer = np.flatnonzero(self._layer >= 0)
        loose = self._pieces.order
        reach = self._settings.contact_voxels * self._voxel
        distance, nearest = cKDTree(self._points[in_layer]).query(
            self._points[loose], distance_upper_bound=reach
        )
        loose, nearest = loose[np.isfinite(distance)], nearest[np.isfinite(distance)]
        support = self._layer[in_layer[nearest]]
        slopes = np.stack([one.slope for one in self._supports])[support]
        plane_height = (self._view.plan[loose] * slopes[:, :2]).sum(axis=1) + slopes[:, 2]
        is_above = self._view.height[loose] > plane_height
        key, inverse = np.unique(
            self._pieces.number[loose] * len(self._supports) + support, return_inverse=True
        )
        above = np.bincount(inverse, is_above, len(key)).astype(np.int64)
        below = np.bincount(inverse, ~is_above, len(key)).astype(np.int64)
        return _Contacts(key // len(self._supports), key % len(self._supports), above, below)

    def _fits(self, piece: int, covered: float, support: int) -> bool:
        """Whether a piece is small for a support and does not reach below it."""
        if covered >= self._settings.item_footprint * self._support_area[support]:
            return False
        voxels = self._pieces.voxels_of(np.array([piece]))
        over = self._view.height[voxels] - self._supports[support].height_at(self._view.plan[voxels])
        return bool(np.mean(over < -3) < self._settings.item_below)

    def hold_loose_pieces(self, is_structure: Mask) -> None:
        """Join posts to the boards they reach, and what floats to the neighbour it touches most."""
        pieces = self._pieces
        if not pieces.count:
            return
        roots = self._sets.roots()[: pieces.count]
        free = ~self._is_item & (roots == np.arange(pieces.count))
        grounded = self._grounded(is_structure)
        low, high = self._height_span()
        thin_limit = (3.5 + 0.02 / self._voxel) ** 2
        thin = (self._footprint < thin_limit) | (self._footprint < 0.021 * (high - low) ** 2)
        joined = self._join_posts(free & thin, low, high)
        floating = free & ~grounded & ~joined
        self._join_floating(np.flatnonzero(floating))

    def _grounded(self, is_structure: Mask) -> Mask:
        """(pieces,) whether the structure holds a piece: floor below it, wall beside it."""
        pieces = self._pieces
        if not is_structure.any():
            return np.zeros(pieces.count, np.bool_)
        distance, _ = cKDTree(self._points[is_structure]).query(
            self._points[pieces.order], distance_upper_bound=_GROUNDED_VOXELS * self._voxel
        )
        near = np.bincount(pieces.number[pieces.order[np.isfinite(distance)]], minlength=pieces.count)
        return near >= np.maximum(2, 0.01 * pieces.sizes)

    def _height_span(self) -> tuple[Floats, Floats]:
        """(pieces,) 2nd and 98th percentile of the voxels' heights."""
        pieces = self._pieces
        number = pieces.number[pieces.order]
        height = self._view.height[pieces.order]
        ranked = height[np.lexsort((height, number))]
        last = pieces.sizes - 1
        low = ranked[pieces.starts[:-1] + np.round(0.02 * last).astype(np.int64)]
        high = ranked[pieces.starts[:-1] + np.round(0.98 * last).astype(np.int64)]
        return low, high

    def _join_posts(self, thin: Mask, low: Floats, high: Floats) -> Mask:
        """Join thin pieces to every support they stand under or reach up to; (pieces,) those joined."""
        pieces = self._pieces
        joined = np.zeros(pieces.count, np.bool_)
        candidates = np.flatnonzero(thin)
        voxels = pieces.voxels_of(candidates)
        if not len(voxels):
            return joined
        number = pieces.number[voxels]
        plan = self._view.plan[voxels]
        centre = np.column_stack(
            [np.bincount(number, plan[:, i], pieces.count) / np.maximum(pieces.sizes, 1) for i in range(2)]
        )
        reach = self._settings.post_reach_m / self._voxel
        for index, support in enumerate(self._supports):
            height = support.height_at(centre)
            reached = thin & (low - reach < height) & (height < high + reach)
            reached &= self._footprint < 0.03 * self._support_area[index]
            beside = np.flatnonzero(reached[number])
            if not len(beside):
                continue
            within = beside[support.hull.dilated(3).contains(plan[beside])]
            inside = np.bincount(number[within], minlength=pieces.count)
            for piece in np.flatnonzero(reached & (inside > 0.6 * pieces.sizes)):
                self._sets.join(int(piece), pieces.count + index)
                joined[piece] = True
        return joined

    def _join_floating(self, floating: Indices) -> None:
        """Join each floating piece, small ones first, to the object it has most contact with."""
        pieces = self._pieces
        node = self.nodes()
        held = np.flatnonzero(node >= 0)
        voxels = pieces.voxels_of(floating)
        if not len(voxels) or len(held) < 2:
            return
        distance, nearest = cKDTree(self._points[held]).query(
            self._points[voxels],
            k=min(_NEIGHBOURS, len(held)),
            distance_upper_bound=self._settings.attach_voxels * self._voxel,
        )
        found = np.isfinite(distance)
        piece = np.broadcast_to(pieces.number[voxels][:, None], distance.shape)[found]
        other = node[held[nearest[found]]]
        weight = np.exp(-distance[found] / (2 * self._voxel))
        apart = piece != other
        total = pieces.count + len(self._supports)
        key, inverse = np.unique(piece[apart] * total + other[apart], return_inverse=True)
        contact = np.bincount(inverse, weight[apart], len(key))
        bounds = np.searchsorted(key, np.arange(pieces.count + 1) * total)
        for one in floating[np.argsort(pieces.sizes[floating], kind="stable")]:
            start, end = bounds[one], bounds[one + 1]
            own = self._sets.find(int(one))
            if start == end or own != one:
                continue
            contacts: dict[int, float] = {}
            for i in range(start, end):
                root = self._sets.find(int(key[i] % total))
                if root != own:
                    contacts[root] = contacts.get(root, 0.0) + float(contact[i])
            if contacts:
                self._sets.join(own, max(sorted(contacts), key=lambda root: contacts[root]))
