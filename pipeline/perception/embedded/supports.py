"""Surfaces that carry things: table tops, shelf boards, platforms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.components import Floats, Indices, Mask, Pieces, edges_among, linked
from pipeline.perception.embedded.gravity_view import GravityView, HullMask
from pipeline.settings import DiscoverySettings

_STEP_VOXELS = 0.9
_BLOCK_VOXELS = 2.0
_TRIMMED_VOXELS = 3.0
_FACING_VOXELS = 1.5
_SIDE_DEPTH_VOXELS = 5.5
_SIDE_REACH_VOXELS = 2.5


@dataclass(frozen=True)
class Support:
    """One (nearly) level surface; plan positions and heights in voxels, as in the view it was found in.

    Attributes:
        slope: (3,) height = slope[0] * x + slope[1] * y + slope[2].
        members: voxels that make up the surface.
        hull: convex hull of the members in plan.
    """

    slope: Floats
    members: Indices
    hull: HullMask

    def height_at(self, plan: Floats) -> Floats:
        """Height of the carrying plane at plan positions (n, 2)."""
        return plan @ self.slope[:2] + self.slope[2]


def find_supports(
    surface: FusedSurface, view: GravityView, is_structure: Mask, settings: DiscoverySettings
) -> list[Support]:
    """Level patches outside the structure that are large enough to carry things.

    What stands on a board cuts its visible surface into fragments: fragments of one height within
    ``support_gap_voxels`` of each other count as one support.
    """
    facing_up = ~is_structure & (
        np.asarray(surface.normals_world, np.float64) @ view.up > settings.support_up_cosine
    )
    upright = ~is_structure & (np.abs(np.asarray(surface.normals_world, np.float64) @ view.up) < 0.5)
    patches = _linked_level_patches(surface, view, facing_up, upright, settings.support_gap_voxels)
    least_area = max(settings.support_area_m2 / surface.voxel_size_m**2, settings.support_area_voxels)
    supports = []
    for patch in np.flatnonzero(patches.sizes >= 0.15 * least_area):
        members = patches.voxels_of(np.array([patch]))
        height = view.height[members]
        members = members[np.abs(height - np.median(height)) < _TRIMMED_VOXELS]
        plan = view.plan[members]
        area = len(np.unique(np.floor(plan), axis=0))
        hull = HullMask.around(plan, margin=3)
        hidden_board = area >= 0.25 * least_area and hull.area >= least_area and area > 0.1 * hull.area
        if area < least_area and not hidden_board:
            continue
        design = np.column_stack([plan, np.ones(len(plan))])
        slope = np.asarray(np.linalg.lstsq(design, view.height[members], rcond=None)[0], np.float64)
        supports.append(Support(slope, members, hull))
    return supports


def _linked_level_patches(
    surface: FusedSurface, view: GravityView, facing_up: Mask, upright: Mask, gap_voxels: float
) -> Pieces:
    """Voxels that face up, joined over gaps of up to ``gap_voxels`` at one height.

    Voxels are first joined to their neighbours; only means over blocks of 2 x 2 voxels are compared across
    the gaps, which keeps the number of pairs near-linear. Two edges with sides going down below them are the
    tops of two bodies (cartons in a row, parked cars), not two parts of one board.
    """
    inside = np.flatnonzero(facing_up)
    place = np.full(len(facing_up), -1, np.int64)
    place[inside] = np.arange(len(inside))
    if not len(inside):
        return Pieces.from_numbers(place)
    height = view.height
    first, second = edges_among(surface.neighbours, facing_up)
    level = np.abs(height[first] - height[second]) < _STEP_VOXELS
    fragment = linked(len(inside), place[first[level]], place[second[level]])

    block = np.floor(view.plan[inside] / _BLOCK_VOXELS).astype(np.int64)
    block -= block.min(axis=0)
    span = block.max(axis=0) + 1
    key = (fragment * span[0] + block[:, 0]) * span[1] + block[:, 1]
    _, node_of, counts = np.unique(key, return_inverse=True, return_counts=True)
    nodes = len(counts)
    position = np.column_stack([view.plan[inside], height[inside]])
    mean = np.column_stack([np.bincount(node_of, position[:, i], nodes) for i in range(3)]) / counts[:, None]
    node_fragment = np.zeros(nodes, np.int64)
    node_fragment[node_of] = fragment

    # Heights count tenfold, so that boards one above the other do not fill the list of pairs.
    stretched = mean * [1.0, 1.0, gap_voxels / _STEP_VOXELS / 1.5]
    pairs = cKDTree(stretched).query_pairs(gap_voxels, output_type="ndarray")
    across = (node_fragment[pairs[:, 0]] != node_fragment[pairs[:, 1]]) & (
        np.abs(mean[pairs[:, 0], 2] - mean[pairs[:, 1], 2]) < _STEP_VOXELS
    )
    pairs = pairs[across]
    ends = np.sort(node_fragment[pairs], axis=1)
    fragments = int(fragment.max()) + 1
    link, link_of = np.unique(ends[:, 0] * fragments + ends[:, 1], return_inverse=True)
    has_side = _nodes_above_sides(mean, np.column_stack([view.plan, height])[upright])
    distance = np.linalg.norm(mean[pairs[:, 0], :2] - mean[pairs[:, 1], :2], axis=1)
    shortest = np.full(len(link), np.inf)
    np.minimum.at(shortest, link_of, distance)
    facing = distance < shortest[link_of] + _FACING_VOXELS
    between_bodies = facing & has_side[pairs].all(axis=1)
    open_share = np.bincount(link_of, between_bodies, len(link)) / np.bincount(link_of, facing, len(link))
    link = link[open_share < 0.5]
    joined = linked(fragments, link // fragments, link % fragments)
    place[inside] = joined[fragment]
    return Pieces.from_numbers(place)


def _nodes_above_sides(nodes: Floats, sides: Floats) -> Mask:
    """Which nodes (n, 3) have upright surface a few voxels below them; all in plan and height, voxels."""
    if not len(sides):
        return np.zeros(len(nodes), np.bool_)
    below = nodes - [0.0, 0.0, _SIDE_DEPTH_VOXELS]
    distance, _ = cKDTree(sides).query(below, distance_upper_bound=_SIDE_REACH_VOXELS)
    return np.isfinite(distance)


def layer_of_voxels(
    view: GravityView, is_structure: Mask, supports: list[Support], band_voxels: float
) -> NDArray[np.int64]:
    """(M,) index of the support in whose layer a voxel lies, -1 for none.

    A layer is what lies within ``band_voxels`` of the plane inside the hull: the surface itself and the
    bottom edge of what stands on it. Cutting it away parts the things that stand on it.
    """
    layer = np.full(len(view.height), -1, np.int64)
    candidates = np.flatnonzero(~is_structure)
    candidates = candidates[np.argsort(view.height[candidates], kind="stable")]
    sorted_height = view.height[candidates]
    for index, support in enumerate(supports):
        carrying = support.height_at(view.plan[support.members])
        low, high = np.searchsorted(
            sorted_height, [carrying.min() - 2 * band_voxels, carrying.max() + 2 * band_voxels]
        )
        near = candidates[low:high]
        plan = view.plan[near]
        near = near[np.abs(view.height[near] - support.height_at(plan)) < band_voxels]
        near = near[support.hull.dilated(1).contains(view.plan[near])]
        layer[near[layer[near] < 0]] = index
        layer[support.members] = index
    return layer
