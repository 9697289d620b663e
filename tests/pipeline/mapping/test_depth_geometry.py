from __future__ import annotations

import numpy as np
import pytest
from fixture_geometry import SMALL_CAMERA, plane_depth, pose

from pipeline.mapping.depth_geometry import DepthGeometry, depth_geometry

CAMERA = SMALL_CAMERA.resized(160, 120)
HERE = pose((0, 0, 1), (0.3, 1, -0.2))
WALL = plane_depth(CAMERA, HERE, (0, 1, 0), 2.0)


def normal_errors_deg(found: DepthGeometry) -> np.ndarray:
    true = HERE[:3, :3].T @ np.array([0, -1.0, 0])
    return np.rad2deg(np.arccos(np.clip(found.normals_camera @ true, -1, 1)))[found.is_reliable]


def test_normals_of_a_plane_face_the_camera() -> None:
    found = depth_geometry(WALL, CAMERA, 0.08)

    assert found.is_reliable.mean() > 0.9
    assert normal_errors_deg(found).max() < 0.1


def test_holes_do_not_tilt_the_normals_around_them() -> None:
    holes = np.random.default_rng(0).random(WALL.shape) < 0.01
    holes[40:50, 60:75] = True
    found = depth_geometry(np.where(holes, 0, WALL).astype(np.float32), CAMERA, 0.08)

    assert not found.is_reliable[holes].any()
    assert found.is_reliable[~holes].mean() > 0.85
    assert normal_errors_deg(found).max() < 2.0


def test_occlusion_edges_and_grazing_surfaces_are_not_trusted() -> None:
    step = np.where(np.arange(160)[None] < 80, 1.0, 2.0) * np.ones((120, 1))
    found = depth_geometry(step.astype(np.float32), CAMERA, 0.08)
    assert not found.is_reliable[:, 79:81].any()
    assert found.is_reliable[10:-10, 10:70].all()

    floor_camera = pose((0, 0, 0.05), (0, 1, 0))
    grazing = plane_depth(CAMERA, floor_camera, (0, 0, 1), 0.0)
    seen = depth_geometry(np.where(grazing < 9, grazing, 0).astype(np.float32), CAMERA, 0.5)
    assert not seen.is_reliable.any()


@pytest.mark.parametrize("depth_m", [0.0, 3.0])
def test_points_are_where_the_depth_says(depth_m: float) -> None:
    depth = np.full((120, 160), depth_m, np.float32)

    found = depth_geometry(depth, CAMERA, 0.08)

    assert found.points_camera[..., 2] == pytest.approx(depth)
    assert np.isfinite(found.normals_camera).all()
    assert found.is_reliable.any() == (depth_m > 0)
