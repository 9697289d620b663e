"""Where an object of one visit went: its cloud laid over a cloud of the other visit (6-DoF, coloured ICP).

The same thing looks different from its two places: other sides of it were seen, under other light. What a
rigid motion cannot explain away is its shape and the pattern on it, so the clouds are aligned first, and
compared where they overlap. Nearest neighbours are searched in space and colour at once (colour ICP in the
sense of Johnson and Kang, 1999), because a box fits another box at any quarter turn, its print at one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.association.cloud_agreement import ObjectCloud, ObjectRegistration, agreement_under

# Turns about the vertical that are tried, and the sizes of the samples that they are tried with.
_TURNS = 24
_COARSE_SAMPLE, _FINE_SAMPLE = 96, 384
_COARSE_ROUNDS, _FINE_ROUNDS = 3, 8
_REFINED_HYPOTHESES = 6
_COMPARED_SAMPLE = 1500
# The search starts at this share of an object's reach, and ends at the spacing of its points.
_COARSE_STEPS = 16
# A difference of one log unit of colour counts as much as this many spacings of the cloud.
_SPACINGS_PER_LOG_COLOUR = 4.0
# Farther apart than this many spacings, points support no alignment.
_REACH_SPACINGS = 3.0


def register_objects(
    previous: ObjectCloud, current: ObjectCloud, up_world: NDArray[np.floating], spacing_m: float
) -> ObjectRegistration:
    """Find the motion of an object that stands as upright as before, then let go of upright.

    Args:
        previous, current: its clouds, at least one point each.
        up_world: (3,) against gravity.
        spacing_m: distance of neighbouring points.
    """
    up = np.asarray(up_world, np.float64)
    coarse0, coarse1 = previous.sampled(_COARSE_SAMPLE), current.sampled(2 * _COARSE_SAMPLE)
    fine0, fine1 = previous.sampled(_FINE_SAMPLE), current.sampled(2 * _FINE_SAMPLE)
    coarse_m = max(spacing_m, max(_reach_m(previous), _reach_m(current)) / _COARSE_STEPS)
    gain = float(np.median(current.log_colours.mean(axis=1)) - np.median(previous.log_colours.mean(axis=1)))
    rotations, translations = _hypotheses(coarse0, coarse1, up)
    target = _Target(coarse1, gain, coarse_m)
    for _ in range(_COARSE_ROUNDS):
        rotations, translations, cost = target.improve(coarse0, rotations, translations, up)
    cost = target.cost(coarse0, rotations, translations)
    chosen = _distinct(cost, rotations, translations, coarse_m)
    rotations, translations = rotations[chosen], translations[chosen]
    for step in range(_FINE_ROUNDS):
        share = step / (_FINE_ROUNDS - 1)
        target = _Target(fine1, gain, coarse_m ** (1 - share) * (2 * spacing_m) ** share)
        upright = up if step < _FINE_ROUNDS // 2 else None
        rotations, translations, _ = target.improve(fine0, rotations, translations, upright)
    previous, current = previous.sampled(_COMPARED_SAMPLE), current.sampled(_COMPARED_SAMPLE)
    tree = cKDTree(current.points_world)
    found = [
        agreement_under(previous, current, tree, R, t, spacing_m)
        for R, t in zip(rotations, translations, strict=True)
    ]
    return max(found, key=lambda registration: registration.agreement)


def agreement_of(
    previous: ObjectCloud,
    current: ObjectCloud,
    T_world_motion: NDArray[np.float64],
    spacing_m: float,
) -> ObjectRegistration:
    """How well two clouds agree under a motion that is known; arguments as in ``register_objects``."""
    previous, current = previous.sampled(_COMPARED_SAMPLE), current.sampled(_COMPARED_SAMPLE)
    tree = cKDTree(current.points_world)
    rotation, translation = T_world_motion[:3, :3], T_world_motion[:3, 3]
    return agreement_under(previous, current, tree, rotation, translation, spacing_m)


class _Target:
    """The cloud that others are laid over, as points of space and colour."""

    def __init__(self, cloud: ObjectCloud, gain: float, spacing_m: float) -> None:
        self._points = np.asarray(cloud.points_world, np.float64)
        self._origin = self._points.mean(axis=0)
        self._gain, self._spacing_m = gain, spacing_m
        self._features = self._embedded(self._points[None], cloud.log_colours)[0]
        self._norms = (self._features**2).sum(axis=1)

    def _embedded(
        self, points: NDArray[np.float64], log_colours: NDArray[np.floating]
    ) -> NDArray[np.float32]:
        place = (points - self._origin) / self._spacing_m
        colour = np.broadcast_to(log_colours * _SPACINGS_PER_LOG_COLOUR / np.sqrt(3), place.shape)
        return np.concatenate([place, colour], axis=2).astype(np.float32)

    def _nearest(
        self, moved: NDArray[np.float64], cloud: ObjectCloud
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(h, n) nearest target point of every moved point, and its distance in spacings."""
        features = self._embedded(moved, cloud.log_colours + self._gain)
        flat = features.reshape(-1, features.shape[2])
        squared = self._norms[None] - 2 * flat @ self._features.T
        nearest = squared.argmin(axis=1)
        distance = squared[np.arange(len(flat)), nearest] + (flat**2).sum(axis=1)
        shape = moved.shape[:2]
        return nearest.reshape(shape), np.sqrt(np.maximum(distance, 0)).reshape(shape).astype(np.float64)

    def improve(
        self,
        cloud: ObjectCloud,
        rotations: NDArray[np.float64],
        translations: NDArray[np.float64],
        up: NDArray[np.float64] | None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """One round of ICP for (h, 3, 3) rotations and (h, 3) translations at once; ``up`` = yaw only."""
        points = np.asarray(cloud.points_world, np.float64)
        moved = points @ rotations.transpose(0, 2, 1) + translations[:, None]
        nearest, distance = self._nearest(moved, cloud)
        weights = 1.0 / (1.0 + (distance / _REACH_SPACINGS) ** 2) ** 2  # Geman-McClure
        turn, shift = best_motions(moved, self._points[nearest], weights, up)
        return turn @ rotations, (turn @ translations[..., None])[..., 0] + shift, distance.mean(axis=1)

    def cost(
        self, cloud: ObjectCloud, rotations: NDArray[np.float64], translations: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """(h,) mean robust distance, in spacings."""
        points = np.asarray(cloud.points_world, np.float64)
        moved = points @ rotations.transpose(0, 2, 1) + translations[:, None]
        _, distance = self._nearest(moved, cloud)
        return np.minimum(distance, _REACH_SPACINGS).mean(axis=1)


def _hypotheses(
    previous: ObjectCloud, current: ObjectCloud, up: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Turns about the vertical; for each, footprints aligned at their middle and at their four corners.

    Of a thing seen from one side only, the middles of the two clouds are different points of it.
    """
    angles = np.arange(_TURNS) * (2 * np.pi / _TURNS)
    rotations = np.stack([rotation_about(up, angle) for angle in angles])
    frame = _level_frame(up)  # rows: two level axes, up
    before = np.asarray(previous.points_world, np.float64) @ rotations.transpose(0, 2, 1) @ frame.T
    after = np.asarray(current.points_world, np.float64) @ frame.T
    low0, high0 = np.percentile(before, 3, axis=1), np.percentile(before, 97, axis=1)
    low1, high1 = np.percentile(after, 3, axis=0), np.percentile(after, 97, axis=0)
    shifts = []
    for x, y in ((0.5, 0.5), (0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)):
        share = np.array([x, y, 0.0])  # things stand on their bottom
        shifts.append((low1 + share * (high1 - low1)) - (low0 + share * (high0 - low0)))
    translations = np.concatenate(shifts) @ frame
    return np.tile(rotations, (len(shifts), 1, 1)), translations


def _level_frame(up: NDArray[np.float64]) -> NDArray[np.float64]:
    across = np.eye(3)[np.abs(up).argmin()]
    first = np.cross(up, across)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first), up])


def rotation_about(axis: NDArray[np.floating], angle_rad: float) -> NDArray[np.float64]:
    """(3, 3) rotation about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], np.float64)
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * cross @ cross


def best_motions(
    moved: NDArray[np.float64],
    target: NDArray[np.float64],
    weights: NDArray[np.float64],
    up: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted least-squares motions (h, 3, 3), (h, 3) of (h, n, 3) onto (h, n, 3) (Horn, 1987)."""
    weights = weights / weights.sum(axis=1, keepdims=True)
    centre0 = np.einsum("hn,hnd->hd", weights, moved)
    centre1 = np.einsum("hn,hnd->hd", weights, target)
    a, b = moved - centre0[:, None], target - centre1[:, None]
    if up is None:
        covariance = np.einsum("hn,hni,hnj->hij", weights, a, b)
        U, _, Vt = np.linalg.svd(covariance)
        V = Vt.transpose(0, 2, 1)
        V[:, :, 2] *= np.sign(np.linalg.det(V @ U.transpose(0, 2, 1)))[:, None]
        turns = V @ U.transpose(0, 2, 1)
    else:
        sine = np.einsum("hn,hnd,d->h", weights, np.cross(a, b), up)
        cosine = np.einsum("hn,hnd,hnd->h", weights, a, b) - np.einsum("hn,hn,hn->h", weights, a @ up, b @ up)
        turns = np.stack([rotation_about(up, angle) for angle in np.arctan2(sine, cosine)])
    return turns, centre1 - (turns @ centre0[..., None])[..., 0]


def _distinct(
    cost: NDArray[np.float64],
    rotations: NDArray[np.float64],
    translations: NDArray[np.float64],
    spacing_m: float,
) -> list[int]:
    """The cheapest hypotheses that differ from each other."""
    chosen: list[int] = []
    for row in np.argsort(cost, kind="stable"):
        alike = [
            np.trace(rotations[row].T @ rotations[other]) > 1 + 2 * np.cos(0.15)
            and np.linalg.norm(translations[row] - translations[other]) < 4 * spacing_m
            for other in chosen
        ]
        if not any(alike):
            chosen.append(int(row))
        if len(chosen) == _REFINED_HYPOTHESES:
            break
    return chosen


def _reach_m(cloud: ObjectCloud) -> float:
    """Diagonal of the cloud's bounds."""
    low, high = np.percentile(cloud.points_world, [2, 98], axis=0)
    return float(np.linalg.norm(high - low))
