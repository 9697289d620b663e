from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fixture_shapes import motion
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.camera import rotation_angle_rad
from pipeline.mapping.front_end import SessionGeometry, map_again
from pipeline.registration.between_visits import register
from pipeline.settings import Settings

SETTINGS = Settings().override("keyframes.submap_size", 2).override("registration.keyframes", True)


def with_poses(geometry: SessionGeometry, poses: list[NDArray], folder: Path) -> SessionGeometry:
    return map_again(geometry, poses, SETTINGS, folder, is_lidar=False)


def pose_errors(
    poses: tuple[NDArray, ...], right: SessionGeometry
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Metres and degrees of each keyframe."""
    pairs = [(pose, keyframe.T_world_camera) for pose, keyframe in zip(poses, right.keyframes, strict=True)]
    shifts_m = [np.linalg.norm(pose[:3, 3] - true[:3, 3]) for pose, true in pairs]
    angles = [np.degrees(rotation_angle_rad(pose[:3, :3], true[:3, :3])) for pose, true in pairs]
    return np.array(shifts_m), np.array(angles)


def test_right_poses_are_left_exactly_as_they_are(hall: tuple[SessionGeometry, SessionGeometry]) -> None:
    found = register(*hall, SETTINGS)

    assert not found.is_applied
    assert found.visit.reason == "no clear gain"
    assert found.warning is None
    for pose, keyframe in zip(found.poses, hall[1].keyframes, strict=True):
        np.testing.assert_array_equal(pose, keyframe.T_world_camera)


def test_offset_of_a_visit_is_undone_though_things_changed(
    hall: tuple[SessionGeometry, SessionGeometry], tmp_path: Path
) -> None:
    T = motion((0.015, -0.01, 0.01), (0.5, -0.5, 0.7))
    wrong = with_poses(hall[1], [T @ k.T_world_camera for k in hall[1].keyframes], tmp_path)

    found = register(hall[0], wrong, SETTINGS)

    assert found.is_applied
    assert not found.visit.reason
    shifts_m, turns_deg = pose_errors(found.poses, hall[1])
    # Few surfaces of the hall face along x, and some of those changed: it is held to half a voxel.
    assert shifts_m.max() < 0.02
    assert turns_deg.max() < 0.12
    quality = found.quality()
    assert quality["residual_after_m"] < quality["residual_before_m"]
    np.testing.assert_allclose(quality["T_previous_current"], np.linalg.inv(T), atol=0.02)


def test_errors_of_single_keyframes_are_reduced(
    hall: tuple[SessionGeometry, SessionGeometry], tmp_path: Path
) -> None:
    rng = np.random.default_rng(3)
    wrong_poses = []
    for keyframe in hall[1].keyframes:
        axis, direction = (vector / np.linalg.norm(vector) for vector in rng.normal(size=(2, 3)))
        wrong_poses.append(keyframe.T_world_camera @ motion(tuple(0.02 * direction), tuple(1.5 * axis)))
    wrong = with_poses(hall[1], wrong_poses, tmp_path)

    found = register(hall[0], wrong, SETTINGS)

    assert found.keyframes is not None
    assert found.keyframes.corrected >= 4
    before, after = pose_errors(tuple(wrong_poses), hall[1]), pose_errors(found.poses, hall[1])
    assert np.median(after[1]) < 0.4 * np.median(before[1])


def test_correction_beyond_the_limits_is_told_and_not_made(
    hall: tuple[SessionGeometry, SessionGeometry], tmp_path: Path
) -> None:
    T = motion((0.02, 0.0, 0.0), (0, 0, 1.5))
    wrong = with_poses(hall[1], [T @ k.T_world_camera for k in hall[1].keyframes], tmp_path)
    strict = SETTINGS.override("registration.max_rotation_deg", 1.0).override("registration.keyframes", False)

    found = register(hall[0], wrong, strict)

    assert not found.is_applied
    assert found.warning is not None
    assert "1.5 deg" in found.warning
    assert "\n" not in found.warning
    np.testing.assert_array_equal(found.visit.T_previous_current, np.eye(4))


def test_visits_without_common_surface_are_left(hall: tuple[SessionGeometry, SessionGeometry]) -> None:
    far = replace(
        hall[0], surface=replace(hall[0].surface, points_world=hall[0].surface.points_world + np.float32(90))
    )

    found = register(far, hall[1], SETTINGS)

    assert not found.is_applied
    assert found.visit.fit is None
    assert found.quality()["reason"] == "too little common surface"


def test_mapping_again_with_the_same_poses_gives_the_same_visit(
    hall: tuple[SessionGeometry, SessionGeometry], tmp_path: Path
) -> None:
    visit = hall[1]

    again = with_poses(visit, [k.T_world_camera for k in visit.keyframes], tmp_path)

    # The store keeps whole millimetres, so that a few pixels fall into the next voxel.
    count = len(visit.surface.points_world)
    assert len(again.surface.points_world) == pytest.approx(count, rel=0.01)
    distances, _ = cKDTree(visit.surface.points_world).query(again.surface.points_world)
    assert np.percentile(distances, 90) < 0.25 * visit.surface.voxel_size_m
    camera, pose = visit.strided_camera(0), visit.keyframes[0].T_world_camera
    depths = [mapped.submaps.render_depth((0,), camera, pose) for mapped in (again, visit)]
    both = (depths[0] > 0) & (depths[1] > 0)
    assert both.mean() > 0.95 * (depths[1] > 0).mean()
    assert np.median(np.abs(depths[0] - depths[1])[both]) < 2e-3


@pytest.mark.parametrize("name", ["samples", "keyframe_samples"])
def test_a_handful_of_samples_is_refused(name: str) -> None:
    from pipeline.errors import InputError

    with pytest.raises(InputError, match="at least 100"):
        Settings().override(f"registration.{name}", 3)
