"""Voxels: fused means, numbering, colours, objects on them, the dense map, and what a camera may see."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fixture_geometry import SMALL_CAMERA, map_in_memory, memory_session, plane_depth, pose
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_matrix

from pipeline.errors import InputError
from pipeline.mapping.colours import MIN_SHARED_PIXELS, VoxelColours
from pipeline.mapping.dense_map import dense_map
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.fusion import VoxelFusion
from pipeline.mapping.objects import number_instances, part_pieces
from pipeline.mapping.scale import voxel_size_m
from pipeline.mapping.voxel_blocks import VoxelBlocks
from pipeline.settings import Settings


def fuse(fusion: VoxelFusion, points: list, lab: float = 50.0) -> np.ndarray:
    array = np.array(points, np.float32).reshape(-1, 3)
    up = np.tile(np.array([0, 0, 1], np.float32), (len(array), 1))
    return fusion.add(array, up, np.full((len(array), 3), lab, np.float32), np.eye(4))


def test_voxel_is_the_mean_of_its_samples_over_keyframes() -> None:
    fusion = VoxelFusion(1.0)
    fuse(fusion, [[0.2, 0.2, 0.2], [0.4, 0.2, 0.2]], lab=40)
    fuse(fusion, [[0.6, 0.8, 0.2]], lab=70)

    surface, remap, first = fusion.finish(min_samples=1)

    assert surface.points_world == pytest.approx(np.array([[0.4, 0.4, 0.2]]))
    assert surface.lab[0] == pytest.approx([50, 50, 50])
    assert surface.normals_world[0] == pytest.approx([0, 0, 1])
    assert (surface.sample_count.tolist(), remap.tolist(), first.tolist()) == ([3], [0], [0])


def test_voxels_of_too_few_samples_are_dropped_and_the_others_renumbered() -> None:
    fusion = VoxelFusion(1.0)
    raw = fuse(fusion, [[0.5, 0, 0], [5.5, 0, 0], [5.6, 0, 0]])
    fuse(fusion, [[9.5, 0, 0], [9.6, 0, 0]])

    surface, remap, first = fusion.finish(min_samples=2)

    assert remap[raw].tolist() == [-1, 0, 0]
    assert surface.points_world[:, 0] == pytest.approx([5.55, 9.55])
    assert first.tolist() == [0, 1]


def test_numbering_depends_neither_on_the_order_of_points_nor_on_threads() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-3, 3, (3000, 3))
    numbers = []
    for order in (np.arange(3000), rng.permutation(3000)):
        raw = fuse(VoxelFusion(0.25), points[order])
        back = np.empty(3000, int)
        back[order] = raw
        numbers.append(back)

    assert (numbers[0] == numbers[1]).all()
    cells = np.floor(points.astype(np.float32) / 0.25)
    assert len(np.unique(numbers[0])) == len(np.unique(cells, axis=0))


def test_neighbours_are_voxels_within_reach_both_ways() -> None:
    fusion = VoxelFusion(1.0)
    fuse(fusion, [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [4.5, 0.5, 0.5]])

    neighbours = fusion.finish(1)[0].neighbours.toarray()

    assert neighbours.tolist() == [[0, 1, 0], [1, 0, 0], [0, 0, 0]]


def test_nothing_measured_gives_an_empty_surface() -> None:
    fusion = VoxelFusion(1.0)
    fuse(fusion, [])

    assert len(fusion.finish(1)[0].points_world) == 0


def test_exposure_of_a_keyframe_is_taken_out_of_the_voxels() -> None:
    voxels = np.arange(MIN_SHARED_PIXELS * 2, dtype=np.int32)
    rng = np.random.default_rng(1)
    scene = rng.integers(40, 100, (len(voxels), 3))
    colours = VoxelColours()
    colours.add(voxels, scene.astype(np.uint8))
    brighter = scene * [2.0, 1.5, 1.0]
    brighter[:20] = 250  # something changed: it must not bend the gain
    colours.add(voxels, brighter.round().astype(np.uint8))

    means = colours.finish(voxels, len(voxels))

    assert colours.log_gains[1] == pytest.approx(np.log([2.0, 1.5, 1.0]), abs=0.01)
    assert np.exp(means[20:]) == pytest.approx(scene[20:], rel=0.02)


def test_keyframes_that_share_too_little_keep_their_exposure() -> None:
    colours = VoxelColours()
    voxels = np.arange(MIN_SHARED_PIXELS - 1, dtype=np.int32)
    colours.add(voxels, np.full((len(voxels), 3), 50, np.uint8))
    colours.add(voxels, np.full((len(voxels), 3), 100, np.uint8))

    assert colours.log_gains[1].tolist() == [0, 0, 0]


def chain(sizes: list[int]) -> SimpleNamespace:
    """Rows of voxels of the given lengths, a voxel apart in a row and ten between rows."""
    rows, start, points = [], 0, []
    for size in sizes:
        rows += [(i, i + 1) for i in range(start, start + size - 1)]
        points += list(np.arange(size) + (points[-1] + 10 if points else 0))
        start += size
    a, b = np.array(rows).reshape(-1, 2).T
    links = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(start, start)).tocsr()
    positions = np.column_stack([points, np.zeros((start, 2))]) * 0.02
    return SimpleNamespace(neighbours=links, points_world=positions, voxel_size_m=0.02)


def test_loose_pieces_out_of_reach_are_dropped() -> None:
    # Object 1: pieces of 40, 4 and 3 voxels (10 % of 40 are 4); object 2: one piece of 3.
    objects = np.repeat([1, 1, 1, 2], [40, 4, 3, 3])

    parted = part_pieces(chain([40, 4, 3, 3]), objects, least_own=150, reach_voxels=8)

    assert parted.tolist() == np.repeat([1, 1, 0, 2], [40, 4, 3, 3]).tolist()


def test_loose_pieces_join_the_nearest_object_in_reach() -> None:
    objects = np.repeat([1, 2, 1], [100, 30, 3])

    parted = part_pieces(chain([100, 30, 3]), objects, least_own=150, reach_voxels=12.5)

    assert parted.tolist() == np.repeat([1, 2, 2], [100, 30, 3]).tolist()


def test_large_loose_pieces_are_objects_of_their_own() -> None:
    objects = np.repeat([1, 1, 2], [100, 6, 30])

    parted = part_pieces(chain([100, 6, 30]), objects, least_own=6, reach_voxels=8)

    assert parted.tolist() == np.repeat([1, 3, 2], [100, 6, 30]).tolist()


def _visit(views: list[np.ndarray]) -> SimpleNamespace:
    return SimpleNamespace(keyframes=views, store=SimpleNamespace(voxels=lambda k: views[k]))


def test_instances_are_large_and_seen_often_enough_and_numbered_without_gaps() -> None:
    # Objects 2 and 5 are good; 3 is small; 4 is seen once; 5 in two of fourteen keyframes.
    objects = np.repeat([2, 3, 4, 5], [30, 5, 30, 30])
    everything = np.arange(95)[None]
    views = [everything, everything[:, 65:]] + [np.full((1, 20), -1)] * 11 + [everything[:, :35]]

    found = number_instances(_visit(views), objects, np.ones(len(objects), bool), min_voxels=20, min_views=2)

    assert found.count == 2
    assert found.instance_of_voxel.tolist() == np.repeat([1, 0, 0, 2], [30, 5, 30, 30]).tolist()
    assert found.view_pixels[[0, 1, 13]].tolist() == [[0, 30, 30], [0, 0, 30], [0, 30, 0]]


def test_visits_of_few_keyframes_need_one_view_only() -> None:
    everything = np.ones(30, bool)
    visit = _visit([np.arange(30)[None]])
    found = number_instances(visit, np.full(30, 4), everything, min_voxels=20, min_views=2)

    assert found.count == 1


def test_noise_does_not_make_an_object_large_enough() -> None:
    is_surface = np.arange(30) < 19
    visit = _visit([np.arange(30)[None]])

    assert number_instances(visit, np.full(30, 4), is_surface, min_voxels=20, min_views=2).count == 0


def test_dense_map_keeps_one_point_per_cell(hall: tuple[SessionGeometry, SessionGeometry]) -> None:
    geometry = hall[0]
    points = dense_map(geometry, np.ones(len(geometry.surface.points_world), np.int32), lambda k: None)

    cells = np.floor(points.points_world / (0.75 * geometry.surface.voxel_size_m)).astype(np.int64)
    assert len(np.unique(cells, axis=0)) == len(cells) > 10_000
    assert len(points.colours) == len(points.instances) == len(cells)


def test_loose_pixels_get_the_object_of_the_nearest_voxel(
    hall: tuple[SessionGeometry, SessionGeometry],
) -> None:
    geometry = hall[0]
    left = geometry.surface.points_world[:, 0] < 2.5
    points = dense_map(geometry, np.where(left, 1, 2).astype(np.int32), lambda k: None)

    reached = points.instances > 0
    clear = reached & (np.abs(points.points_world[:, 0] - 2.5) > 8 * geometry.surface.voxel_size_m)
    assert reached.mean() > 0.9
    expected = np.where(points.points_world[:, 0] < 2.5, 1, 2)
    assert (points.instances == expected)[clear].all()


@given(st.integers(0, 10_000))
def test_blocks_in_view_never_miss_a_point_that_projects_inside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-6, 6, (400, 3)).astype(np.float32)
    T_world_camera = pose(rng.uniform(-4, 4, 3), rng.normal(size=3), (0.1, 0.2, 1))
    camera = SMALL_CAMERA

    found = VoxelBlocks(points, float(rng.uniform(0.01, 0.1))).in_view(camera, T_world_camera, 5.0)

    pixels, depth = camera.project((points - T_world_camera[:3, 3]) @ T_world_camera[:3, :3])
    inside = (depth > 0) & (depth < 5.0) & (pixels >= 0).all(axis=1)
    inside &= (pixels[:, 0] <= camera.width - 1) & (pixels[:, 1] <= camera.height - 1)
    assert set(np.flatnonzero(inside)) <= set(found.tolist())
    assert (np.diff(found) > 0).all()


def test_blocks_out_of_view_are_left_out() -> None:
    points = np.array([[0, 3, 1], [0, -3, 1], [30, 3, 1]], np.float32)

    found = VoxelBlocks(points, 0.02).in_view(SMALL_CAMERA, pose((0, 0, 1), (0, 1, 0)), 10.0)

    assert found.tolist() == [0]
    assert len(VoxelBlocks(np.zeros((0, 3), np.float32), 0.02).in_view(SMALL_CAMERA, np.eye(4), 10.0)) == 0


def flat_session(depth_m: float):
    poses = [pose((0.1 * k, 0, 1), (0, 1, 0)) for k in range(2)]
    depths = [np.full((48, 64), depth_m, np.float32)] * 2
    return memory_session(SMALL_CAMERA, poses, depths)


def test_voxel_follows_what_a_stride_of_pixels_covers() -> None:
    # At 1.5 m two pixels of 60 px focal length cover 50 mm; 1.3 times that.
    assert voxel_size_m(flat_session(1.5), (0, 1), Settings()) == pytest.approx(1.3 * 1.5 * 2 / 60)
    assert voxel_size_m(flat_session(0.1), (0, 1), Settings()) == pytest.approx(0.016)
    assert voxel_size_m(flat_session(25.0), (0, 1), Settings()) == pytest.approx(0.15)
    fixed = Settings().override("surface.voxel_size_m", 0.07)
    assert voxel_size_m(flat_session(1.5), (0, 1), fixed) == 0.07


@pytest.mark.parametrize("depth_m", [0.0, 100.0])
def test_visit_without_usable_depth_is_told(depth_m: float) -> None:
    with pytest.raises(InputError, match="no keyframe has any depth"):
        voxel_size_m(flat_session(depth_m), (0, 1), Settings())


def test_front_end_maps_a_wall_where_it_stands(tmp_path: Path) -> None:
    camera = SMALL_CAMERA.resized(160, 120)
    poses = [pose((0.1 * k, 0, 1), (0, 1, 0)) for k in range(3)]
    depths = [plane_depth(camera, T, (0, 1, 0), 2.0) for T in poses]

    geometry = map_in_memory(memory_session(camera, poses, depths), tmp_path, Settings(), 0.04)

    surface = geometry.surface
    assert len(surface.points_world) > 500
    assert np.abs(surface.points_world[:, 1] - 2.0).max() < 2e-3
    assert surface.normals_world[:, 1] == pytest.approx(-1, abs=1e-3)  # they face the cameras
    assert surface.up_world == pytest.approx([0, 0, 1], abs=1e-6)
    assert (np.diff(geometry.first_keyframe[np.argsort(geometry.first_keyframe)]) >= 0).all()
    voxels = geometry.store.voxels(0)
    assert voxels.max() < len(surface.points_world)
    assert (geometry.first_keyframe[voxels[voxels >= 0]] == 0).all()


def test_visit_of_which_one_keyframe_can_be_read_is_refused(tmp_path: Path) -> None:
    session = flat_session(2.0)
    broken = session.frames[1]

    def unreadable() -> np.ndarray:
        raise InputError("frame 1 cannot be read")

    from dataclasses import replace

    session = replace(session, frames=(session.frames[0], replace(broken, load_rgb=unreadable)))
    warnings: list[str] = []

    with pytest.raises(InputError, match="only 1 of 2 keyframes"):
        map_in_memory(session, tmp_path, Settings(), 0.05, warn=warnings.append)
    assert warnings == ["frame left out: frame 1 cannot be read"]
