"""Submaps rendered from a pose: the distance field of depth sensors and the points of LiDARs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fixture_geometry import SMALL_CAMERA, map_in_memory, memory_session, plane_depth, pose

from pipeline.camera import PinholeCamera
from pipeline.mapping.accumulation import AccumulatedSubmap, splat_depth
from pipeline.mapping.submap import SubmapSurfaces, TsdfGrid, TsdfSubmap
from pipeline.settings import Settings

VOXEL_M = 0.05
GRID = TsdfGrid(VOXEL_M, 4.0, 10.0)
CAMERA = PinholeCamera(96, 72, 90.0, 90.0, 47.5, 35.5)
WALL_Y_M = 3.0


def wall(T_world_camera: np.ndarray, y_m: float = WALL_Y_M) -> np.ndarray:
    return plane_depth(CAMERA, T_world_camera, (0, 1, 0), y_m)


def build(folder: Path, kind: str, poses: list[np.ndarray], y_m: float = WALL_Y_M, number: int = 0) -> None:
    submap = TsdfSubmap(GRID) if kind == "tsdf" else AccumulatedSubmap(VOXEL_M)
    for T_world_camera in poses:
        submap.integrate(wall(T_world_camera, y_m), CAMERA, T_world_camera)
    submap.save(SubmapSurfaces(folder, GRID).path(number))


@pytest.mark.parametrize("kind", ["tsdf", "lidar"])
def test_rendering_a_mapped_wall_gives_its_depth(tmp_path: Path, kind: str) -> None:
    build(tmp_path, kind, [pose((x, 0, 1), (0, 1, 0)) for x in (-0.2, 0.0, 0.2)])
    elsewhere = pose((0.1, 0.5, 1.1), (0.1, 1, -0.05))

    depth = SubmapSurfaces(tmp_path, GRID).render_depth((0,), CAMERA, elsewhere)

    inner = (slice(16, -16), slice(16, -16))
    assert (depth[inner] > 0).mean() > 0.98
    known = depth[inner] > 0
    error_m = (depth - wall(elsewhere))[inner][known]
    assert abs(float(np.median(error_m))) < 0.2 * VOXEL_M
    assert float(np.abs(error_m).max()) < VOXEL_M


@pytest.mark.parametrize("kind", ["tsdf", "lidar"])
def test_nothing_is_rendered_where_nothing_was_mapped(tmp_path: Path, kind: str) -> None:
    build(tmp_path, kind, [pose((0, 0, 1), (0, 1, 0))])

    away = SubmapSurfaces(tmp_path, GRID).render_depth((0,), CAMERA, pose((0, 0, 1), (0, -1, 0)))

    assert not away.any()


@pytest.mark.parametrize("kind", ["tsdf", "lidar"])
def test_nearest_surface_of_several_submaps_wins(tmp_path: Path, kind: str) -> None:
    here = pose((0, 0, 1), (0, 1, 0))
    build(tmp_path, kind, [here], 3.0, number=0)
    build(tmp_path, kind, [here], 2.0, number=1)
    surfaces = SubmapSurfaces(tmp_path, GRID)

    middle = (CAMERA.height // 2, CAMERA.width // 2)
    assert surfaces.render_depth((0,), CAMERA, here)[middle] == pytest.approx(3.0, abs=0.03)
    assert surfaces.render_depth((0, 1), CAMERA, here)[middle] == pytest.approx(2.0, abs=0.03)
    assert not surfaces.render_depth((), CAMERA, here).any()


def test_lidar_points_are_kept_as_measured_one_per_cell(tmp_path: Path) -> None:
    here = pose((0, 0, 1), (0, 1, 0))
    build(tmp_path, "lidar", [here, here])

    with np.load(tmp_path / "submap_0000.npz", allow_pickle=False) as file:
        points = file["points_world"]

    assert np.abs(points[:, 1] - WALL_Y_M).max() < 1e-4
    assert len(np.unique(np.floor(points / VOXEL_M), axis=0)) == len(points)


def test_distance_field_averages_noise_away(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    here = pose((0, 0, 1), (0, 1, 0))
    submap = TsdfSubmap(GRID)
    for _ in range(10):
        noisy = wall(here) + rng.normal(0, 0.02, (CAMERA.height, CAMERA.width))
        submap.integrate(noisy.astype(np.float32), CAMERA, here)
    submap.save(tmp_path / "submap_0000.npz")

    depth = SubmapSurfaces(tmp_path, GRID).render_depth((0,), CAMERA, here)[10:-10, 10:-10]

    assert (depth > 0).all()
    assert float(np.abs(depth - WALL_Y_M).mean()) < 0.01


def test_submap_of_blind_keyframes_is_empty_but_readable(tmp_path: Path) -> None:
    for number, submap in enumerate((TsdfSubmap(GRID), AccumulatedSubmap(VOXEL_M))):
        submap.integrate(np.zeros((CAMERA.height, CAMERA.width), np.float32), CAMERA, np.eye(4))
        submap.save(tmp_path / f"submap_{number:04d}.npz")

    assert not SubmapSurfaces(tmp_path, GRID).render_depth((0, 1), CAMERA, np.eye(4)).any()


def test_saved_submap_does_not_depend_on_threads(tmp_path: Path) -> None:
    poses = [pose((x, 0, 1), (0.1 * x, 1, 0)) for x in np.linspace(-1, 1, 5)]
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        build(tmp_path / name, "tsdf", poses)

    first, second = ((tmp_path / name / "submap_0000.npz").read_bytes() for name in ("a", "b"))
    assert first == second


def test_rendering_is_the_same_every_time_at_any_image_size(tmp_path: Path) -> None:
    # A voxel ray caster once gave part of the view on its first cast, and hung at sizes not divisible by 8.
    build(tmp_path, "tsdf", [pose((x, 0, 1), (0, 1, 0)) for x in (-1, 0, 1)])
    here = pose((0.1, 0.2, 1), (0.2, 1, 0))
    whole = SubmapSurfaces(tmp_path, GRID).render_depth((0,), CAMERA, here)

    assert (whole > 0).mean() > 0.9
    for width, height in ((96, 72), (91, 67), (96, 45)):
        camera = PinholeCamera(width, height, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy)
        for _ in range(2):
            again = SubmapSurfaces(tmp_path, GRID).render_depth((0,), camera, here)
            assert (again == whole[:height, :width]).all()


@pytest.mark.parametrize("kind", ["tsdf", "lidar"])
@pytest.mark.parametrize("offset_m", [0.0, 0.013, 0.031, 0.044])
@pytest.mark.parametrize("forward", [(0, 1, 0), (0, -1, 0), (-1, 0, 0)])
def test_rendered_surface_is_not_shifted_whichever_way_one_looks(
    tmp_path: Path, kind: str, offset_m: float, forward: tuple[float, float, float]
) -> None:
    here = pose((0.4, 0.3, 1), forward)
    distance_m = 2.0 + offset_m
    depth = plane_depth(CAMERA, here, forward, float(np.dot(forward, here[:3, 3])) + distance_m)
    submap = TsdfSubmap(GRID) if kind == "tsdf" else AccumulatedSubmap(VOXEL_M)
    submap.integrate(depth, CAMERA, here)
    surfaces = SubmapSurfaces(tmp_path, GRID)
    submap.save(surfaces.path(0))

    rendered = surfaces.render_depth((0,), CAMERA, here)[10:-10, 10:-10]

    assert float(np.median(rendered)) == pytest.approx(distance_m, abs=0.003)


def test_pixels_of_a_rendering_are_those_of_the_camera(tmp_path: Path) -> None:
    # Seen at a slant, a shift of half a pixel changes the depth of the floor by more than a centimetre.
    here = pose((0, 0, 1.2), (0, 1, -0.5))
    floor = plane_depth(CAMERA, here, (0, 0, 1), 0.0)
    submap = TsdfSubmap(GRID)
    submap.integrate(floor, CAMERA, here)
    surfaces = SubmapSurfaces(tmp_path, GRID)
    submap.save(surfaces.path(0))

    rendered = surfaces.render_depth((0,), CAMERA, here)

    middle = (slice(20, 60), slice(20, -20))
    slope = np.abs(np.diff(floor, axis=0)).max(axis=1)[40]
    assert abs(float(np.median((rendered - floor)[middle]))) < 0.25 * slope


def test_splat_is_as_large_as_the_cell_it_stands_for() -> None:
    camera = PinholeCamera(41, 41, 40.0, 40.0, 20.0, 20.0)

    # A cell of 0.1 m at 1 m covers 4 pixels, so that the splat reaches 2 pixels around its centre.
    near = splat_depth(np.array([[0, 0, 1]], np.float32), 0.1, camera, np.eye(4))
    far = splat_depth(np.array([[0, 0, 9]], np.float32), 0.1, camera, np.eye(4))

    assert (near > 0).sum() == 25
    assert (far > 0).sum() == 1
    assert near[20, 20] == 1.0


@pytest.mark.parametrize(("count", "expected"), [(9, 1), (10, 1), (11, 2), (25, 3)])
def test_a_submap_is_built_every_ten_keyframes(tmp_path: Path, count: int, expected: int) -> None:
    poses = [pose((0.02 * k, 0, 1), (0, 1, 0)) for k in range(count)]
    depths = [plane_depth(SMALL_CAMERA, T, (0, 1, 0), 2.0) for T in poses]

    geometry = map_in_memory(memory_session(SMALL_CAMERA, poses, depths), tmp_path, Settings(), VOXEL_M)

    assert geometry.submap_count == expected
    assert [keyframe.submap for keyframe in geometry.keyframes] == [k // 10 for k in range(count)]
    assert len(list(tmp_path.glob("submap_*.npz"))) == expected


@pytest.mark.parametrize("source", ["sensor", "lidar"])
def test_depth_source_chooses_the_kind_of_submap(tmp_path: Path, source: str) -> None:
    poses = [pose((0.1 * k, 0, 1), (0, 1, 0)) for k in range(3)]
    depths = [plane_depth(SMALL_CAMERA, T, (0, 1, 0), 2.0) for T in poses]
    session = memory_session(SMALL_CAMERA, poses, depths, depth_source=source)

    geometry = map_in_memory(session, tmp_path, Settings(), VOXEL_M)

    with np.load(tmp_path / "submap_0000.npz", allow_pickle=False) as file:
        assert ("triangles" in file) is (source == "sensor")
    rendered = geometry.submaps.render_depth((0,), SMALL_CAMERA, poses[1])
    known = rendered > 0
    assert known.mean() > 0.7
    assert np.abs(rendered - 2.0)[known].max() < VOXEL_M
