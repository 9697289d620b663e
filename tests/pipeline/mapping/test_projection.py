"""Which surface point is seen at each pixel, against a camera at the origin that looks along z."""

from __future__ import annotations

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.mapping.projection import visible_points

CAMERA = PinholeCamera(width=9, height=7, fx=10.0, fy=10.0, cx=4.0, cy=3.0)


def seen(points: list[tuple[float, float, float]]) -> np.ndarray:
    array = np.array(points, np.float32)
    return visible_points(array, np.arange(len(array)), CAMERA, np.eye(4))


def test_a_point_is_seen_at_its_pixel_and_the_eight_around_it() -> None:
    image = seen([(0, 0, 1)])

    assert image.shape == (7, 9)
    assert np.argwhere(image == 0).tolist() == [[r, c] for r in (2, 3, 4) for c in (3, 4, 5)]


def test_the_nearer_of_two_points_is_seen() -> None:
    assert seen([(0, 0, 1), (0, 0, 2)])[3, 4] == 0
    assert seen([(0, 0, 2), (0, 0, 1)])[3, 4] == 1


def test_points_behind_the_camera_and_outside_the_image_are_not_seen() -> None:
    assert (seen([(0, 0, -1), (5, 0, 1)]) == -1).all()


def test_a_point_at_the_rim_shows_the_part_of_it_that_is_inside() -> None:
    image = seen([(-0.4, -0.3, 1)])

    assert np.argwhere(image == 0).tolist() == [[0, 0], [0, 1], [1, 0], [1, 1]]
