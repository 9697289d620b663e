"""Lighting fitted and taken out, and how differently a place looks."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.change.appearance import MIN_SCALE, appearance_residual
from pipeline.change.colocation import nearest_instances, overlap_matrix


def sphere_of_voxels(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals in all directions, and log colours."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals.astype(np.float32), rng.uniform(3, 5, (count, 3)).astype(np.float32)


def relit(colours: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The same surfaces under a warmer light that comes from elsewhere."""
    gain = np.array([0.3, 0.1, -0.1])
    shading = 0.25 * normals[:, 0] - 0.1 * normals[:, 2] + 0.15 * normals[:, 0] * normals[:, 1]
    return (colours + gain + shading[:, None]).astype(np.float32)


def test_gain_and_shading_are_recovered_while_a_changed_object_stays() -> None:
    normals, colours = sphere_of_voxels(4000)
    other = relit(colours, normals)
    changed = np.arange(4000) < 600  # 15 % of the place
    other[changed] += np.array([0.8, -0.5, 0.6], np.float32)

    found = appearance_residual(colours, other, np.ones(4000, bool), normals)

    assert np.abs(found.residual[~changed]).max() < 0.03
    assert found.residual[changed].mean(axis=0) == pytest.approx([0.8, -0.5, 0.6], abs=0.03)
    assert found.scale == MIN_SCALE


def test_scale_is_the_noise_of_appearance() -> None:
    normals, colours = sphere_of_voxels(4000)
    noise = np.random.default_rng(3).normal(0, 0.1, (4000, 3)).astype(np.float32)

    found = appearance_residual(colours, colours + noise, np.ones(4000, bool), normals)

    # 1.48 times the median length of a 3D Gaussian of 0.1: 1.48 * 0.1538.
    assert found.scale == pytest.approx(0.2276, rel=0.08)


def test_voxels_that_are_not_compared_have_no_residual_and_no_say() -> None:
    normals, colours = sphere_of_voxels(1000)
    compared = np.arange(1000) % 2 == 0
    other = relit(colours, normals)
    other[~compared] = 99.0

    found = appearance_residual(colours, other, compared, normals)

    assert not found.residual[~compared].any()
    assert np.abs(found.residual[compared]).max() < 0.03


def test_too_few_voxels_are_not_fitted() -> None:
    normals, colours = sphere_of_voxels(7)

    found = appearance_residual(colours, colours + 0.5, np.ones(7, bool), normals)

    assert found.residual == pytest.approx(0.5, abs=1e-6)
    assert np.isfinite(found.scale)


def grid(x0: float, count: int) -> np.ndarray:
    return np.stack([x0 + 0.1 * np.arange(count), np.zeros(count), np.zeros(count)], axis=1).astype(
        np.float32
    )


def test_overlap_of_places_is_intersection_over_union() -> None:
    # Ten voxels from 0.0 and ten from 0.5: five in common, fifteen in all.
    points0, points1 = grid(0.0, 10), grid(0.5, 10)
    ones = np.ones(10, np.int32)
    nearest0 = nearest_instances(points0, ones, points1, ones, 0.02)
    nearest1 = nearest_instances(points1, ones, points0, ones, 0.02)

    overlap = overlap_matrix(ones, nearest0, 1, ones, nearest1, 1)

    assert overlap == pytest.approx(np.array([[5 / 15]]))


def test_objects_apart_and_background_share_nothing() -> None:
    points0, points1 = grid(0.0, 4), grid(9.0, 4)
    ones, background = np.ones(4, np.int32), np.zeros(4, np.int32)

    assert not nearest_instances(points0, ones, points1, ones, 0.02).any()
    assert not nearest_instances(points0, ones, points0, background, 0.02).any()
    assert not nearest_instances(points0, background, points0, ones, 0.02).any()
