from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview.scene.cut import FACES, STEP_M, CutFrame
from oasisview.scene.map_points import load_map_points


@pytest.fixture
def frame(small_result) -> CutFrame:
    return CutFrame.of(small_result, load_map_points(small_result))


def test_the_frame_reaches_around_the_map(small_result, frame: CutFrame) -> None:
    points = np.concatenate([session.points_world for session in small_result.sessions])
    low, high = np.percentile(points, [1, 99], axis=0)
    assert frame.low_m[0] <= low[0] and frame.high_m[0] >= high[0]
    assert frame.low_m[2] == 0 and frame.high_m[2] >= high[2] - low[2]
    assert frame.whole().is_whole
    assert frame.whole().holds(points).all()  # strays beyond the reach, too


def test_a_height_cut_leaves_what_is_lower(small_result, frame: CutFrame) -> None:
    box = frame.whole().moved("height_high", 0.8)
    assert not box.is_whole
    points = load_map_points(small_result)
    for visit in points.visits:
        kept = box.cut(visit)
        world = visit.objects + points.origin
        expected = world[:, 2] - frame.floor_m <= 0.8
        assert 0 < len(kept.objects) < len(visit.objects)
        assert len(kept.objects) == pytest.approx(expected.sum(), abs=2)
        assert len(kept.objects) == len(kept.objects_rgb) == len(kept.object_ids)
        assert len(kept.background) == len(kept.background_rgb) <= len(visit.background)
        assert (kept.objects[:, 2] + points.origin[2] - frame.floor_m).max() <= 0.8 + 1e-4
    outside = box.corners_world()
    assert outside[:, 2].max() == pytest.approx(0.8 + frame.floor_m, abs=1e-6)


@given(st.lists(st.tuples(st.sampled_from(FACES), st.floats(-100, 100)), max_size=12))
def test_sides_never_cross_and_stay_in_reach(moves) -> None:
    frame = CutFrame(np.eye(3), np.array([5.0, 0, 0]), (-2.0, 1.0, 0.0), (3.0, 4.0, 2.5), 0.7)
    box = frame.whole()
    for face, value in moves:
        box = box.moved(face, value)
        axis = ("x", "y", "height").index(face.rpartition("_")[0])
        assert box.high_m[axis] - box.low_m[axis] >= STEP_M - 1e-6
        assert frame.low_m[axis] <= box.low_m[axis] and box.high_m[axis] <= frame.high_m[axis]
    centre = (np.array(box.low_m) + box.high_m) / 2 + [0, 0, 0.7]
    assert box.holds(centre[None]).all()


def test_there_are_six_sides(frame: CutFrame) -> None:
    for face in ("depth_low", "x", "height_middle", ""):
        with pytest.raises(ValueError, match="no side"):
            frame.whole().moved(face, 1.0)


def test_around_an_object_holds_it_and_some_surroundings(small_result, frame: CutFrame) -> None:
    sighting = small_result.object(1).sightings[0]
    low, high = np.array(sighting.box_min_world_m), np.array(sighting.box_max_world_m)
    box = frame.around(low, high)
    session = small_result.sessions[0]
    points = session.points_world[session.object_ids == 1]
    assert box.holds(points).all()
    assert not box.is_whole
    assert not box.holds(session.points_world).all()
