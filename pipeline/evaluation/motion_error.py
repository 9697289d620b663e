"""Distances between rigid motions, up to the symmetry of what moved.

A turn of an n-fold symmetric object by 1/n of a circle cannot be seen, so the error of a motion is the
smallest over all turns that look alike. Turns are about the object's up axis in the previous visit, taken
to be the world's up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import transform_points

_TRIED_ANGLES = 72  # of an object that looks alike at any angle, where no closed form exists


def rotation_about(axis: NDArray[np.float64], angle_rad: float) -> NDArray[np.float64]:
    """(3, 3) rotation about a unit axis (3,) by an angle (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle_rad) * cross + (1 - np.cos(angle_rad)) * (cross @ cross)


def rotation_error_rad(
    predicted: NDArray[np.float64],
    true: NDArray[np.float64],
    up_world: NDArray[np.float64],
    symmetry_order: int,
) -> float:
    """Smallest angle between a predicted (3, 3) rotation and the true one turned by a symmetry."""
    # trace(P' T Rot(up, a)) = constant + along cos(a) + across sin(a)
    relative = np.asarray(predicted).T @ np.asarray(true)
    constant, along, across = _trace_terms(relative, up_world)
    if symmetry_order == 0:
        return _angle(constant + float(np.hypot(along, across)))
    angles = _angles(symmetry_order)
    return _angle(float(np.max(constant + along * np.cos(angles) + across * np.sin(angles))))


def angle_only_error_rad(
    predicted_rad: float, true: NDArray[np.float64], up_world: NDArray[np.float64], symmetry_order: int
) -> float:
    """Least error of a prediction that gives the angle of its rotation, but not the axis: a lower bound."""
    constant, along, across = _trace_terms(np.asarray(true), up_world)
    if symmetry_order == 0:
        least = _angle(constant + float(np.hypot(along, across)))
        most = _angle(constant - float(np.hypot(along, across)))
        return max(0.0, least - predicted_rad, predicted_rad - most)
    traces = constant + along * np.cos(_angles(symmetry_order)) + across * np.sin(_angles(symmetry_order))
    return min(abs(predicted_rad - _angle(float(trace))) for trace in traces)


def transform_error_m(
    T_predicted: NDArray[np.float64],
    T_true: NDArray[np.float64],
    points_world: NDArray[np.float64],
    up_world: NDArray[np.float64],
    symmetry_order: int,
) -> float:
    """Root mean square distance of points (N, 3) under two motions, least over the object's symmetries.

    The axis of symmetry goes through the points' centre. Any angle (order 0) is tried in 72 steps.
    """
    centre = points_world.mean(axis=0)
    predicted = transform_points(T_predicted, points_world)
    errors = []
    for angle in _angles(symmetry_order or _TRIED_ANGLES):
        turned = (points_world - centre) @ rotation_about(up_world, float(angle)).T + centre
        distance = predicted - transform_points(T_true, turned)
        errors.append(float(np.sqrt(np.mean(np.sum(distance**2, axis=1)))))
    return min(errors)


def _trace_terms(rotation: NDArray[np.float64], up_world: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = up_world
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    constant = float(up_world @ rotation @ up_world)
    return constant, float(np.trace(rotation)) - constant, float(np.trace(rotation @ cross))


def _angles(order: int) -> NDArray[np.float64]:
    return 2 * np.pi * np.arange(order) / order


def _angle(trace: float) -> float:
    return float(np.arccos(np.clip((trace - 1) / 2, -1.0, 1.0)))
