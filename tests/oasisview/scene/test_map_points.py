from __future__ import annotations

import numpy as np
import pytest

from oasisview.scene.map_points import LABEL_RGB, identity_rgb, load_map_points, object_colours
from pipeline.result import ChangeLabel, Result


def test_every_point_is_there_when_the_map_is_small(small_result: Result) -> None:
    points = load_map_points(small_result)
    assert (
        points.shown_points == points.total_points == sum(len(s.points_world) for s in small_result.sessions)
    )
    for session, visit in zip(small_result.sessions, points.visits, strict=True):
        ids = np.asarray(session.object_ids)
        assert len(visit.objects) == (ids > 0).sum() and (visit.object_ids > 0).all()
        own = np.asarray(session.points_world)[ids == 4]
        shown = visit.objects[visit.object_ids == 4] + points.origin
        assert shown == pytest.approx(own, abs=1e-4)
    assert 0.005 < points.point_size_m < 0.3


def test_thinning_keeps_every_object(small_result: Result) -> None:
    points = load_map_points(small_result, max_points=8000)
    assert points.shown_points <= 8000 < points.total_points
    shown = {i for visit in points.visits for i in np.unique(visit.object_ids).tolist()}
    assert shown == {item.object_id for item in small_result.objects}


def test_colours_follow_labels_and_leave_the_mode_true_alone(small_result: Result) -> None:
    visit = load_map_points(small_result).visits[1]
    labels = {item.object_id: item.label for item in small_result.objects}
    arguments = (visit.objects_rgb, visit.object_ids)
    true = object_colours(*arguments, "true", labels.__getitem__, LABEL_RGB[False], dark=False)
    assert (true == visit.objects_rgb).all()
    before = object_colours(*arguments, "label", labels.__getitem__, LABEL_RGB[False], dark=False)
    labels[12] = ChangeLabel.STATIC
    after = object_colours(*arguments, "label", labels.__getitem__, LABEL_RGB[False], dark=False)
    changed = (before != after).any(axis=1)
    assert changed[visit.object_ids == 12].all() and not changed[visit.object_ids != 12].any()
    red, green, blue = before[visit.object_ids == 12].mean(axis=0)
    assert red > green and red > blue


def test_identities_are_told_apart_and_the_same_on_both_visits(small_result: Result) -> None:
    colours = np.array([identity_rgb(i) for i in range(1, 31)], float)
    distance = np.linalg.norm(colours[:, None] - colours[None], axis=-1) + 1e3 * np.eye(30)
    assert distance.min() > 15
    visits = load_map_points(small_result).visits
    colours_of = [
        object_colours(
            0 * v.objects_rgb,
            v.object_ids,
            "identity",
            lambda i: ChangeLabel.STATIC,
            LABEL_RGB[True],
            dark=True,
        )[v.object_ids == 4]
        for v in visits
    ]
    assert (colours_of[0][0] == colours_of[1][0]).all()
