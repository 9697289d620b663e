from __future__ import annotations

import numpy as np

from oasisview.scene.ghost import paled
from oasisview.scene.map_points import GROUND_RGB


def test_a_ghost_is_paler_than_what_it_shows_on_either_ground() -> None:
    colours = np.random.default_rng(0).integers(0, 256, (200, 3)).astype(np.uint8)
    for dark in (False, True):
        ground = np.array(GROUND_RGB[dark], float)
        pale = paled(colours, dark=dark)
        assert pale.dtype == np.uint8
        before, after = np.abs(colours - ground), np.abs(pale - ground)
        assert (after <= before + 0.5).all()
        assert after.sum() < 0.6 * before.sum()
