"""Change-driven proposals: which voxels changed, before anything is known about objects.

Seen through by the other visit is proof, but only where nothing else stands: the lower band of what came,
or two things that replaced each other, were hit all the same. There colour speaks. Both kinds of evidence
are spread over the surface by a random walk that hardly crosses edges of colour and creases (after Grady,
"Random walks for image segmentation", 2006), so that a thing changes up to its border.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from pipeline.change.appearance import appearance_residual
from pipeline.change.observation import Observation
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.surface import FusedSurface
from pipeline.settings import ObservationSettings, ProposalSettings

_REACH_STEPS = 12
_ALIKE = -0.2
_UNLIKE_MEDIANS = 3.5
_LEAST_CHROMA = 0.04
_TRUST_THROUGH, _TRUST_COLOUR, _TRUST_HIT, _TRUST_NOTHING = 2.0, 0.1, 0.05, 0.01
_CREASE = -0.25
_CREASE_WEIGHT, _LEAST_WEIGHT = 0.15, 0.02


@dataclass(frozen=True)
class ChangeProposals:
    """What changed at the surface of one visit.

    Attributes:
        is_changed: (M,) voxels taken for changed, spread up to the edges of things.
        is_evident: (M,) those of them that the other visit did not find in place and alike.
        proof: (M,) 1 where the other visit saw through the voxel, less where it only looks unlike, else 0.
    """

    is_changed: NDArray[np.bool_]
    is_evident: NDArray[np.bool_]
    proof: NDArray[np.float32]


def propose_changes(
    geometry: SessionGeometry,
    seen: Observation,
    is_noise: NDArray[np.bool_],
    observation_settings: ObservationSettings,
    settings: ProposalSettings,
) -> ChangeProposals:
    """Voxels of a visit that came, went or became another thing.

    Args:
        geometry: the visit.
        seen: what the other visit saw of its surface.
        is_noise: (M,) voxels that their own visit denies.
    """
    surface = geometry.surface
    through = seen.is_seen_through(observation_settings)
    compared = seen.has_colour & ~through
    unlikeness = _unlikeness(geometry, seen, compared, settings)
    through = through & ~is_noise
    sign = np.where(seen.hit_count > 0, -1.0, 0.0).astype(np.float32)
    trust = np.where(seen.hit_count > 0, _TRUST_HIT, _TRUST_NOTHING).astype(np.float32)
    sign[compared], trust[compared] = unlikeness[compared], _TRUST_COLOUR
    sign[through], trust[through] = 1.0, _TRUST_THROUGH
    is_unlike = compared & (unlikeness > 0) & ~is_noise
    proof = np.where(through, 1.0, np.where(is_unlike, settings.unlike_proof, 0.0)).astype(np.float32)
    spread = _spread(surface, sign, trust, proof > 0, settings)
    is_denied = (seen.hit_count > 0) & ~through & ~(compared & (unlikeness > _ALIKE))
    return ChangeProposals(spread > 0, (spread > 0) & ~is_denied, proof)


def _unlikeness(
    geometry: SessionGeometry,
    seen: Observation,
    compared: NDArray[np.bool_],
    settings: ProposalSettings,
) -> NDArray[np.float32]:
    """(M,) in [-1, 1]: below 0 = the colours agree as well as those of nearly all voxels, above = unlike.

    Limits come from the visits themselves: most of a place is the same, so what differs more than nearly
    everything else is news. Shadows darken but hardly tint: tint counts more than lightness.
    """
    unlike = np.zeros(len(compared), np.float32)
    if not compared.any():
        return unlike
    surface = geometry.surface
    residual = appearance_residual(
        geometry.log_colours, seen.log_colours, compared, surface.normals_world
    ).residual
    is_compared = compared.astype(np.float32)[:, None]
    summed = surface.neighbours @ residual + residual
    number = surface.neighbours @ is_compared + is_compared
    mean = summed / np.maximum(number, 1)
    lightness = mean.mean(axis=1)
    tint = np.linalg.norm(mean - lightness[:, None], axis=1)
    by_tint = _above_usual(tint, compared, settings.usual_percentile, _LEAST_CHROMA)
    by_lightness = _above_usual(np.abs(lightness), compared, settings.usual_percentile, 0.0)
    by_lightness *= np.where(by_lightness > 0, settings.lightness_weight, 1.0).astype(np.float32)
    return np.maximum(by_tint, by_lightness)


def _above_usual(
    difference: NDArray[np.floating], compared: NDArray[np.bool_], percentile: float, least: float
) -> NDArray[np.float32]:
    """(M,) how far a difference is above the limit of what is usual: -1 at none, 0 at it, 1 at twice."""
    usual = difference[compared]
    limit = max(float(np.percentile(usual, percentile)), _UNLIKE_MEDIANS * float(np.median(usual)), least)
    return np.clip(difference / max(limit, 1e-6) - 1, -1, 1).astype(np.float32)


def _spread(
    surface: FusedSurface,
    sign: NDArray[np.float32],
    trust: NDArray[np.float32],
    is_source: NDArray[np.bool_],
    settings: ProposalSettings,
) -> NDArray[np.float32]:
    """(M,) signs made smooth along the surface; far from any source of change they stay below zero.

    Minimises the sum of trust * (x - sign)^2 and weight * (x_i - x_j)^2 over the edges, by Jacobi steps.
    """
    smooth = np.minimum(sign, 0)
    near = is_source.astype(np.float32)
    for _ in range(_REACH_STEPS):
        near = ((surface.neighbours @ near + near) > 0).astype(np.float32)
    active = np.flatnonzero(near)
    if not is_source.any():
        return smooth
    weights = _edge_weights(surface, active, settings.edge_sigma_lab)
    total = np.asarray(weights.sum(axis=1)).ravel()
    pull = trust[active] * sign[active]
    inertia = trust[active] + total
    x = sign[active] * np.minimum(trust[active], 1)
    for _ in range(settings.spread_steps):
        x = (pull + weights @ x) / inertia
    smooth[active] = x
    return smooth


def _edge_weights(surface: FusedSurface, active: NDArray[np.intp], sigma_lab: float) -> csr_matrix:
    """Adjacency among the ``active`` voxels: 1 on one smooth surface of one colour, less across edges."""
    among = surface.neighbours[active][:, active].tocsr()
    first = np.repeat(np.arange(len(active)), np.diff(among.indptr))
    second = among.indices
    points, normals = surface.points_world[active], surface.normals_world[active]
    lab = surface.lab[active] * np.array([0.5, 1.0, 1.0], np.float32)
    apart = points[second] - points[first]
    bend = np.einsum("ec,ec->e", apart, normals[second] - normals[first])
    is_crease = bend < _CREASE * np.linalg.norm(apart, axis=1)
    contrast = lab[second] - lab[first]
    weight = np.exp(-np.einsum("ec,ec->e", contrast, contrast) / (2 * sigma_lab**2))
    weight *= np.where(is_crease, _CREASE_WEIGHT, 1.0)
    data = np.maximum(weight, _LEAST_WEIGHT).astype(np.float32)
    return csr_matrix((data, second, among.indptr), shape=among.shape)
