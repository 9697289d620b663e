from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fixture_scene import CAMERA, camera_pose, render

from oasisview.same_viewpoint import SameViewpoint, drawn_depth
from pipeline.result import Result


def test_a_wall_is_drawn_at_its_depth_without_gaps() -> None:
    across, up = np.meshgrid(np.arange(-3, 3, 0.02), np.arange(-2, 2, 0.02))
    wall = np.stack([across.ravel(), up.ravel(), np.full(across.size, 2.0)], axis=1)

    depth = drawn_depth(wall, CAMERA, np.eye(4), 0.02)

    assert np.isfinite(depth).all()
    assert depth == pytest.approx(2.0, abs=1e-4)


def test_what_is_nearer_covers_and_what_is_behind_the_camera_is_not_drawn() -> None:
    grid = np.stack(np.meshgrid(np.arange(-3, 3, 0.015), np.arange(-3, 3, 0.015)), axis=-1).reshape(-1, 2)
    far = np.concatenate([grid, np.full((len(grid), 1), 3.0)], axis=1)
    small = grid[np.abs(grid).max(axis=1) < 0.3]
    near = np.concatenate([small, np.full((len(small), 1), 1.0)], axis=1)
    behind = far * [1, 1, -1]

    depth = drawn_depth(np.concatenate([far, near, behind]), CAMERA, np.eye(4), 0.015)

    middle = depth[100:140, 140:180]
    assert middle == pytest.approx(1.0, abs=1e-3)
    assert depth[:20, :20] == pytest.approx(3.0, abs=1e-3)


def test_no_points_are_no_depth() -> None:
    assert np.isnan(drawn_depth(np.zeros((0, 3)), CAMERA, np.eye(4), 0.01)).all()


@pytest.mark.parametrize(("session", "keyframe"), [(0, 4), (1, 1), (1, 2)])
def test_the_other_visit_is_what_a_camera_would_have_seen_there(
    small_result: Result, session: int, keyframe: int
) -> None:
    pose = camera_pose(session, keyframe)
    there, here = render(1 - session, pose), render(session, pose)
    truth, own = there.rgb.astype(float), here.rgb.astype(float)

    image, known = SameViewpoint(small_result).picture(session, keyframe)

    assert image.shape == truth.shape and known.mean() > 0.4
    error = np.abs(image[known] - truth[known]).mean(axis=1)
    assert np.median(error) < 8 and (error < 40).mean() > 0.9
    # Where the visits differ it shows the other one, not this one.
    changed = known & (np.abs(there.depth_m - here.depth_m) > 0.2)
    assert changed.sum() > 200
    assert np.abs(image[changed] - truth[changed]).mean() < 0.6 * np.abs(image[changed] - own[changed]).mean()


def test_a_view_that_nothing_shares_has_no_picture(small_result: Result, monkeypatch) -> None:
    visit = small_result.sessions[1]
    alone = tuple(replace(keyframe, covisible=()) for keyframe in visit.keyframes)
    monkeypatch.setattr(visit, "keyframes", alone)
    assert SameViewpoint(small_result).picture(1, 0) is None
