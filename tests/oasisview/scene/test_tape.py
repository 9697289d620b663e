from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview.scene.tape import Measurement, exact_length, point_on_ray

UP = (0.0, 0.0, 1.0)


def test_words_of_level_upright_and_slanted_distances() -> None:
    assert Measurement((0, 0, 0), (3, 4, 0), UP).words() == "5.00 m"
    assert Measurement((0, 0, 0), (0, 0, 0.5), UP).words() == "50.0 cm"
    assert Measurement((1, 1, 0), (1, 4, -4), UP).words() == "5.00 m (3.00 m across, 4.00 m down)"
    assert exact_length(0.0432) == "4.3 cm"
    assert exact_length(12.346) == "12.35 m"


@given(
    st.tuples(*[st.floats(-50, 50)] * 3),
    st.tuples(*[st.floats(-50, 50)] * 3),
    st.tuples(*[st.floats(-1, 1)] * 3),
)
def test_level_and_rise_make_up_the_length(start, end, up) -> None:
    norm = float(np.linalg.norm(up))
    if norm < 0.1:
        return
    upright = tuple(float(v) / norm for v in up)
    measured = Measurement(start, end, upright)
    assert measured.level_m**2 + measured.rise_m**2 == pytest.approx(measured.length_m**2, abs=1e-6)
    back = Measurement(end, start, upright)
    assert back.length_m == pytest.approx(measured.length_m)
    assert back.rise_m == pytest.approx(-measured.rise_m, abs=1e-9)


def test_a_click_means_the_frontmost_surface_and_on_it_the_nearest_point() -> None:
    near = np.array([[x, y, 2.0] for x in (-0.01, 0.0, 0.01) for y in (-0.01, 0.0, 0.01)])
    wall = near + np.array([0, 0, 3.0])
    found = point_on_ray(np.zeros(3), np.array([0, 0, 2.0]), np.concatenate([wall, near]), 0.03)
    np.testing.assert_allclose(found, [0, 0, 2.0], atol=1e-6)
    assert point_on_ray(np.zeros(3), np.array([1.0, 0, 0]), near, 0.03) is None  # nothing there
    assert point_on_ray(np.zeros(3), np.array([0, 0, -1.0]), near, 0.03) is None  # behind the eye
    assert point_on_ray(np.zeros(3), np.zeros(3), near, 0.03) is None
    assert point_on_ray(np.zeros(3), np.array([0, 0, 1.0]), np.zeros((0, 3)), 0.03) is None


@given(st.integers(0, 1000))
def test_what_is_found_is_a_point_near_the_ray(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-2, 2, (300, 3)).astype(np.float32)
    origin, direction = rng.uniform(-3, 3, 3), rng.normal(size=3)
    found = point_on_ray(origin, direction, points, 0.3)
    unit = direction / np.linalg.norm(direction)
    along = (points - origin) @ unit
    across = np.linalg.norm(points - origin - along[:, None] * unit, axis=1)
    near = (along > 1e-3) & (across < 0.299)
    if found is None:
        assert not near.any()
        return
    assert (points == found.astype(np.float32)).all(axis=1).any()
    if near.any():
        assert (found - origin) @ unit <= along[near].min() + 0.6 + 1e-3
