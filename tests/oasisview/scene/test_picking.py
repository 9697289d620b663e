from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oasisview.scene.picking import first_hit, pick_object

RNG = np.random.default_rng(0)


def patch(x: float, object_id: int, size: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A square of points across the x axis."""
    y, z = np.meshgrid(np.arange(-size, size, 0.02), np.arange(-size, size, 0.02))
    points = np.stack([np.full(y.size, x), y.ravel(), z.ravel()], axis=1).astype(np.float32)
    return points, np.full(len(points), object_id, np.int32)


ALONG_X = np.array([1.0, 0.0, 0.0])
ORIGIN = np.zeros(3)
NOTHING = np.zeros((0, 3), np.float32)


def test_the_front_one_of_two_objects_is_meant() -> None:
    near, near_ids = patch(2.0, 7, 0.1)
    far, far_ids = patch(3.0, 8)
    points, ids = np.concatenate([far, near]), np.concatenate([far_ids, near_ids])
    hit = first_hit(ORIGIN, ALONG_X, points, ids, 0.03)
    assert hit is not None and hit.object_id == 7 and hit.distance_m == pytest.approx(2.0)
    beside = first_hit(np.array([0, 0.3, 0]), ALONG_X, points, ids, 0.03)
    assert beside is not None and beside.object_id == 8
    assert first_hit(ORIGIN, -ALONG_X, points, ids, 0.03) is None
    assert first_hit(ORIGIN, np.zeros(3), points, ids, 0.03) is None
    assert first_hit(ORIGIN, ALONG_X, NOTHING, np.zeros(0, int), 0.03) is None


def test_a_wall_in_front_hides_an_object_but_the_floor_beside_it_does_not() -> None:
    points, ids = patch(3.0, 8)
    wall, _ = patch(1.0, 0)
    beside = wall + np.array([0, 0.6, 0], np.float32)
    pick = dict(radius_m=0.03, point_size_m=0.03)
    assert pick_object(ORIGIN, ALONG_X, points, ids, NOTHING, **pick) == 8
    assert pick_object(ORIGIN, ALONG_X, points, ids, wall, **pick) is None
    assert pick_object(ORIGIN, ALONG_X, points, ids, beside, **pick) == 8


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10))
def test_the_hit_is_the_nearest_point_of_those_within_the_radius(seed: int, length: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-2, 2, (300, 3)).astype(np.float32)
    origin, direction = rng.uniform(-3, 3, 3), rng.normal(size=3)
    hit = first_hit(origin, direction * length, points, np.arange(300), 0.3)
    unit = direction / np.linalg.norm(direction)
    along = (points - origin) @ unit
    across = np.linalg.norm(points - origin - along[:, None] * unit, axis=1)
    near = np.flatnonzero((along > 1e-4) & (across < 0.3 - 1e-4))
    if hit is None:
        assert len(near) == 0
    else:
        assert across[hit.object_id] < 0.3 + 1e-3
        assert len(near) == 0 or hit.distance_m <= along[near].min() + 1e-3
