from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera import invert_rigid
from pipeline.synthetic import HELD_OUT_SCENES, SCENES, build_scene
from pipeline.synthetic.bore import SPRING_M, Bore, Bowl, Crown, Pipe, Wall
from pipeline.synthetic.hillside import Ground, Line, Terrain
from pipeline.synthetic.motion import shift_m, turn_deg
from pipeline.synthetic.sheets import sheet, tube

BORE = Bore(radius_m=14.0, length_m=15.0, half_width_m=2.1, rise_m=2.0, climb=0.02)
TERRAIN = Terrain(np.array([[0.4, 0.3, 0.1, 1.0], [0.06, 1.5, -1.2, 0.4]]), np.array([0.1, -0.05]))
LINE = Line(np.array([0.0, 0.0, 2.0]), np.array([3.0, 4.0, 1.8]), 0.2)
SUPPORTS = [
    Wall(BORE, 1, (0.4, 0.9)),
    Wall(BORE, -1, (0.4, 0.9)),
    Bowl(BORE, 1),
    Bowl(BORE, -1),
    Pipe(BORE, 1.8, 0.8, 0.1),
    Crown(BORE),
    Ground(TERRAIN),
    Ground(TERRAIN, 0.3),
    LINE,
]


@pytest.mark.parametrize("support", SUPPORTS)
@given(seed=st.integers(0, 1000))
def test_every_place_of_a_support_is_on_it_and_its_poses_are_rigid(support, seed):
    u, v, yaw = support.draw(np.random.default_rng(seed))
    assert support.holds(u, v)
    T = support.pose(u, v, yaw)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1.0)
    if support.turns:
        # A turn leaves the place and the axis alone.
        turned = support.pose(u, v, yaw + 1.0)
        np.testing.assert_allclose(turned[:3, [2, 3]], T[:3, [2, 3]], atol=1e-9)
        # Headings are level: on a slope an angle between them is a little different.
        assert np.arccos(turned[:3, 0] @ T[:3, 0]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("side", [1, -1])
def test_things_on_the_vault_face_inwards_and_stand_upright(side):
    wall = Wall(BORE, side, (0.4, 0.9))
    T = wall.pose(5.0, 0.3, 0.0)
    middle = BORE.at(5.0, 0.0, SPRING_M)
    assert T[:3, 2] @ (middle - T[:3, 3]) > 1.5
    assert T[2, 1] > 0.5  # their y, along which signs read, points up


def test_the_bowl_leans_towards_the_middle_and_the_crown_hangs_plumb():
    for side in (1, -1):
        T = Bowl(BORE, side).pose(4.0, 1.1, 0.3)
        assert T[:3, 2] @ (BORE.at(4.0, 0.0, T[2, 3] - BORE.frame(4.0)[0][2]) - T[:3, 3]) > 0.1
    np.testing.assert_allclose(Crown(BORE).pose(4.0, 0.5, 0.2)[:3, 2], [0, 0, 1], atol=1e-9)


@given(st.floats(-6, 6), st.floats(-6, 6), st.floats(-3, 3))
def test_what_lies_on_the_ground_lies_on_it_and_leans_with_it(x, y, yaw):
    T = Ground(TERRAIN).pose(x, y, yaw)
    assert T[2, 3] == pytest.approx(float(TERRAIN.height(x, y)))
    # A step along its own x and y stays close to the ground.
    for step in (T[:3, 0], T[:3, 1]):
        at = T[:3, 3] + 0.05 * step
        assert abs(at[2] - float(TERRAIN.height(at[0], at[1]))) < 0.003


def test_a_cord_sags_between_its_ends():
    share = np.linspace(0, 1, 11)
    points = LINE.points(share)
    np.testing.assert_allclose(points[[0, -1]], [LINE.start, LINE.end])
    assert points[5, 2] == pytest.approx(1.9 - 0.2)


def test_a_tube_keeps_its_radius_and_a_sheet_its_normals():
    bend = np.linspace(0, np.pi, 15)
    path = np.stack([np.cos(bend), np.sin(bend), 0.1 * bend], axis=1)
    mesh = tube(path, 0.05, 0, caps=False)
    gaps = np.linalg.norm(mesh.corners.reshape(-1, 1, 3) - path[None], axis=-1).min(axis=1)
    np.testing.assert_allclose(gaps, 0.05, atol=1e-4)
    x, y = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 2, 7))
    flat = sheet(np.stack([x, y, 0.5 * x], axis=-1), 0, None)
    np.testing.assert_allclose(np.abs(flat.normals[..., 2]), 1 / np.hypot(1, 0.5), atol=1e-6)
    assert flat.uv.min() == 0 and flat.uv.max() == 1 and len(flat.tile) == 4 * 6 * 2


@pytest.fixture(scope="module", params=HELD_OUT_SCENES)
def drawn(request):
    return [build_scene(request.param, seed, 8, (64, 48)) for seed in (1, 2, 3)]


def test_the_held_out_kinds_are_not_among_those_to_tune_on():
    assert not set(HELD_OUT_SCENES) & set(SCENES)
    assert len(SCENES) == 4


def test_things_lean_hang_and_change_in_every_way(drawn):
    leaning = sum(
        T is not None and abs(T[2, 2]) < 0.995
        for scene in drawn
        for thing in scene.objects
        for T in thing.poses
    )
    assert leaning > 30
    for scene in drawn:
        assert {thing.fate for thing in scene.objects} == {
            "static",
            "appeared",
            "disappeared",
            "moved",
            "replaced",
        }
    moves = [sum(thing.fate == "moved" for thing in scene.objects) for scene in drawn]
    assert max(moves) >= 10 and min(moves) >= 2


def test_some_replacements_differ_in_print_alone(drawn):
    alone = 0
    for scene in drawn:
        for thing in scene.objects:
            if thing.replaced_by is None or thing.story != "reprinted":
                continue
            new = scene.objects[thing.replaced_by - 1]
            np.testing.assert_array_equal(thing.poses[0], new.poses[1])
            if np.array_equal(thing.mesh.corners, new.mesh.corners):
                assert not np.array_equal(thing.mesh.tile, new.mesh.tile)
                alone += 1
    assert alone >= 3


def test_moves_are_clear_jolts_and_swaying_cloth_are_static(drawn):
    swaying = 0
    for thing in (thing for scene in drawn for thing in scene.objects):
        if thing.fate == "moved":
            assert shift_m(thing) > 0.07 or turn_deg(thing) > 20
        if thing.story == "jolted":
            assert thing.fate == "static"
        if thing.mesh_current is not None:
            swaying += 1
            assert thing.fate == "static"
            offset = np.linalg.norm(thing.mesh_current.corners - thing.mesh.corners, axis=-1)
            assert 0 < offset.mean() < 0.06
    assert swaying > 3 or drawn[0].name == "tunnel"


def test_of_things_that_look_the_same_at_most_one_changes(drawn):
    for scene in drawn:
        for one, other in combinations(scene.objects, 2):
            if one.mesh.corners.shape == other.mesh.corners.shape and (
                np.array_equal(one.mesh.tile, other.mesh.tile)
            ):
                assert "static" in (one.fate, other.fate)


def test_the_cameras_stay_inside_and_take_different_paths(drawn):
    for scene in drawn:
        low, high = scene.background.bounds
        for path in scene.paths:
            assert (path[:, :3, 3] > low).all() and (path[:, :3, 3] < high).all()
        steps = [invert_rigid(a) @ b for a, b in zip(*scene.paths, strict=True)]
        assert max(np.linalg.norm(T[:3, 3]) for T in steps) > 0.5
