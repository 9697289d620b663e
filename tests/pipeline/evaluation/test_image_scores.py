from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera import PinholeCamera
from pipeline.evaluation.average_precision import average_precision
from pipeline.evaluation.heatmap_auc import auc, like_texture_auc, patch_texture, patches_in_boxes
from pipeline.evaluation.scenediff import UNSCORED, count_masks, score_masks, shown_objects
from pipeline.evaluation.truth_images import nearest_point_image, object_image, point_spacing_m
from pipeline.result import ChangeLabel

UNKNOWN, STATIC, APPEARED, DISAPPEARED, MOVED = ChangeLabel


def test_average_precision_by_hand() -> None:
    # Precisions 1, 1/2, 2/3 at recalls 1/4, 1/4, 2/4: the envelope lifts nothing above 2/3 after the first.
    assert average_precision([0.9, 0.8, 0.7], [True, False, True], 4) == pytest.approx(0.25 + 0.25 * 2 / 3)
    assert average_precision([0.7, 0.9, 0.8], [True, False, False], 1) == pytest.approx(1 / 3)
    assert average_precision([], [], 3) == 0
    assert average_precision([0.5], [False], 0) is None
    assert average_precision([0.1, 0.2], [True, True], 2) == 1


def image(*blocks: tuple[int, int, int]) -> np.ndarray:
    """A 10 x 40 image with columns [start, stop) set to a number."""
    picture = np.zeros((10, 40), dtype=np.int64)
    for start, stop, number in blocks:
        picture[:, start:stop] = number
    return picture


def test_masks_are_counted_and_small_or_unscored_ones_left_out() -> None:
    true = image((0, 6, 1), (10, 11, 2), (20, 30, UNSCORED))  # object 2 has 10 pixels
    predicted = image((2, 8, 11), (20, 24, 12), (28, 33, 13))
    masks = count_masks(1, true, predicted)
    assert masks.true_px == {1: 60}
    assert masks.predicted_px == {11: 60, 13: 50}  # 12 lies on what is not scored, 13 mostly does not
    assert masks.shared_px == {(1, 11): 40}
    assert masks.changed_px == (40, 60 + 10 + 20 + 30)  # shared; and 1, 2, the rest of 11 and of 13
    assert masks.best_match(11) is None  # 40 of 80: exactly half is not above half
    assert count_masks(1, image((0, 6, 1)), image((1, 7, 11))).best_match(11) == 1


def test_scenediff_counted_by_hand() -> None:
    frames = [
        # Object 1 disappeared, found by 11; 12 is a second, less certain mask on it.
        count_masks(0, image((0, 10, 1), (20, 30, 3)), image((0, 8, 11), (20, 30, 13))),
        count_masks(0, image((0, 4, 1)), image((0, 4, 12))),
        # Object 3 moved; in the current visit 13 misses it. Object 2 appeared and nobody saw it.
        count_masks(1, image((0, 10, 3), (20, 30, 2)), image((30, 36, 13))),
    ]
    labels = {11: DISAPPEARED, 12: DISAPPEARED, 13: MOVED}
    scores = score_masks(frames, {11: 0.9, 12: 0.5, 13: 0.7}, labels, moved_true={3})
    # Masks: 11 right, 13 right and wrong, 12 right in its own image: 5 true masks.
    assert (scores.true_masks, scores.predicted_masks) == (5, 4)
    assert scores.per_image == pytest.approx(2 / 5 * 1 + 1 / 5 * 3 / 4)
    # Objects: 1, 3 before, 3 after, 2; 12 is the second on object 1: a false positive.
    assert (scores.true_objects, scores.predicted_objects) == (4, 4)
    assert scores.per_scene == pytest.approx(2 / 4)
    assert scores.pixel_iou == pytest.approx((80 + 100 + 40) / (100 + 100 + 40 + 100 + 100 + 60))
    # With change type: 1, 2 and the move; only 11 is right, the move needs both visits.
    assert scores.true_typed_objects == 3
    assert scores.per_scene_typed == pytest.approx(1 / 3)


def test_a_move_is_right_when_both_visits_show_the_same_object() -> None:
    frames = [count_masks(v, image((0, 10, 3)), image((0, 9, 13))) for v in (0, 1)]
    right = score_masks(frames, {13: 0.7}, {13: MOVED}, moved_true={3})
    assert right.per_scene_typed == right.per_scene == 1
    assert score_masks(frames, {13: 0.7}, {13: MOVED}, moved_true=set()).per_scene_typed == 0
    one_side = score_masks(frames[:1], {13: 0.7}, {13: MOVED}, moved_true={3})
    assert (one_side.per_scene_typed, one_side.per_scene) == (0, 1)


def test_shown_objects() -> None:
    owner = np.array([0, 0, 1, 1, 2, 4, 4])
    label = np.array([255, 1, STATIC, STATIC, MOVED, 255, 255])
    assert shown_objects(owner, label).tolist() == [0, 0, 2, 0, UNSCORED]


CAMERA = PinholeCamera(60, 40, 50.0, 50.0, 29.5, 19.5)


def wall(depth: float, low: float, high: float, step: float = 0.02) -> np.ndarray:
    """Points of a square wall facing the camera, x and y in [low, high)."""
    x, y = np.meshgrid(np.arange(low, high, step), np.arange(low, high, step))
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, depth)], axis=1).astype(np.float32)


def test_the_nearest_point_hides_what_lies_behind() -> None:
    points = np.array([[0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [0.2, 0.0, 2.0], [0, 0, -1]], dtype=np.float32)
    rows = nearest_point_image(points, CAMERA, np.eye(4), 0.0)
    assert rows[20, 30] == 1  # 19.5 and 29.5 round to the even pixel
    assert rows[20, 34] == 2
    assert (rows >= 0).sum() == 2
    wide = nearest_point_image(points[:1], CAMERA, np.eye(4), 0.12)  # 3 px at 2 m
    assert np.argwhere(wide == 0).tolist() == [[v, u] for v in (19, 20, 21) for u in (29, 30, 31)]


def test_objects_are_closed_and_keep_their_silhouette() -> None:
    rng = np.random.default_rng(0)
    near, far = wall(1.0, -0.1, 0.1, 0.01), wall(2.0, -0.6, 0.6, 0.01)
    points = np.concatenate([near, far])
    owner = np.repeat([7, 0], [len(near), len(far)])
    kept = rng.random(len(points)) < 0.6  # holes, as thinning leaves them
    picture = object_image(points[kept], owner[kept], CAMERA, np.eye(4), 0.02)
    full = np.zeros_like(picture, dtype=bool)
    full[14:25, 24:35] = True  # from -0.1 to 0.09 m at 1 m: pixels 24.5 (rounds to 24) to 34
    iou = (full & (picture == 7)).sum() / (full | (picture == 7)).sum()
    assert iou > 0.95
    assert (picture[17:23, 27:33] == 7).all()
    hidden = object_image(points, np.where(owner == 7, 0, 5), CAMERA, np.eye(4), 0.02)
    assert (hidden[17:23, 27:33] == 0).all()  # the wall behind does not shine through


def test_point_spacing() -> None:
    assert point_spacing_m(wall(1.0, 0, 0.2)) == pytest.approx(0.02, rel=1e-3)
    assert point_spacing_m(np.zeros((1, 3), np.float32)) == 0


def test_auc_by_hand() -> None:
    changed = np.array([True, True, False, False])
    assert auc(np.array([4.0, 2, 3, 1]), changed) == 0.75
    assert auc(np.array([1.0, 1, 1, 1]), changed) == 0.5
    assert auc(np.array([1.0, 2]), np.array([True, True])) is None


def test_like_texture_auc_by_hand() -> None:
    # Changed patches are textured; among the textured ones the score says nothing. The parts meet at 5.5.
    changed = np.array([True, True, False, False, False, False])
    texture = np.array([5.0, 6, 5, 6, 0, 0])
    score = np.array([1.0, 1, 1, 1, 0, 0])
    assert auc(score, changed) == 0.75
    assert like_texture_auc(score, changed, texture, parts=2) == pytest.approx(((0.5 + 1 + 1) / 3 + 0.5) / 2)
    textured = texture > 1
    assert like_texture_auc(score[textured], changed[textured], texture[textured], parts=2) == 0.5
    assert like_texture_auc(score, np.zeros(6, bool), texture) is None


@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), min_size=2, max_size=30))
def test_auc_is_the_chance_of_the_right_order(pairs: list[tuple[int, bool]]) -> None:
    score, changed = (np.array(column) for column in zip(*pairs, strict=True))
    expected = [1.0 if a > b else 0.5 if a == b else 0.0 for a in score[changed] for b in score[~changed]]
    value = auc(score.astype(float), changed.astype(bool))
    assert value == (pytest.approx(np.mean(expected)) if expected else None)


def test_patches_and_boxes() -> None:
    inside = patches_in_boxes([(0, 0, 20, 9), (30, 20, 40, 40)], (4, 4), (40, 40))  # centres at 5, 15, ...
    assert np.argwhere(inside).tolist() == [[0, 0], [0, 1], [2, 3], [3, 3]]
    flat = np.full((40, 40, 3), 90, np.uint8)
    assert patch_texture(flat, (4, 4)).max() == 0
    flat[:20, :20] = np.indices((20, 20)).sum(axis=0)[..., None] % 4 // 2 * 200
    texture = patch_texture(flat, (4, 4))
    assert texture[:2, :2].min() > texture[2:, 2:].max()
