from __future__ import annotations

import numpy as np
import pytest

from oasisview.scene.names import readable

VIEW = dict(fov_rad=np.pi / 2, width_px=800, height_px=600)  # 300 px a unit at depth 1


def test_the_first_of_names_that_cover_each_other_is_shown() -> None:
    places = [[0, 0, 3], [0.1, 0, 3], [1, 0, 3], [0, 0.1, 3], [0, 0.5, 3]]
    assert readable(places, np.eye(4), **VIEW).tolist() == [True, False, True, False, True]


def test_what_is_behind_or_outside_the_view_is_not_shown() -> None:
    places = [[0, 0, -3], [5, 0, 3], [0, 4, 3], [0, 0, 3]]
    assert readable(places, np.eye(4), **VIEW).tolist() == [False, False, False, True]


def test_limit_taken_places_and_the_camera_pose() -> None:
    places = [[float(x), 0, 0] for x in range(-3, 4)]
    T = np.eye(4)
    T[2, 3] = -5
    assert readable(places, T, **VIEW).all()
    assert readable(places, T, **VIEW, limit=2).sum() == 2
    assert readable(places, T, **VIEW, taken_px=[(0, 0)]).tolist() == [True] * 3 + [False] + [True] * 3
    assert readable(np.zeros((0, 3)), T, **VIEW).shape == (0,)


@pytest.mark.parametrize("seed", range(5))
def test_shown_names_never_overlap(seed: int) -> None:
    places = np.random.default_rng(seed).uniform([-2, -1, 2], [2, 1, 4], (60, 3))
    shown = places[readable(places, np.eye(4), **VIEW)]
    pixels = shown[:, :2] / shown[:, 2:] * 300
    gaps = np.abs(pixels[:, None] - pixels[None])
    close = (gaps[..., 0] < 46) & (gaps[..., 1] < 20)
    assert close.sum() == len(shown)
