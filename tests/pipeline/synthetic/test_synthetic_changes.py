from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera import invert_rigid, transform_points
from pipeline.synthetic import SCENES, build_scene
from pipeline.synthetic.footprint import Area, footprint
from pipeline.synthetic.motion import T_world_motion, is_move, shift_m, surface_centroid, turn_deg
from pipeline.synthetic.shapes import box, pose
from pipeline.synthetic.world import SceneObject

SEEDS = range(1, 4)  # any three in a row hold one of many moves


@pytest.fixture(scope="module", params=SCENES)
def drawn(request):
    return [build_scene(request.param, seed, 8, (64, 48)) for seed in SEEDS]


def placed(before, after, symmetry=1, low=(-0.2, -0.1, 0), high=(0.2, 0.1, 0.3)) -> SceneObject:
    return SceneObject(1, "thing", box(low, high, 0), (before, after), symmetry_order=symmetry)


angles = st.floats(-np.pi, np.pi)
lengths = st.floats(-5, 5)


@given(lengths, lengths, angles, lengths, lengths, angles)
def test_the_motion_takes_each_point_from_its_old_place_to_its_new_one(x0, y0, a0, x1, y1, a1):
    thing = placed(pose(x0, y0, 0.7, a0), pose(x1, y1, 0.2, a1))
    corners = thing.mesh.corners.reshape(-1, 3)
    moved = transform_points(T_world_motion(thing), transform_points(thing.poses[0], corners))
    np.testing.assert_allclose(moved, transform_points(thing.poses[1], corners), atol=1e-4)


@given(lengths, lengths, angles, st.floats(0.0, 0.2), angles, st.floats(-0.6, 0.6))
def test_a_move_is_more_than_five_centimetres_or_ten_degrees(x, y, yaw, distance, heading, turn):
    before = pose(x, y, 0, yaw)
    after = before @ pose(distance * np.cos(heading), distance * np.sin(heading), 0, turn)
    thing = placed(before, after)
    assert shift_m(thing) == pytest.approx(distance, abs=1e-9)
    assert turn_deg(thing) == pytest.approx(np.degrees(abs(turn)), abs=1e-4)
    if abs(distance - 0.05) > 1e-6 and abs(abs(turn) - np.deg2rad(10)) > 1e-6:
        assert is_move(thing) == (distance > 0.05 or abs(turn) > np.deg2rad(10))
        assert thing.fate == ("moved" if is_move(thing) else "static")


@given(st.integers(1, 8), st.integers(0, 8), st.floats(-0.15, 0.15))
def test_a_turn_by_a_symmetry_is_no_turn(order, steps, rest):
    after = pose(0, 0, 0, steps * 2 * np.pi / order + rest)
    assert turn_deg(placed(np.eye(4), after, order)) == pytest.approx(np.degrees(abs(rest)), abs=1e-4)


@given(angles, angles)
def test_of_a_round_thing_only_its_axis_can_be_seen_to_turn(yaw, tip):
    assert turn_deg(placed(np.eye(4), pose(0, 0, 0, yaw), 0)) == pytest.approx(0, abs=1e-4)
    tipped = pose(0, 0, 0, yaw) @ pose(0, 0, 0, tip, "x")
    assert turn_deg(placed(np.eye(4), tipped, 0)) == pytest.approx(np.degrees(abs(tip)), abs=1e-4)


def test_a_turn_about_a_far_corner_is_a_shift_of_the_centroid():
    thing = placed(np.eye(4), pose(0, 0, 0, 0.17), low=(1, 0, 0), high=(1.2, 0.2, 0.2))
    assert turn_deg(thing) < 10 and shift_m(thing) > 0.15 and is_move(thing)
    np.testing.assert_allclose(surface_centroid(thing.mesh), [1.1, 0.1, 0.1], atol=1e-6)


def test_what_is_there_in_one_visit_only_has_no_motion():
    with pytest.raises(ValueError, match="one visit"):
        T_world_motion(placed(np.eye(4), None))
    assert not is_move(placed(np.eye(4), None))


def test_boxes_overlap_when_they_cut_into_each_other():
    cube = box((-0.5, -0.5, 0), (0.5, 0.5, 1), 0)
    here = footprint(cube, np.eye(4))
    assert here.overlaps(footprint(cube, pose(0.9, 0, 0)))
    assert not here.overlaps(footprint(cube, pose(1.1, 0, 0)))
    # Turned by 45 degrees its corner reaches farther, but only along the axes.
    assert here.overlaps(footprint(cube, pose(1.15, 0, 0, np.pi / 4)))
    assert not here.overlaps(footprint(cube, pose(0.95, 0.95, 0, np.pi / 4)))
    assert not here.overlaps(footprint(cube, pose(0, 0, 1.0)))  # stacked
    assert not here.overlaps(footprint(cube, pose(0.95, 0, 0)), slack_m=0.06)


def test_an_area_holds_what_stands_wholly_in_it():
    cube = box((-0.5, -0.5, 0), (0.5, 0.5, 1), 0)
    area = Area(pose(2, 0, 0, np.pi / 2), 2.0, 1.0)  # 2 m deep along y, 1 m along x
    assert area.contains(footprint(cube, pose(2.4, 1.4, 0)))
    assert not area.contains(footprint(cube, pose(2.6, 1.4, 0)))
    assert not area.contains(footprint(cube, pose(2.4, 1.6, 0)))


def test_a_third_of_the_seeds_holds_many_moves(drawn):
    moves = [sum(thing.fate == "moved" for thing in scene.objects) for scene in drawn]
    assert sum(count >= 10 for count in moves) == 1
    assert all(count >= 2 for count in moves)


def test_every_kind_of_change_occurs_over_a_few_seeds(drawn):
    stories = Counter(thing.story for scene in drawn for thing in scene.objects)
    assert {"carried", "shifted", "turned", "reprinted", "look-alike", "different"} <= stories.keys()
    for scene in drawn:
        fates = {thing.fate for thing in scene.objects}
        assert fates == {"static", "appeared", "disappeared", "moved", "replaced"}


def test_moves_are_clear_and_jolts_are_not_moves(drawn):
    for thing in (thing for scene in drawn for thing in scene.objects):
        if thing.fate == "moved":
            # Well beyond the thresholds: no label hangs on a millimetre.
            assert shift_m(thing) > 0.07 or turn_deg(thing) > 20
        if thing.story == "jolted":
            assert not np.array_equal(*thing.poses) and thing.fate == "static"
        if thing.story == "turned":
            assert turn_deg(thing) > 20
            np.testing.assert_allclose(thing.poses[0][:3, 3], thing.poses[1][:3, 3])


def test_some_short_moves_overlap_the_old_place(drawn):
    short = 0
    for thing in (thing for scene in drawn for thing in scene.objects):
        if thing.fate == "moved" and thing.story in ("shifted", "turned"):
            boxes = [footprint(thing.mesh, T) for T in thing.poses]
            short += boxes[0].overlaps(boxes[1])
    assert short >= 2


def test_there_are_look_alikes_and_of_those_that_look_the_same_at_most_one_changes(drawn):
    same_shape, twins = 0, 0
    for scene in drawn:
        by_shape: dict[bytes, list[SceneObject]] = {}
        for thing in scene.objects:
            by_shape.setdefault(thing.mesh.corners.tobytes(), []).append(thing)
        for group in by_shape.values():
            for one, other in combinations(group, 2):
                if not np.array_equal(one.mesh.tile, other.mesh.tile):
                    same_shape += 1
                    continue
                twins += 1
                assert "static" in (one.fate, other.fate)
    assert same_shape >= 6 and twins >= 1


def test_nothing_is_put_into_anything_else(drawn):
    for scene in drawn:
        for thing in scene.objects:
            if thing.fate != "moved" or thing.story == "tipped":
                continue
            box_now = footprint(thing.mesh, thing.poses[1], 0.85)
            for other in scene.objects:
                if other is thing or other.poses[1] is None or abs(other.poses[1][2, 2]) < 0.99:
                    continue
                if other.class_name in ("desk", "bookcase", "rack", "cabinet", "tree"):
                    continue
                assert not box_now.overlaps(footprint(other.mesh, other.poses[1], 0.85), 0.02)


def test_the_visits_take_different_paths(drawn):
    for scene in drawn:
        first, second = scene.paths
        gaps = np.linalg.norm(first[:, None, :3, 3] - second[None, :, :3, 3], axis=-1).min(axis=1)
        assert gaps.max() > 0.2
        relative = [invert_rigid(a) @ b for a, b in zip(first, second, strict=True)]
        assert max(np.linalg.norm(T[:3, 3]) for T in relative) > 0.5
