"""Robust point-to-plane ICP between two surfaces that lie almost on each other already.

Nothing is assumed about the place. What changed between the surfaces is many residuals far beyond the
others, which the Geman-McClure weight takes out; directions that the shape of the place leaves open (along a
corridor, about the axis of a pipe) are found as small eigenvalues of the normal matrix, and no step is taken
along them (solution remapping: Zhang, Kaess and Singh, On degeneracy of optimization-based state estimation
problems, 2016).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.camera import rotate_points, transform_points

UNKNOWNS = 6
_MIN_NORMAL_COSINE = 0.7  # what faces elsewhere is another side of a thin thing
_NARROWING = 0.6  # of the search distance from one level to the next
_STEPS_PER_LEVEL = 4
_LAST_STEPS = 15
_CONVERGED = 0.002  # of a voxel
_LEAST_SCALE_VOXELS = 0.15
_SCALE_PER_MEDIAN = 2.0 * 1.4826
_MIN_MATCHES = 100
_SPREAD_VOXELS = 0.3  # of well fitted surfaces, to weigh a prior with


@dataclass(frozen=True)
class SurfaceFit:
    """How a surface was laid on another.

    Attributes:
        T_target_source: (4, 4) the correction; the identity along directions that are loose.
        residual_before_m, residual_after_m: median distance of the matched points from the target's planes.
        cost_before, cost_after: mean robust cost, 0..1; points without a match cost 1.
        matched: share of the points that found a counterpart at the end.
        conditioning: (6,) ascending eigenvalues of the normal matrix, rotations scaled by the extent of the
            surface, so that all of them are shares of 1.
        loose_directions: how many of the six cannot be told from these surfaces.
        displacement_m: how far the correction moves the matched points, root mean square.
    """

    T_target_source: NDArray[np.float64]
    residual_before_m: float
    residual_after_m: float
    cost_before: float
    cost_after: float
    matched: float
    conditioning: NDArray[np.float64]
    loose_directions: int
    displacement_m: float


@dataclass(frozen=True)
class MotionPrior:
    """How large a motion is to be expected, so that what the surfaces hold weakly does not run away.

    Attributes:
        origin: (3,) where translations are meant: the camera's centre for the pose of a camera.
        translation_m, rotation_rad: standard deviations.
        matches: what all matches together are worth in independent measurements.
    """

    origin: NDArray[np.float64]
    translation_m: float
    rotation_rad: float
    matches: float


@dataclass(frozen=True)
class _Matches:
    """Counterparts of some source points: positions (n, 3), planes' normals (n, 3), signed distances (n,)."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    distances: NDArray[np.float64]


class SurfaceTarget:
    """A surface that others are laid on.

    Args:
        points: (N, 3) metres.
        normals: (N, 3) unit.
        voxel_m: spacing of the points.
    """

    def __init__(self, points: NDArray[np.float32], normals: NDArray[np.float32], voxel_m: float) -> None:
        self._points = points
        self._normals = normals
        self._voxel_m = voxel_m
        self._tree = cKDTree(points, balanced_tree=False)

    def fit(
        self,
        points: NDArray[np.float32],
        normals: NDArray[np.float32],
        reach_m: float,
        least_reach_m: float,
        *,
        loose_below: float,
        prior: MotionPrior | None = None,
    ) -> SurfaceFit | None:
        """The small motion that lays points on this surface.

        Args:
            points: (n, 3) metres; normals: (n, 3) unit.
            reach_m, least_reach_m: counterparts are looked for within the first distance at the beginning,
                within the second at the end.
            loose_below: directions of smaller eigenvalues of the normal matrix are left as they are.
            prior: of the motion; None = any is as likely.

        Returns:
            None when too few points find a counterpart, or every direction is loose.
        """
        if len(points) < _MIN_MATCHES or not len(self._points):
            return None
        T, made = np.eye(4), np.zeros(UNKNOWNS)
        centre = points.mean(axis=0, dtype=np.float64)
        lever_m = float(np.sqrt(np.mean(np.sum((points - centre) ** 2, axis=1)))) or 1.0
        pull = _pull(prior, centre, lever_m, _SPREAD_VOXELS * self._voxel_m)
        for reach in _reaches(reach_m, least_reach_m):
            is_last = reach == least_reach_m
            for _ in range(_LAST_STEPS if is_last else _STEPS_PER_LEVEL):
                matches = self._match(points, normals, T, reach)
                if len(matches.points) < _MIN_MATCHES:
                    return None
                scale_m = self._scale(matches, reach)
                step, eigenvalues = _step(matches, centre, lever_m, scale_m, loose_below, pull, made)
                T, made = _motion(step, centre, lever_m) @ T, made + step
                if np.linalg.norm(step) < _CONVERGED * self._voxel_m:
                    break
        loose = int((eigenvalues < loose_below).sum())
        if loose == UNKNOWNS:
            return None
        before = self._match(points, normals, np.eye(4), reach_m)
        after = self._match(points, normals, T, reach_m)
        moved = matches.points - transform_points(np.linalg.inv(T), matches.points)
        return SurfaceFit(
            T_target_source=T,
            residual_before_m=float(np.median(np.abs(before.distances))) if len(before.points) else reach_m,
            residual_after_m=float(np.median(np.abs(after.distances))),
            cost_before=_cost(before, scale_m, len(points)),
            cost_after=_cost(after, scale_m, len(points)),
            matched=len(matches.points) / len(points),
            conditioning=eigenvalues,
            loose_directions=loose,
            displacement_m=float(np.sqrt(np.mean(np.sum(moved**2, axis=1)))),
        )

    def _match(
        self,
        points: NDArray[np.float32],
        normals: NDArray[np.float32],
        T: NDArray[np.float64],
        reach_m: float,
    ) -> _Matches:
        moved = transform_points(T, points.astype(np.float64))
        turned = rotate_points(T[:3, :3], normals.astype(np.float64))
        distance, index = self._tree.query(moved, distance_upper_bound=reach_m, workers=1)
        found = np.flatnonzero(np.isfinite(distance))
        index = index[found]
        agree = np.einsum("nc,nc->n", turned[found], self._normals[index]) > _MIN_NORMAL_COSINE
        found, index = found[agree], index[agree]
        # The mean of both normals: half the noise of either, and second order in the curvature.
        planes = turned[found] + self._normals[index]
        planes /= np.linalg.norm(planes, axis=1, keepdims=True)
        offsets = moved[found] - self._points[index]
        return _Matches(moved[found], planes, np.einsum("nc,nc->n", offsets, planes))

    def _scale(self, matches: _Matches, reach_m: float) -> float:
        """Residuals beyond about this are not believed: from the residuals themselves."""
        spread = _SCALE_PER_MEDIAN * float(np.median(np.abs(matches.distances)))
        return float(np.clip(spread, min(_LEAST_SCALE_VOXELS * self._voxel_m, reach_m), reach_m))


def _reaches(first_m: float, last_m: float) -> list[float]:
    reaches = [first_m]
    while reaches[-1] * _NARROWING > last_m:
        reaches.append(reaches[-1] * _NARROWING)
    return [*reaches, last_m] if reaches[-1] > last_m else [last_m]


def _motion(step: NDArray[np.float64], centre: NDArray[np.float64], lever_m: float) -> NDArray[np.float64]:
    """(4, 4) motion of a step about a centre."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(step[:3] / lever_m)[0]
    T[:3, 3] = centre + step[3:] - T[:3, :3] @ centre
    return T


def _cost(matches: _Matches, scale_m: float, count: int) -> float:
    squared = matches.distances**2
    return float((np.sum(squared / (squared + scale_m**2)) + count - len(squared)) / count)


def _step(
    matches: _Matches,
    centre: NDArray[np.float64],
    lever_m: float,
    scale_m: float,
    loose_below: float,
    pull: NDArray[np.float64],
    made: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """One Gauss-Newton step (rotation times lever, translation; metres) and the eigenvalues (6,).

    ``pull`` (6, 6) weighs the steps ``made`` so far (6,) against the matches; the motion is small enough for
    them to add up.
    """
    levers = (matches.points - centre) / lever_m
    jacobian = np.concatenate([np.cross(levers, matches.normals), matches.normals], axis=1)
    weights = (1 / (1 + (matches.distances / scale_m) ** 2)) ** 2
    weighted = jacobian * (weights / weights.sum())[:, None]
    eigenvalues, eigenvectors = np.linalg.eigh(weighted.T @ jacobian)
    held = eigenvalues >= loose_below
    along = eigenvectors[:, held]
    hessian = np.diag(eigenvalues[held]) + along.T @ pull @ along
    downhill = along.T @ (weighted.T @ -matches.distances - pull @ made)
    return along @ np.linalg.solve(hessian, downhill), eigenvalues


def _pull(
    prior: MotionPrior | None, centre: NDArray[np.float64], lever_m: float, spread_m: float
) -> NDArray[np.float64]:
    """(6, 6) that a prior adds to the normal matrix of mean squared distances of that spread."""
    if prior is None:
        return np.zeros((UNKNOWNS, UNKNOWNS))
    # A step in terms of the motion at the prior's origin: what turns about the centre also shifts the origin.
    x, y, z = (prior.origin - centre) / lever_m
    at_origin = np.eye(UNKNOWNS)
    at_origin[3:, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    deviations_m = np.repeat([prior.rotation_rad * lever_m, prior.translation_m], 3)
    return at_origin.T @ np.diag(spread_m**2 / (prior.matches * deviations_m**2)) @ at_origin
