"""Discovery on scenes whose right answer is known by construction."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.perception.embedded.discovery import discover_objects
from pipeline.perception.embedded.gravity_view import GravityView
from pipeline.perception.embedded.structure import find_structure
from pipeline.perception.embedded.supports import find_supports
from pipeline.settings import DiscoverySettings

SETTINGS = DiscoverySettings()


def best_overlap(segments, owners, owner: int) -> tuple[float, int]:
    """Highest IoU of any segment with an owner's voxels, and that segment."""
    true = owners == owner
    shared = np.bincount(segments[true], minlength=segments.max() + 1).astype(float)
    sizes = np.bincount(segments, minlength=segments.max() + 1)
    overlap = shared / (sizes + true.sum() - shared)
    overlap[0] = 0
    return float(overlap.max()), int(overlap.argmax())


def assert_found(segments, owners, wanted, least: float) -> None:
    best = {owner: best_overlap(segments, owners, owner) for owner in wanted}
    assert all(overlap > least for overlap, _ in best.values()), best
    assert len({segment for _, segment in best.values()}) == len(best)


def add_table(scene, x: float, y: float, height: float = 0.72, width: float = 1.2, depth: float = 0.7) -> int:
    table = scene.box((x, y, height - 0.03), (x + width, y + depth, height))
    for dx in (0.03, width - 0.08):
        for dy in (0.03, depth - 0.08):
            scene.box((x + dx, y + dy, 0), (x + dx + 0.05, y + dy + 0.05, height - 0.03), owner=table)
    return table


def furnished_room(scene_builder, seed: int = 0):
    scene = scene_builder(seed=seed)
    scene.room(4.0, 3.5, 2.2)
    table = add_table(scene, 1.3, 1.2)
    items = [
        scene.box((1.4, 1.3, 0.72), (1.6, 1.5, 0.9)),
        scene.box((1.8, 1.35, 0.72), (2.0, 1.65, 1.0)),
        scene.box((2.2, 1.5, 0.72), (2.4, 1.7, 0.85)),
    ]
    return scene, table, items


def test_table_with_three_boxes_gives_four_objects(scene_builder):
    scene, table, items = furnished_room(scene_builder)
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert segments.dtype == np.int32
    assert segments.max() == 4
    assert_found(segments, owners, [table, *items], 0.7)


def test_walls_and_floor_are_structure_and_the_table_is_not(scene_builder):
    scene, table, items = furnished_room(scene_builder)
    surface, owners = scene.build()
    structure = find_structure(surface, SETTINGS, 0)
    assert structure.is_structure[owners == 0].mean() > 0.99
    assert structure.is_structure[np.isin(owners, [table, *items])].mean() < 0.05
    kinds = sorted(plane.kind for plane in structure.planes)
    assert kinds == ["floor", "wall", "wall", "wall"]
    floor = structure.planes[structure.floor]
    assert floor.normal_world == pytest.approx([0, 0, 1], abs=0.01)
    assert floor.offset_m == pytest.approx(0, abs=0.015)
    assert floor.area_m2 == pytest.approx(4.0 * 3.5, rel=0.1)


def test_a_large_closed_platform_is_an_object_and_not_floor(scene_builder):
    scene = scene_builder()
    scene.room(5.0, 4.0, 2.0)
    platform = scene.box((1.5, 1.2, 0), (3.3, 2.8, 0.5))
    item = scene.box((2.0, 1.8, 0.5), (2.3, 2.1, 0.8))
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert_found(segments, owners, [platform, item], 0.8)
    assert segments.max() == 2


def test_a_large_carton_on_a_platform_keeps_its_own_top(scene_builder):
    scene = scene_builder()
    scene.room(4.5, 3.5, 2.0)
    platform = scene.box((1.2, 1.0, 0), (3.2, 2.6, 0.3))
    carton = scene.box((1.5, 1.3, 0.3), (2.1, 1.9, 1.0))
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert_found(segments, owners, [platform, carton], 0.8)
    assert segments.max() == 2


def test_shelf_with_boards_and_cartons(scene_builder):
    scene = scene_builder()
    scene.room(4.0, 3.0, 2.2)
    shelf = scene.box((1.0, 1.0, 0.35), (2.6, 1.6, 0.38))
    scene.box((1.0, 1.0, 0.95), (2.6, 1.6, 0.98), owner=shelf)
    for x in (1.0, 2.56):
        for y in (1.0, 1.56):
            scene.box((x, y, 0), (x + 0.04, y + 0.04, 0.35), owner=shelf)
            scene.box((x, y, 0.38), (x + 0.04, y + 0.04, 0.95), owner=shelf)
    cartons = [
        scene.box((x, 1.1, z), (x + 0.35, 1.5, z + 0.3)) for z in (0.38, 0.98) for x in (1.1, 1.6, 2.1)
    ]
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert_found(segments, owners, [shelf, *cartons], 0.6)
    assert segments.max() == 7


def car_park(scene_builder, height=None):
    scene = scene_builder(voxel_m=0.08)
    if height is None:
        scene.sheet(lambda x, y: 0.0 * x, (0, 0), (24, 18))
    else:
        scene.sheet(height, (0, 0), (24, 18))
    things = []
    for x, y in ((3, 3), (3, 7), (12, 3), (12, 9)):
        base = 0.0 if height is None else float(height(np.array(x + 2.0), np.array(y + 0.9)))
        car = scene.box((x, y, base + 0.25), (x + 4.2, y + 1.8, base + 0.9))
        scene.box((x + 1, y + 0.1, base + 0.9), (x + 3.4, y + 1.7, base + 1.5), owner=car)
        scene.box((x + 0.4, y, base), (x + 1.0, y + 1.8, base + 0.25), owner=car)
        scene.box((x + 3.2, y, base), (x + 3.8, y + 1.8, base + 0.25), owner=car)
        things.append(car)
    base = 0.0 if height is None else float(height(np.array(20.0), np.array(14.0)))
    things.append(scene.box((20, 14, base), (20.15, 14.15, base + 5)))
    return scene, things


def test_cars_and_lamppost_on_flat_ground(scene_builder):
    scene, things = car_park(scene_builder)
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert_found(segments, owners, things, 0.75)
    assert segments.max() == len(things)
    assert (segments[owners == 0] > 0).mean() < 0.02


@pytest.mark.parametrize(
    "height",
    [lambda x, y: 0.12 * x + 0.05 * y, lambda x, y: 0.5 * np.sin(x / 4) + 0.4 * np.cos(y / 3)],
    ids=["tilted", "rolling"],
)
def test_ground_need_not_be_level(scene_builder, height):
    scene, things = car_park(scene_builder, height)
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert (segments[owners == 0] > 0).mean() < 0.05
    assert_found(segments, owners, things, 0.5)


def test_objects_without_ground_are_connected_components(scene_builder):
    scene = scene_builder()
    blocks = [scene.box((x, 0, 0), (x + 0.3, 0.3, 0.3)) for x in (0.0, 0.6, 1.2)]
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert_found(segments, owners, blocks, 0.99)


def test_post_under_a_board_belongs_to_it_although_its_top_was_not_seen(scene_builder):
    scene = scene_builder()
    scene.room(3.5, 3.0, 2.0)
    board = scene.box((1.0, 1.0, 0.7), (2.2, 1.7, 0.73))
    scene.box((1.55, 1.3, 0.0), (1.6, 1.35, 0.6), owner=board)
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert segments.max() == 1
    assert best_overlap(segments, owners, board)[0] > 0.9


def test_floating_piece_joins_the_neighbour_it_touches(scene_builder):
    scene = scene_builder()
    scene.room(3.5, 3.0, 2.0)
    body = scene.box((1.0, 1.0, 0.0), (1.4, 1.4, 0.6))
    scene.box((1.445, 1.1, 0.3), (1.6, 1.25, 0.5), owner=body)
    apart = scene.box((2.2, 1.1, 0.3), (2.35, 1.25, 0.5))
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert_found(segments, owners, [body, apart], 0.85)


def test_fragments_of_one_board_are_one_support(scene_builder):
    scene = scene_builder()
    scene.room(3.5, 3.0, 2.0)
    left = scene.box((1.0, 1.0, 0.7), (1.6, 1.6, 0.73))
    scene.box((1.75, 1.0, 0.7), (2.4, 1.6, 0.73), owner=left)
    scene.box((1.0, 1.0, 1.2), (1.7, 1.6, 1.23))
    for x in (1.0, 1.5):  # two cartons side by side are two bodies, however close their tops are
        scene.box((x, 2.0, 0.0), (x + 0.4, 2.4, 0.4))
    surface, owners = scene.build()
    view = GravityView.of(surface)
    structure = find_structure(surface, SETTINGS, 0).is_structure
    supports = find_supports(surface, view, structure, SETTINGS)
    owners_of_supports = [set(owners[support.members].tolist()) for support in supports]
    assert sorted(map(sorted, owners_of_supports)) == [[1], [2]]


def test_the_same_surface_gives_the_same_numbers(scene_builder):
    surface, _ = furnished_room(scene_builder)[0].build()
    first = discover_objects(surface, SETTINGS)
    assert np.array_equal(first, discover_objects(surface, SETTINGS))
    numbers, places = np.unique(first[first > 0], return_index=True)
    assert numbers.tolist() == list(range(1, first.max() + 1))
    assert (np.diff(places) > 0).all()


@pytest.mark.parametrize(
    ("angle_deg", "shift"), [(0, (50.0, -20.0, 7.0)), (37, (0, 0, 0)), (141, (-3, 8, 1))]
)
def test_partition_does_not_depend_on_where_the_world_is(scene_builder, make_surface, angle_deg, shift):
    surface, _ = furnished_room(scene_builder)[0].build()
    rotation = Rotation.from_rotvec(np.deg2rad(angle_deg) * np.array([0, 0, 1.0])).as_matrix()
    moved = type(surface)(
        **{
            **surface.__dict__,
            "points_world": (surface.points_world @ rotation.T + shift).astype(np.float32),
            "normals_world": (surface.normals_world @ rotation.T).astype(np.float32),
        }
    )
    first, second = discover_objects(surface, SETTINGS), discover_objects(moved, SETTINGS)
    assert first.max() == second.max()
    table = np.zeros((first.max() + 1, second.max() + 1), int)
    np.add.at(table, (first, second), 1)
    assert table.max(axis=1).sum() > 0.995 * len(first)


def test_gravity_need_not_be_the_world_axis(scene_builder):
    scene, table, items = furnished_room(scene_builder)
    surface, owners = scene.build()
    rotation = Rotation.from_euler("xyz", [70, 20, 0], degrees=True).as_matrix()
    tilted = type(surface)(
        **{
            **surface.__dict__,
            "points_world": (surface.points_world @ rotation.T).astype(np.float32),
            "normals_world": (surface.normals_world @ rotation.T).astype(np.float32),
            "up_world": rotation @ surface.up_world,
        }
    )
    assert_found(discover_objects(tilted, SETTINGS), owners, [table, *items], 0.7)


def test_small_segments_are_dropped(scene_builder):
    scene = scene_builder()
    scene.room(3.0, 3.0, 2.0)
    scene.box((1.0, 1.0, 0.0), (1.05, 1.05, 0.05))
    large = scene.box((2.0, 1.0, 0.0), (2.3, 1.3, 0.3))
    surface, owners = scene.build()
    segments = discover_objects(surface, SETTINGS)
    assert segments.max() == 1
    assert best_overlap(segments, owners, large)[0] > 0.85


@pytest.mark.parametrize("count", [0, 1, 2, 60])
def test_tiny_surfaces(make_surface, count):
    points = np.stack([np.arange(count) * 0.02, np.zeros(count), np.zeros(count)], 1) + 0.01
    surface, _ = make_surface(points, np.tile([0.0, 0.0, 1.0], (count, 1)), 0.02)
    segments = discover_objects(surface, SETTINGS)
    assert segments.shape == (count,)
    assert segments.max(initial=0) == (1 if count >= SETTINGS.min_voxels else 0)
