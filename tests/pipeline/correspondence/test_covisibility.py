"""Co-visible keyframes against a computation patch by patch."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.correspondence.covisibility import CovisibilityIndex, PatchView, patch_view, patch_warp
from pipeline.mapping.front_end import SessionGeometry
from pipeline.settings import CorrespondenceSettings

GRID = (15, 20)
SETTINGS = CorrespondenceSettings(pairs_per_keyframe=3, min_shared=0.15)


def views(geometry: SessionGeometry) -> list[PatchView]:
    return [patch_view(geometry, k, GRID) for k in range(len(geometry.keyframes))]


def shared_by_brute_force(a: SessionGeometry, i: int, b: SessionGeometry, j: int) -> float:
    """Share of the measured patches of ``a``'s keyframe that ``b``'s keyframe sees, with plain loops."""
    depth_a, depth_b = a.store.depth(i), b.store.depth(j)
    T_a, T_b = a.keyframes[i].T_world_camera, b.keyframes[j].T_world_camera
    camera_a, camera_b = a.keyframes[i].camera, b.keyframes[j].camera
    measured = seen = 0
    for row in range(GRID[0]):
        for column in range(GRID[1]):
            u = (column + 0.5) / GRID[1] * camera_a.width - 0.5
            v = (row + 0.5) / GRID[0] * camera_a.height - 0.5
            z = depth_a[int((v + 0.5) / 2), int((u + 0.5) / 2)]
            if z <= 0:
                continue
            measured += 1
            ray = np.array([(u - camera_a.cx) / camera_a.fx, (v - camera_a.cy) / camera_a.fy, 1.0])
            world = T_a[:3, :3] @ (ray * z) + T_a[:3, 3]
            x, y, depth = T_b[:3, :3].T @ (world - T_b[:3, 3])
            if depth <= 0.1:
                continue
            u, v = camera_b.fx * x / depth + camera_b.cx, camera_b.fy * y / depth + camera_b.cy
            patch_column = (u + 0.5) / camera_b.width * GRID[1] - 0.5
            patch_row = (v + 0.5) / camera_b.height * GRID[0] - 0.5
            if not (-0.5 < patch_column < GRID[1] - 0.5 and -0.5 < patch_row < GRID[0] - 0.5):
                continue
            there_row = int((round(patch_row) + 0.5) / GRID[0] * depth_b.shape[0])
            there_column = int((round(patch_column) + 0.5) / GRID[1] * depth_b.shape[1])
            there = depth_b[there_row, there_column]
            seen += there <= 0 or there > depth - (0.1 + 0.05 * depth)
    return seen / measured


def test_ranking_equals_a_computation_patch_by_patch(hall: tuple[SessionGeometry, SessionGeometry]) -> None:
    previous, current = hall
    index, own = CovisibilityIndex(views(previous)), views(current)

    for k in range(len(current.keyframes)):
        shared = [shared_by_brute_force(current, k, previous, j) for j in range(len(previous.keyframes))]
        expected = [j for j in np.argsort([-s for s in shared], kind="stable") if shared[j] >= 0.15][:3]
        found = index.best(own[k], SETTINGS)
        assert [pair.shared for pair in found] == pytest.approx([shared[j] for j in expected], abs=0.02)
        for pair in found:
            assert pair.shared == pytest.approx(shared[pair.other_keyframe], abs=0.02)


def test_keyframe_shares_everything_with_itself(hall: tuple[SessionGeometry, SessionGeometry]) -> None:
    own = views(hall[0])

    for k, view in enumerate(own):
        best = CovisibilityIndex(own).best(view, SETTINGS)[0]
        assert (best.other_keyframe, best.shared) == (k, pytest.approx(1.0))


def test_warp_into_itself_is_the_identity(hall: tuple[SessionGeometry, SessionGeometry]) -> None:
    view = views(hall[0])[2]

    warp = patch_warp(view, view)

    row, column = np.mgrid[: GRID[0], : GRID[1]]
    known = warp.is_visible
    assert known.mean() > 0.9
    assert warp.positions[known] == pytest.approx(np.stack([column, row], axis=-1)[known], abs=1e-2)


def _flat_view(depth_m: float, x_m: float = 0.0) -> PatchView:
    from pipeline.camera import PinholeCamera

    camera = PinholeCamera(8, 6, 8.0, 8.0, 3.5, 2.5)
    T_world_camera = np.eye(4)
    T_world_camera[0, 3] = x_m
    depth = np.full((6, 8), depth_m, np.float32)
    points = camera.backproject(depth) + T_world_camera[:3, 3].astype(np.float32)
    points[depth <= 0] = np.nan
    return PatchView(points, depth, camera, T_world_camera)


def test_place_behind_a_nearer_surface_is_not_visible() -> None:
    far, near = _flat_view(4.0), _flat_view(2.0)

    assert not patch_warp(far, near).is_visible.any()
    assert patch_warp(near, far).is_visible.all()  # it sees through where the near surface is


def test_place_is_visible_where_the_other_keyframe_has_no_depth() -> None:
    assert patch_warp(_flat_view(2.0), _flat_view(0.0)).is_visible.all()
    assert not patch_warp(_flat_view(0.0), _flat_view(2.0)).is_visible.any()


def test_keyframe_without_depth_and_keyframes_far_away_have_no_partner() -> None:
    index = CovisibilityIndex([_flat_view(2.0), _flat_view(2.0, x_m=50.0)])

    assert index.best(_flat_view(0.0), SETTINGS) == ()
    assert [p.other_keyframe for p in index.best(_flat_view(2.0, x_m=50.2), SETTINGS)] == [1]
    assert index.best(_flat_view(2.0, x_m=-20.0), SETTINGS) == ()
