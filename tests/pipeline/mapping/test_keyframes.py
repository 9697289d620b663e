from __future__ import annotations

import numpy as np
import pytest
from fixture_geometry import SMALL_CAMERA, memory_session
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.camera import rotation_angle_rad
from pipeline.mapping.keyframes import median_step, motion_thresholds, select_by_motion, select_keyframes
from pipeline.session import Session
from pipeline.settings import KeyframeSettings

SETTINGS = KeyframeSettings()


def walk(steps_m: list[float], turns_deg: list[float] | None = None) -> list[np.ndarray]:
    """Poses at the given distances along x, turned by the given angles about the vertical axis."""
    turns_deg = turns_deg or [0.0] * len(steps_m)
    poses = []
    for x, turn in zip(steps_m, turns_deg, strict=True):
        T = np.eye(4)
        T[:3, :3] = Rotation.from_euler("z", turn, degrees=True).as_matrix()
        T[0, 3] = x
        poses.append(T)
    return poses


def session(poses: list[np.ndarray], **fields: object) -> Session:
    depth = np.ones((SMALL_CAMERA.height, SMALL_CAMERA.width), np.float32)
    return memory_session(SMALL_CAMERA, poses, [depth] * len(poses), **fields)


def test_translation_threshold_counts_from_the_last_kept_keyframe() -> None:
    poses = walk([0.0, 0.3, 0.5, 0.51, 0.9, 1.01, 1.02])

    # 0.5 m is not more than 0.5 m; 1.01 is just at 0.5 from 0.51, 1.02 beyond.
    assert select_by_motion(poses, 0.5, 9.0) == (0, 3, 6)


def test_rotation_threshold_alone_is_enough() -> None:
    poses = walk([0.0] * 5, [0, 15, 21, 40, 43])

    assert select_by_motion(poses, 0.5, float(np.deg2rad(20))) == (0, 2, 4)


@pytest.mark.parametrize(
    ("source", "expected"),
    [("sensor", (0.5, 20)), ("lidar", (0.5, 20)), ("learned", (1.0, 30))],
)
def test_thresholds_follow_what_measured_the_depth(source: str, expected: tuple[float, float]) -> None:
    translation_m, rotation_rad = motion_thresholds(session(walk([0.0]), depth_source=source), SETTINGS)

    assert (translation_m, np.rad2deg(rotation_rad)) == pytest.approx(expected)


def test_dense_stream_is_thinned_by_its_modality() -> None:
    poses = walk(list(np.arange(101) * 0.03))  # 3 m in steps of 3 cm

    assert select_keyframes(session(poses), SETTINGS) == (0, 17, 34, 51, 68, 85)
    assert select_keyframes(session(poses, depth_source="learned"), SETTINGS) == (0, 34, 68)


def test_archive_that_is_sparse_already_keeps_every_frame() -> None:
    poses = walk(list(np.arange(10) * 0.2))  # 40 % of the threshold from frame to frame

    assert select_keyframes(session(poses), SETTINGS) == tuple(range(10))
    # A reader that knows better has the last word.
    assert select_keyframes(session(poses, is_sparse=False), SETTINGS) == (0, 3, 6, 9)


def test_sparse_flag_of_the_archive_and_switched_off_selection_keep_every_frame() -> None:
    poses = walk(list(np.arange(30) * 0.01))

    assert select_keyframes(session(poses), SETTINGS) == (0,)
    assert select_keyframes(session(poses, is_sparse=True), SETTINGS) == tuple(range(30))
    off = KeyframeSettings(select=False)
    assert select_keyframes(session(poses), off) == tuple(range(30))


def test_median_step_is_the_share_of_the_nearer_threshold() -> None:
    poses = walk([0.0, 0.1, 0.2, 0.3], [0, 0, 0, 10])

    # 0.2, 0.2 of the translation; 0.5 of the rotation.
    assert median_step(poses, 0.5, float(np.deg2rad(20))) == pytest.approx(0.2)
    assert median_step(poses[:1], 0.5, 1.0) == 0.0


@given(st.integers(0, 10_000), st.integers(1, 60))
def test_between_keyframes_nothing_moved_beyond_a_threshold(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    poses = walk(list(rng.normal(0, 0.2, count).cumsum()), list(rng.normal(0, 6, count).cumsum()))
    kept = select_by_motion(poses, 0.5, 0.35)

    def apart(a: int, b: int) -> bool:
        step = np.linalg.norm(poses[a][:3, 3] - poses[b][:3, 3])
        return bool(step > 0.5 or rotation_angle_rad(poses[a][:3, :3], poses[b][:3, :3]) > 0.35)

    assert kept[0] == 0
    for first, second in zip(kept, (*kept[1:], count), strict=True):
        assert not any(apart(first, between) for between in range(first + 1, second))
        assert second == count or apart(first, second)
