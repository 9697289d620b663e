from __future__ import annotations

import numpy as np
import pytest

from oasisview import heatmap_colours as colours


def test_the_ramp_goes_from_first_to_last_anchor() -> None:
    table = colours.ramp(colours.CIVIDIS)
    assert table.shape == (256, 3)
    assert tuple(table[0]) == colours.rgb(colours.CIVIDIS[0])
    assert tuple(table[-1]) == colours.rgb(colours.CIVIDIS[-1])
    luminance = table @ [0.299, 0.587, 0.114]
    assert (np.diff(luminance) > -1).all() and luminance[-1] > luminance[0] + 100


def test_semantic_ends_are_dark_and_bright_and_unseen_is_hatched_grey() -> None:
    heatmap = np.array([[0.0, 1.0], [np.nan, 0.0]])
    image = colours.colour_semantic(heatmap, 80, 80)
    assert image.shape == (80, 80, 3) and image.dtype == np.uint8
    assert tuple(image[0, 0]) == colours.rgb(colours.CIVIDIS[0])
    assert tuple(image[0, 79]) == colours.rgb(colours.CIVIDIS[-1])
    unseen = image[45:80, :40].reshape(-1, 3)
    assert (np.ptp(unseen, axis=1) == 0).all()
    assert len(np.unique(unseen, axis=0)) == 2


@pytest.mark.parametrize("dark", [False, True])
def test_geometric_is_purple_for_gone_orange_for_new_and_clips(dark: bool) -> None:
    values = np.array([[-0.5, 0.0, 0.5, -9.0, 9.0]])
    image = colours.colour_geometric(values, 1, 5, dark=dark)
    gone, same, new, far_gone, far_new = image[0].astype(int)
    assert gone[2] > gone[1] and new[0] > new[2]
    assert (far_gone == gone).all() and (far_new == new).all()
    assert np.ptp(same) < 12
    assert (same.mean() < 60) == dark


def test_all_nan_is_all_hatch() -> None:
    image = colours.colour_geometric(np.full((4, 4), np.nan), 40, 40, dark=False)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) == 2


def test_text_in_a_cell_can_be_read() -> None:
    for value in np.linspace(0, 1, 21):
        ground, ink = (np.array(colours.rgb(c)) @ [0.299, 0.587, 0.114] for c in colours.share_colour(value))
        assert abs(ground - ink) > 90
    assert colours.share_colour(float("nan")) == colours.share_colour(0.0)
