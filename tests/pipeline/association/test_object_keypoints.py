"""Keypoints lifted onto a printed wall that two visits see from different places."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fixture_geometry import SMALL_CAMERA, map_in_memory, memory_session, plane_depth, pose
from scipy.ndimage import gaussian_filter, map_coordinates

from pipeline.association.keypoint_registration import register_by_keypoints
from pipeline.association.object_keypoints import ObjectKeypoints, object_keypoints
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects
from pipeline.settings import Settings

CAMERA = SMALL_CAMERA.resized(256, 192)
WALL_Y_M = 2.0
PAINT = gaussian_filter(np.random.default_rng(0).normal(size=(400, 400)), 2.5)
Images = Callable[[int], np.ndarray]


def wall(folder: Path, xs: list[float], roll_deg: float = 0.0) -> tuple[SessionGeometry, Images]:
    """A visit that looks along y at a wall printed by position, with blotches of about 5 cm."""
    roll = np.deg2rad(roll_deg)
    poses = [pose((x, 0, 1), (0, 1, 0), (np.sin(roll), 0, np.cos(roll))) for x in xs]
    depths = [plane_depth(CAMERA, T, (0, 1, 0), WALL_Y_M) for T in poses]
    images = []
    for T, depth in zip(poses, depths, strict=True):
        points = CAMERA.backproject(depth).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
        cells = np.stack([points[:, 2], points[:, 0]]) / 0.01 + 200
        value = map_coordinates(PAINT, cells, order=1, mode="wrap")
        grey = np.clip(120 + 35 * value / PAINT.std(), 5, 250).reshape(depth.shape)
        images.append(np.repeat(grey[..., None], 3, axis=2).astype(np.uint8))
    settings = Settings().override("keyframes.submap_size", 2)
    geometry = map_in_memory(memory_session(CAMERA, poses, depths, images), folder, settings, 0.04)
    return geometry, lambda k: images[k]


def board(geometry: SessionGeometry) -> SessionObjects:
    """One object: the wall within 0.5 m of (0, 2, 1); the rest is background."""
    near = np.abs(geometry.surface.points_world - [0, WALL_Y_M, 1]).max(axis=1) < 0.5
    instances = near.astype(np.int32)
    seen = []
    for k in range(len(geometry.keyframes)):
        voxels = geometry.store.voxels(k)
        seen.append(np.bincount(instances[voxels[voxels >= 0]], minlength=2))
    return SessionObjects(instances, 1, np.array(seen, np.int32))


def keypoints_of(folder: Path, xs: list[float], roll_deg: float = 0.0) -> ObjectKeypoints:
    geometry, image = wall(folder, xs, roll_deg)
    return object_keypoints(geometry, board(geometry), image, 1)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> ObjectKeypoints:
    return keypoints_of(tmp_path_factory.mktemp("first"), [0.0, 0.1])


def test_keypoints_lie_on_the_object_with_its_normal(first: ObjectKeypoints) -> None:
    assert len(first) > 60
    assert first.points_world[:, 1] == pytest.approx(WALL_Y_M, abs=0.01)
    assert (np.abs(first.points_world - [0, WALL_Y_M, 1]).max(axis=1) < 0.58).all()  # a voxel beyond
    normals = first.R_world_keypoint[:, :, 2]
    assert (normals @ [0, -1, 0] > 0.99).all()
    assert (np.abs(first.R_world_keypoint[:, :, 0] @ [0, 1, 0]) < 0.15).all()
    gram = first.R_world_keypoint.transpose(0, 2, 1) @ first.R_world_keypoint
    assert gram == pytest.approx(np.broadcast_to(np.eye(3), gram.shape), abs=1e-5)
    assert np.linalg.det(first.R_world_keypoint) == pytest.approx(1, abs=1e-5)
    assert np.linalg.norm(first.descriptors, axis=1) == pytest.approx(1, abs=1e-5)
    # Blotches of some 5 cm; SIFT describes neighbourhoods of a few times its sigma.
    assert 0.02 < np.median(first.sizes_m) < 0.2


@pytest.mark.parametrize("roll_deg", [0.0, 40.0, 180.0])
def test_the_same_print_stays_where_it_is_however_the_camera_is_held(
    first: ObjectKeypoints, roll_deg: float, tmp_path: Path
) -> None:
    again = keypoints_of(tmp_path / "again", [0.3, 0.2], roll_deg)

    found = register_by_keypoints([first], [again], 0.016)[0, 0]

    assert found.support > 15
    assert found.displacement_m < 0.01
    assert found.is_still(0.05, 3.0)


def test_an_object_that_no_keyframe_shows_has_none(tmp_path: Path) -> None:
    geometry, image = wall(tmp_path / "unseen", [0.0, 0.1])
    objects = board(geometry)
    unseen = SessionObjects(objects.instance_of_voxel, 1, np.zeros_like(objects.view_pixels))

    assert len(object_keypoints(geometry, unseen, image, 1)) == 0


def test_a_plain_surface_has_none(tmp_path: Path) -> None:
    geometry, _ = wall(tmp_path / "plain", [0.0, 0.1])
    plain = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)

    assert len(object_keypoints(geometry, board(geometry), lambda k: plain, 1)) == 0
