"""Clicks on objects, with a scene that only remembers what it was given."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from oasisview.assets import AssetTable
from oasisview.catalogue import Catalogue
from oasisview.scene.clicks import Drawn, MapClicks
from oasisview.scene.map_points import MapPoints, load_map_points


class FakeScene:
    def __init__(self) -> None:
        self.nodes: dict[str, SimpleNamespace] = {}
        self.anywhere: list = []

    def add_batched_meshes_simple(self, name, vertices, faces, wxyzs, positions, *, batched_scales, **look):
        node = SimpleNamespace(batched_scales=batched_scales, visible=True, on_click=lambda handler: handler)
        self.nodes[name] = node
        return node

    def on_click(self):
        return self.anywhere.append


@pytest.fixture
def points(small_result) -> MapPoints:
    return load_map_points(small_result)


@pytest.fixture
def clicked() -> list[int]:
    return []


@pytest.fixture
def scene() -> FakeScene:
    return FakeScene()


@pytest.fixture
def clicks(small_result, points: MapPoints, scene: FakeScene, clicked: list[int]) -> MapClicks:
    visit = points.visits[1]
    drawn = Drawn(visit.objects, visit.object_ids, visit.background, visit.ceiling)
    made = MapClicks(scene, Catalogue(small_result, AssetTable()), points, lambda: drawn, clicked.append)
    made.add_boxes(1)
    made.listen()
    return made


def middle_of(small_result, object_id: int) -> np.ndarray:
    sighting = small_result.object(object_id).sighting(1)
    return (np.array(sighting.box_min_world_m) + sighting.box_max_world_m) / 2


def test_a_ray_finds_the_object_and_a_point_of_it(small_result, points: MapPoints, clicks: MapClicks) -> None:
    own = points.visits[1].objects[points.visits[1].object_ids == 12] + points.origin
    camera = small_result.sessions[1].keyframes[small_result.object(12).sighting(1).keyframes[0]]
    eye = camera.T_world_camera[:3, 3]
    target = own[np.argmin(np.linalg.norm(own - eye, axis=1))]
    assert clicks.object_under(eye, target - eye) == 12
    found = clicks.point_under(eye, target - eye)
    assert found is not None
    assert np.linalg.norm(found - target) < 0.15
    assert clicks.object_under(eye, eye - target) != 12


def test_the_box_around_the_camera_goes_and_comes_back(
    small_result, clicks: MapClicks, scene: FakeScene
) -> None:
    whole = scene.nodes["/map/pick/1"].batched_scales.copy()
    assert (whole > 0.02).all()
    clicks.follow_camera(middle_of(small_result, 12))
    cut = scene.nodes["/map/pick/1"].batched_scales
    ids = [item.object_id for item in small_result.objects if item.sighting(1) is not None]
    gone = [ids[i] for i in np.flatnonzero((cut < 0.001).all(axis=1))]
    assert 12 in gone and len(gone) < len(ids)
    clicks.follow_camera(middle_of(small_result, 12) + 50.0)
    np.testing.assert_array_equal(scene.nodes["/map/pick/1"].batched_scales, whole)


def test_an_object_around_the_camera_still_answers_once(
    small_result, points: MapPoints, clicks: MapClicks, scene: FakeScene, clicked: list[int]
) -> None:
    (anywhere,) = scene.anywhere
    eye = middle_of(small_result, 12)
    own = points.visits[1].objects[points.visits[1].object_ids == 12] + points.origin
    event = SimpleNamespace(ray_origin=tuple(eye), ray_direction=tuple(own[0] - eye))
    anywhere(event)
    assert clicked == []  # its box is there, and hears the click itself
    clicks.follow_camera(eye)
    anywhere(event)
    assert clicked == [12]
