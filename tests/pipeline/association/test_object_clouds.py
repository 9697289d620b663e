"""Fine clouds of objects, gathered from the keyframes of the painted hall."""

from __future__ import annotations

import numpy as np
import pytest
from fixture_scene import OBJECTS

from pipeline.association.object_clouds import CELL_PER_VOXEL, VIEWS_PER_OBJECT, ObjectClouds
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects

CRATE, CUPBOARD = OBJECTS[0], OBJECTS[1]


def inside(points: np.ndarray, box: tuple, margin_m: float) -> np.ndarray:
    low, high = np.array(box)
    return ((points > low - margin_m) & (points < high + margin_m)).all(axis=1)


@pytest.fixture(scope="module")
def objects(hall: tuple[SessionGeometry, SessionGeometry]) -> SessionObjects:
    """Two objects of the previous visit, and a third that no keyframe shows."""
    geometry = hall[0]
    points = geometry.surface.points_world
    instances = np.zeros(len(points), np.int32)
    for instance, item in ((1, CRATE), (2, CUPBOARD)):
        instances[inside(points, item.boxes[0], 0.02) & (points[:, 2] > 0.06)] = instance
    views = range(len(geometry.keyframes))
    voxels = [geometry.store.voxels(k) for k in views]
    pixels = np.array([np.bincount(instances[v[v >= 0]], minlength=4) for v in voxels], np.int32)
    hidden = np.flatnonzero(instances == 0)[:20]
    instances[hidden] = 3
    return SessionObjects(instances, 3, pixels)


@pytest.fixture
def clouds(hall: tuple[SessionGeometry, SessionGeometry], objects: SessionObjects) -> ObjectClouds:
    return ObjectClouds(hall[0], objects, np.zeros(3))


@pytest.mark.parametrize(("instance", "item"), [(1, CRATE), (2, CUPBOARD)])
def test_cloud_lies_on_its_object_and_is_finer_than_the_voxels(
    instance: int, item, clouds: ObjectClouds, objects: SessionObjects, hall
) -> None:
    cloud = clouds.of(instance)

    assert clouds.cell_m == pytest.approx(CELL_PER_VOXEL * hall[0].surface.voxel_size_m)
    assert len(cloud) > 1.5 * (objects.instance_of_voxel == instance).sum()
    # Keyframes take part in a voxel up to its edge: a voxel beyond the box at most.
    assert inside(cloud.points_world, item.boxes[0], hall[0].surface.voxel_size_m).mean() > 0.99
    assert np.linalg.norm(cloud.normals_world, axis=1) == pytest.approx(1, abs=1e-3)
    cells = np.floor(cloud.points_world / clouds.cell_m)
    assert len(np.unique(cells, axis=0)) > 0.95 * len(cells)  # a mean may stray over its cell's rounding


def test_viewpoints_are_those_that_see_the_object(
    clouds: ObjectClouds, objects: SessionObjects, hall
) -> None:
    cloud = clouds.of(1)
    seeing = int((objects.view_pixels[:, 1] > 0).sum())

    assert len(cloud.viewpoints_world) == min(seeing, VIEWS_PER_OBJECT)
    best = objects.view_pixels[:, 1].argmax()
    assert cloud.viewpoints_world[0].tolist() == hall[0].keyframes[best].T_world_camera[:3, 3].tolist()


def test_colours_are_the_objects_own_and_the_gain_is_taken_off(
    clouds: ObjectClouds, objects: SessionObjects, hall
) -> None:
    colours = clouds.of(1).log_colours
    gain = np.array([0.3, 0.0, -0.2])
    relit = ObjectClouds(hall[0], objects, gain).of(1).log_colours

    of_voxels = hall[0].log_colours[objects.instance_of_voxel == 1]
    assert np.median(colours, axis=0) == pytest.approx(np.median(of_voxels, axis=0), abs=0.06)
    assert colours - relit == pytest.approx(np.broadcast_to(gain, colours.shape), abs=1e-5)


def test_object_that_no_keyframe_shows_is_made_of_its_voxels(
    clouds: ObjectClouds, objects: SessionObjects, hall
) -> None:
    cloud = clouds.of(3)

    assert cloud.points_world.tolist() == (
        hall[0].surface.points_world[objects.instance_of_voxel == 3].tolist()
    )
    assert len(cloud.viewpoints_world) == len(hall[0].keyframes)


def test_a_cloud_is_gathered_once(clouds: ObjectClouds) -> None:
    assert clouds.of(1) is clouds.of(1)
