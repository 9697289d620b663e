from __future__ import annotations

import numpy as np
import pytest

from pipeline.correspondence.heatmaps import geometric_heatmap, semantic_heatmap
from pipeline.perception.protocols import SimilarityScale

SCALE = SimilarityScale(threshold=0.9, softness=0.02)


def test_geometric_sign_is_the_current_visits_in_the_images_of_both() -> None:
    # A box 2 m away before a wall 3 m away. It stands there in the current visit only.
    with_box, wall = np.array([[2.0, 3.0]], np.float32), np.array([[3.0, 3.0]], np.float32)

    in_current = geometric_heatmap(with_box, wall, own_is_current=True)
    in_previous = geometric_heatmap(wall, with_box, own_is_current=False)

    assert in_current.tolist() == [[1.0, 0.0]]  # + newly appeared foreground
    assert in_previous.tolist() == [[1.0, 0.0]]


def test_geometric_is_negative_where_foreground_is_gone() -> None:
    with_box, wall = np.array([[2.0]], np.float32), np.array([[3.0]], np.float32)

    assert geometric_heatmap(wall, with_box, own_is_current=True)[0, 0] == -1.0
    assert geometric_heatmap(with_box, wall, own_is_current=False)[0, 0] == -1.0


@pytest.mark.parametrize(("own", "other"), [(0.0, 2.0), (2.0, 0.0), (0.0, 0.0)])
def test_geometric_is_nan_where_either_depth_is_unknown(own: float, other: float) -> None:
    heat = geometric_heatmap(np.array([[own]], np.float32), np.array([[other]], np.float32), True)

    assert np.isnan(heat[0, 0])
    assert heat.dtype == np.float32


def test_semantic_is_half_at_the_threshold_and_73_percent_one_softness_below() -> None:
    heat = semantic_heatmap(np.array([[0.9, 0.88, 0.92]], np.float32), SCALE, 0.0)

    # 1 / (1 + e^-1) = 0.731
    assert heat[0] == pytest.approx([0.5, 0.7311, 0.2689], abs=1e-3)


def test_semantic_spans_zero_to_one_without_overflow() -> None:
    heat = semantic_heatmap(np.array([[-1.0, 1.0]], np.float32), SCALE, 0.0)

    assert heat[0, 0] == pytest.approx(1, abs=1e-6)
    assert heat[0, 1] == pytest.approx(0, abs=1e-2)
    assert ((heat >= 0) & (heat <= 1)).all()


def test_semantic_nan_neither_spreads_nor_pulls_its_neighbours() -> None:
    best = np.full((5, 5), 0.95, np.float32)
    best[2, 2] = np.nan

    smooth = semantic_heatmap(best, SCALE, 1.0)

    assert np.isnan(smooth[2, 2])
    seen = np.isfinite(best)
    assert np.isfinite(smooth[seen]).all()
    assert smooth[seen] == pytest.approx(semantic_heatmap(best, SCALE, 0.0)[seen], abs=1e-4)


def test_semantic_smoothing_calms_a_single_bad_patch() -> None:
    best = np.full((7, 7), 0.95, np.float32)
    best[3, 3] = 0.80

    assert semantic_heatmap(best, SCALE, 0.0)[3, 3] > 0.99
    assert semantic_heatmap(best, SCALE, 1.0)[3, 3] < 0.5


def test_semantic_of_a_keyframe_that_nobody_shares_is_nan_throughout() -> None:
    assert np.isnan(semantic_heatmap(np.full((3, 4), np.nan, np.float32), SCALE, 1.0)).all()


NOISY = SimilarityScale(threshold=0.9, softness=0.02, noise=0.02)


def test_semantic_of_a_keyframe_that_is_noisy_throughout_is_calmed_and_its_change_stays() -> None:
    best = np.full((8, 8), 0.88, np.float32)  # other exposure: unchanged places lack 0.12 instead of 0.02
    best[2:4, 2:4] = 0.5

    assert semantic_heatmap(best, SCALE, 0.0)[7, 7] > 0.7
    calmed = semantic_heatmap(best, NOISY, 0.0)
    assert calmed[7, 7] < 0.3
    assert calmed[2, 2] > 0.99


def test_semantic_of_a_quiet_keyframe_is_left_alone() -> None:
    best = np.linspace(0.8, 0.999, 64, dtype=np.float32).reshape(8, 8)
    best[2:] = 0.99

    assert semantic_heatmap(best, NOISY, 0.0) == pytest.approx(semantic_heatmap(best, SCALE, 0.0))


def test_semantic_of_a_keyframe_that_changed_throughout_stays_changed() -> None:
    assert (semantic_heatmap(np.full((6, 6), 0.5, np.float32), NOISY, 0.0) > 0.99).all()
