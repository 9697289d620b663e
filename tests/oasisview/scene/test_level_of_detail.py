from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from oasisview.scene.level_of_detail import ceiling_height, point_spacing_m, thin


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 3000), st.integers(1, 2000))
def test_thinning_keeps_to_the_limit_and_to_real_points(seed: int, count: int, limit: int) -> None:
    points = np.random.default_rng(seed).uniform(-5, 5, (count, 3)).astype(np.float32)
    kept = thin(points, limit)
    assert 1 <= len(kept) <= limit
    assert len(np.unique(kept)) == len(kept) and (np.diff(kept) > 0).all()
    assert kept.max() < count
    if count <= limit:
        assert len(kept) == count


def test_thinning_covers_the_whole_extent_and_is_not_wasteful() -> None:
    grid = np.stack(np.meshgrid(np.arange(400), np.arange(400)), -1).reshape(-1, 2) * 0.01
    points = np.column_stack([grid, np.zeros(len(grid))]).astype(np.float32)
    kept = points[thin(points, 10_000)]
    assert len(kept) > 3_000
    assert np.ptp(kept[:, 0]) > 3.9 and np.ptp(kept[:, 1]) > 3.9
    gaps = np.linalg.norm(points[::97, None] - kept[None], axis=-1).min(axis=1)
    assert gaps.max() < 0.15


def test_thinning_nothing_and_identical_points() -> None:
    assert len(thin(np.zeros((0, 3), np.float32), 5)) == 0
    assert len(thin(np.zeros((100, 3), np.float32), 5)) == 1
    assert len(thin(np.zeros((100, 3), np.float32), 0)) == 0


def test_spacing_of_a_grid() -> None:
    grid = np.stack(np.meshgrid(np.arange(50), np.arange(50), [0]), -1).reshape(-1, 3) * 0.05
    assert point_spacing_m(grid) == pytest.approx(0.05)
    assert point_spacing_m(np.zeros((1, 3))) > 0


def test_a_ceiling_is_found_and_shelves_are_not() -> None:
    rng = np.random.default_rng(1)
    cameras = rng.uniform(1.4, 1.7, 20)
    floor, walls = np.zeros(4000), rng.uniform(0, 2.6, 4000)
    room = np.concatenate([floor, walls, np.full(3000, 2.6)])
    height = ceiling_height(room, cameras)
    assert height is not None and 2.3 < height < 2.6
    assert ceiling_height(np.concatenate([floor, walls]), cameras) is None
    assert ceiling_height(np.zeros(0), cameras) is None
