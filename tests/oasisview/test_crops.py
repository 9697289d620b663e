from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview import crops
from oasisview.crops import PixelBox
from pipeline.camera import PinholeCamera
from pipeline.result import PatchLinks

CAMERA = PinholeCamera(320, 240, 300.0, 300.0, 159.5, 119.5)
sizes = st.floats(1, 300)


def test_the_box_of_a_half_size_mask_is_in_pixels_of_the_camera() -> None:
    mask = np.zeros((120, 160), bool)
    mask[10:20, 30:50] = True
    assert crops.mask_box(mask, CAMERA) == PixelBox(60, 20, 40, 20)
    assert crops.mask_box(np.zeros((120, 160), bool), CAMERA) is None


@given(st.floats(0, 319), st.floats(0, 239), sizes, sizes)
def test_a_crop_is_four_by_three_inside_the_image_and_around_the_box(x, y, width, height) -> None:
    box = PixelBox(x, y, min(width, 320 - x), min(height, 240 - y))
    crop = crops.crop_around(box, CAMERA)
    assert crop.width / crop.height == pytest.approx(4 / 3, rel=0.05)
    assert crop.left >= 0 and crop.top >= 0
    assert crop.left + crop.width <= 320 and crop.top + crop.height <= 240
    if crop.width < 300:
        assert crop.left <= box.left + 1 and crop.left + crop.width >= box.left + box.width - 2
        assert crop.top <= box.top + 1 and crop.top + crop.height >= box.top + box.height - 2


def test_a_projected_box_is_where_its_corners_fall() -> None:
    box = crops.project_box(np.array([-0.5, -0.5, 3]), np.array([0.5, 0.5, 3.0001]), CAMERA, np.eye(4))
    assert box is not None
    assert (box.left, box.top, box.width, box.height) == pytest.approx((110, 70, 100, 100), abs=0.1)
    behind = crops.project_box(np.array([-0.5, -0.5, -4]), np.array([0.5, 0.5, -3]), CAMERA, np.eye(4))
    assert behind is None
    half = crops.visible_share(np.array([-1.6, -0.5, 3]), np.array([-1.6 + 0.2, 0.5, 3]), CAMERA, np.eye(4))
    assert 0 < half < 1
    assert crops.visible_share(np.array([9, 9, 3]), np.array([10, 10, 4]), CAMERA, np.eye(4)) == 0


def test_the_outline_goes_around_the_mask() -> None:
    mask = np.zeros((100, 100), bool)
    mask[20:60, 30:80] = True
    path = crops.outline_path(mask)
    numbers = np.array([float(v) for v in path.strip("MZ").replace("L", " ").split()]).reshape(-1, 2)
    assert numbers.min(axis=0) == pytest.approx([30.5, 20.5]) and numbers.max(axis=0) == pytest.approx(
        [79.5, 59.5]
    )
    assert crops.outline_path(np.zeros((10, 10), bool)) == ""


def test_a_click_finds_the_object_and_forgives_one_pixel() -> None:
    mask = np.zeros((10, 20), np.uint16)
    mask[5, 10] = 7
    assert crops.object_at(mask, 10.5 / 20, 5.5 / 10) == 7
    assert crops.object_at(mask, 11.5 / 20, 5.5 / 10) == 7
    assert crops.object_at(mask, 14.5 / 20, 5.5 / 10) == 0
    assert crops.object_at(mask, 1.0, 1.0) == 0


def links(forward: list[int]) -> PatchLinks:
    scores = np.linspace(0.9, 0.5, 4).astype(np.float16)
    back = np.array([0, 1, 2, 3], np.uint16)
    return PatchLinks(np.array(forward, np.uint16), scores, back, scores, (2, 2), (2, 2))


def test_links_start_on_the_object_and_know_whether_they_land_on_it() -> None:
    whole = (PixelBox(0, 0, 320, 240), CAMERA)
    left = np.zeros((4, 4), bool)
    left[:, :2] = True
    lines = crops.link_lines(links([1, 0, 2, 3]), left, left, whole, whole)
    assert [line.lands_on_object for line in lines] == [True, False]
    assert lines[0].before == pytest.approx((0.25, 0.75)) and lines[0].after == pytest.approx((0.25, 0.75))
    assert lines[1].before == pytest.approx((0.25, 0.25)) and lines[1].after == pytest.approx((0.75, 0.25))
    backward = crops.link_lines(links([1, 0, 2, 3]), None, left, whole, whole)
    assert len(backward) == 2 and not any(line.lands_on_object for line in backward)
    assert crops.link_lines(links([0, 1, 2, 3]), None, None, whole, whole) == ()


def test_links_that_leave_the_other_crop_are_not_drawn() -> None:
    whole, corner = (PixelBox(0, 0, 320, 240), CAMERA), (PixelBox(0, 0, 160, 120), CAMERA)
    everything = np.ones((4, 4), bool)
    lines = crops.link_lines(links([0, 1, 2, 3]), everything, everything, whole, corner)
    assert len(lines) == 1 and lines[0].after == pytest.approx((0.5, 0.5))
