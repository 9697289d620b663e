import numpy as np
import pytest

from pipeline.camera import PinholeCamera, transform_points
from pipeline.ply import NOT_SCORED
from pipeline.result import ChangeLabel
from pipeline.synthetic.atlas import TextureAtlas
from pipeline.synthetic.paths import look_at
from pipeline.synthetic.props import Prop, Workshop
from pipeline.synthetic.render import Renderer
from pipeline.synthetic.shapes import Mesh, box, join, pose
from pipeline.synthetic.truth import SeenPoints, TruthSettings, label_points, observed
from pipeline.synthetic.world import Lighting

SETTINGS = TruthSettings(min_points=5)
STATIC, APPEARED, DISAPPEARED, MOVED = (
    ChangeLabel.STATIC,
    ChangeLabel.APPEARED,
    ChangeLabel.DISAPPEARED,
    ChangeLabel.MOVED,
)


def label(counts: dict[int, tuple[int, int]], known: dict[tuple[int, int], float], static=(), moved=()):
    """Labels of one object per entry of counts; known[object, visit] is the observed share of its points."""
    ids, flags = [], []
    for visit in (0, 1):
        numbers = np.concatenate([np.full(c[visit], n, dtype=np.int32) for n, c in counts.items()])
        seen = np.concatenate(
            [np.arange(c[visit]) < round(known.get((n, visit), 0) * c[visit]) for n, c in counts.items()]
        )
        ids.append(numbers)
        flags.append(seen)
    labels = label_points((ids[0], ids[1]), (flags[0], flags[1]), set(static), set(moved), SETTINGS)
    return {
        (number, visit): set(labels[visit][ids[visit] == number].tolist())
        for number in counts
        for visit in (0, 1)
        if counts[number][visit]
    }


def test_seen_in_both_visits_is_moved():
    got = label({3: (100, 80)}, {(3, 0): 1.0, (3, 1): 0.0}, moved=[3])
    assert got == {(3, 0): {MOVED}, (3, 1): {MOVED}}


def test_a_destination_never_seen_is_not_a_move():
    assert label({3: (100, 0)}, {(3, 0): 0.9}, moved=[3]) == {(3, 0): {DISAPPEARED}}
    assert label({3: (0, 100)}, {(3, 1): 0.9}, moved=[3]) == {(3, 1): {APPEARED}}


def test_a_glimpse_of_the_destination_is_not_a_move_and_not_scored():
    got = label({3: (100, 6)}, {(3, 0): 0.9, (3, 1): 1.0}, moved=[3])
    assert got == {(3, 0): {DISAPPEARED}, (3, 1): {NOT_SCORED}}


@pytest.mark.parametrize(("share", "expected"), [(0.4, NOT_SCORED), (0.6, APPEARED)])
def test_what_came_is_scored_only_where_the_other_visit_looked(share, expected):
    assert label({5: (0, 50)}, {(5, 1): share}) == {(5, 1): {int(expected)}}


def test_a_static_object_is_static_once_both_visits_saw_any_of_it():
    got = label({2: (50, 4)}, {(2, 0): 0.05, (2, 1): 1.0}, static=[2])
    assert got == {(2, 0): {STATIC}, (2, 1): {STATIC}}
    assert label({2: (50, 0)}, {(2, 0): 0.1}, static=[2]) == {(2, 0): {NOT_SCORED}}


def test_background_is_scored_point_by_point():
    got = label({0: (10, 10)}, {(0, 0): 0.3, (0, 1): 1.0})
    assert got == {(0, 0): {STATIC, NOT_SCORED}, (0, 1): {STATIC}}


CAMERA = PinholeCamera(80, 60, 60.0, 60.0, 39.5, 29.5)


def renderer(*things: tuple[Mesh, int]) -> Renderer:
    atlas = TextureAtlas()
    atlas.add(np.full((4, 4, 3), 128, dtype=np.uint8))
    white = np.ones(3)
    floor = box((-5, -5, -0.1), (5, 5, 0), 0)
    meshes = [floor, *(mesh for mesh, _ in things)]
    owners = [np.zeros(len(floor.tile)), *(np.full(len(mesh.tile), number) for mesh, number in things)]
    light = Lighting((), white, white, white, 1.0)
    return Renderer(join(meshes), np.concatenate(owners).astype(np.int32), atlas, light)


def seen_by(world: Renderer, points, eye, target, ids=1, partners=None):
    owners = np.full(len(points), ids, dtype=np.int32)
    path = look_at(np.array(eye, dtype=float), np.array(target, dtype=float))[None]
    cloud = np.array(points, dtype=np.float32)
    return observed(cloud, owners, CAMERA, path, world.first_hit, 20.0, partners or {}, SETTINGS).tolist()


def test_seen_through_is_observed_and_occluded_is_not():
    wall = box((-1, 1, 0), (1, 1.1, 2), 0)
    points = [(0, 0.5, 0.3), (0, 2, 0.3)]  # before and behind the wall
    assert seen_by(renderer(), points, (0, -2, 1), (0, 1, 0.3)) == [True, True]
    assert seen_by(renderer((wall, 7)), points, (0, -2, 1), (0, 1, 0.3)) == [True, False]


def test_outside_the_picture_or_the_range_is_not_observed():
    assert seen_by(renderer(), [(0, -4, 0.3)], (0, -2, 1), (0, 1, 0.3)) == [False]
    far = [(0.0, 30.0, 0.5)]
    assert seen_by(renderer(), far, (0, -2, 1), (0, 30, 0.5)) == [False]


def test_what_stands_in_its_place_observes_a_replaced_object():
    successor = box((-0.3, -0.3, 0), (0.3, 0.3, 0.6), 0)
    inside = [(0.0, -0.2, 0.3)]  # 10 cm behind the successor's front
    world = renderer((successor, 9))
    assert seen_by(world, inside, (0, -2, 0.5), (0, 0, 0.3)) == [False]
    assert seen_by(world, inside, (0, -2, 0.5), (0, 0, 0.3), partners={1: 9}) == [True]


def test_a_rendered_point_of_an_unchanged_surface_is_observed_again():
    world = renderer((box((-0.3, -0.3, 0), (0.3, 0.3, 0.6), 0), 1))
    T = look_at(np.array([0.4, -2.0, 1.2]), np.array([0.0, 0.0, 0.3]))
    view = world.view(CAMERA, T)
    shown = view.object_id == 1
    cloud = transform_points(T, CAMERA.backproject(np.where(shown, view.depth, 0))[shown])
    assert len(cloud) > 100
    assert all(seen_by(world, cloud, (0.4, -2.0, 1.2), (0, 0, 0.3)))


def test_a_surface_hides_what_is_just_behind_it():
    world = renderer((box((-0.3, -0.3, 0), (0.3, 0.3, 0.6), 0), 1))
    assert seen_by(world, [(0.0, -0.25, 0.3)], (0, -2, 0.3), (0, 0, 0.3), ids=2) == [False]


def test_points_are_thinned_to_one_per_voxel_and_object():
    seen = SeenPoints(0.1)
    seen.add(
        np.array([[0.01, 0, 0], [0.02, 0, 0], [0.15, 0, 0]], dtype=np.float32), np.array([1, 1, 1], np.int32)
    )
    seen.add(np.array([[0.03, 0, 0], [0.04, 0, 0]], dtype=np.float32), np.array([1, 2], np.int32))
    points, owners = seen.points()
    np.testing.assert_allclose(points[:, 0], [0.01, 0.15, 0.04], atol=1e-6)
    assert owners.tolist() == [1, 1, 2]


def test_lookalikes_differ_in_print_but_hardly_in_size():
    from pipeline.synthetic.furniture import carton

    shop = Workshop(np.random.default_rng(1), TextureAtlas())
    first: Prop = carton(shop, (0.5, 0.4, 0.3), (180, 140, 100), (20, 20, 90))
    second = first.lookalike()
    sizes = [np.diff(prop.mesh.bounds, axis=0)[0] for prop in (first, second)]
    np.testing.assert_allclose(sizes[1], sizes[0], rtol=0.11)
    tiles = [int(prop.mesh.tile[0]) for prop in (first, second)]
    textures = shop.atlas.sampler()
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 40))).reshape(2, -1)
    faces = [
        textures.sample(np.full(1600, tile), grid.astype(np.float32), np.full(1600, 0.01, np.float32))
        for tile in tiles
    ]
    assert np.abs(faces[0] - faces[1]).mean() > 0.02


def test_poses_turn_counterclockwise():
    np.testing.assert_allclose(pose(1, 2, 3, np.pi / 2)[:3] @ [1, 0, 0, 1], [1, 3, 3], atol=1e-12)
