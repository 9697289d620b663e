from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.evaluation import GroundTruth, Motion, evaluate_preset
from pipeline.evaluation.counts import Counts
from pipeline.evaluation.khronos import FlaggedObject, score_objects, surface_votes
from pipeline.evaluation.livingscenes import InstanceScores, is_dynamic, livingscenes_scores
from pipeline.evaluation.matched import match
from pipeline.evaluation.motion_error import rotation_about
from pipeline.evaluation.presets import PRESETS, preset_report
from pipeline.result import ChangeLabel

UNKNOWN, STATIC, APPEARED, DISAPPEARED, MOVED = ChangeLabel
UP = np.array([0.0, 0.0, 1.0])


def line(session: int, start: int, count: int, *rest: int) -> list[tuple]:
    return [(session, start + i, *rest) for i in range(count)]


def bar(start: float, count: int, **flags: bool) -> FlaggedObject:
    points = np.zeros((count, 3))
    points[:, 0] = start + np.arange(count)
    return FlaggedObject(points, **flags)


def test_surface_votes_go_to_the_nearest_object_within_reach() -> None:
    others = [bar(0, 2), bar(2.2, 3)]
    assert surface_votes([bar(0.1, 4), bar(4.6, 2), bar(9, 2)], others, 0.5) == [0, 1, -1]
    assert surface_votes([bar(0, 2)], [], 0.5) == [-1]


def test_khronos_counted_by_hand() -> None:
    true = [
        bar(0, 4, appeared=True),  # found, flagged: TP
        bar(10, 4, appeared=True),  # found, not flagged: FN
        bar(20, 4),  # found, wrongly flagged as disappeared: FP
        bar(30, 4, disappeared=True),  # missed
        bar(40, 4, scored=False),  # what matches it counts nowhere
    ]
    predicted = [
        bar(0, 2, appeared=True),
        bar(2, 2, appeared=True),  # the other half: many to one, so a second TP
        bar(10, 4),
        bar(20, 4, disappeared=True),
        bar(40, 4, appeared=True),
        bar(50, 4, disappeared=True),  # hallucinated
    ]
    scores = score_objects(predicted, true, 0.5)
    assert scores.appeared == Counts(tp=2, fp=0, fn=1)
    assert scores.disappeared == Counts(tp=0, fp=1, fn=0)
    assert scores.change == Counts(tp=2, fp=1, fn=1)
    assert scores.appeared_including == Counts(tp=2, fp=0, fn=1)
    assert scores.disappeared_including == Counts(tp=0, fp=2, fn=1)
    assert scores.objects == Counts(tp=4, fp=1, fn=1)
    assert scores.object_recall == pytest.approx(3 / 4)


def test_khronos_sees_a_move_as_two_changes(build) -> None:
    truth = build.truth(
        line(0, 0, 4, MOVED, 1)
        + line(1, 20, 4, MOVED, 1)
        + line(0, 40, 4, STATIC, 2)
        + line(1, 40, 4, STATIC, 2)
    )
    result = build.result(
        line(0, 0, 4, 11) + line(1, 20, 4, 12) + line(0, 40, 4, 13) + line(1, 40, 4, 13),
        {11: DISAPPEARED, 12: APPEARED, 13: STATIC},
    )
    scores = preset_report("khronos", match(result, GroundTruth(truth), 0.1)).to_dict()
    assert scores["appeared"]["tp"] == scores["disappeared"]["tp"] == 1
    assert scores["change"]["f1"] == scores["change_including"]["f1"] == 1
    assert scores["objects"]["matched"] == scores["objects"]["recalled"] == 3


def test_dynamic_is_more_than_a_degree_or_five_centimetres() -> None:
    centroid = np.array([100.0, 0, 0])

    def about_centroid(turn_deg: float, shift_m: float) -> Motion:
        T = np.eye(4)
        T[:3, :3] = rotation_about(UP, np.radians(turn_deg))
        T[:3, 3] = centroid - T[:3, :3] @ centroid + [shift_m, 0, 0]
        return Motion(T)

    assert not is_dynamic(about_centroid(0.9, 0.04), centroid)  # 1.6 m at the origin, but it stands at 100 m
    assert is_dynamic(about_centroid(1.1, 0), centroid)
    assert is_dynamic(about_centroid(0, 0.06), centroid)


def test_livingscenes_counted_by_hand(build) -> None:
    truth = build.truth(
        line(0, 0, 4, STATIC, 1)
        + line(1, 0, 4, STATIC, 1)  # 11, static: matched and registered
        + line(0, 10, 4, STATIC, 2)
        + line(1, 10, 4, STATIC, 2)  # lost
        + line(0, 20, 4, MOVED, 3)
        + line(1, 30, 4, MOVED, 3)  # 13: matched, registered by its centroid
        + line(0, 40, 4, MOVED, 4)
        + line(1, 50, 4, MOVED, 4)  # 14: matched, but turned about its end in truth
        + line(0, 60, 4, MOVED, 5)
        + line(1, 70, 4, MOVED, 5)  # 15: matched, its motion is not known
        + line(0, 80, 4, DISAPPEARED, 6)  # not in both
    )
    result = build.result(
        line(0, 0, 4, 11)
        + line(1, 0, 4, 11)
        + line(0, 10, 4, 12)
        + line(0, 20, 4, 13)
        + line(1, 30, 4, 13)
        + line(0, 40, 4, 14)
        + line(1, 50, 4, 14)
        + line(0, 60, 4, 15)
        + line(1, 70, 4, 15)
        + line(0, 80, 4, 16),
        {11: STATIC, 12: DISAPPEARED, 13: MOVED, 14: MOVED, 15: MOVED, 16: DISAPPEARED},
    )
    slid, flipped = np.eye(4), np.eye(4)
    slid[0, 3] = 10
    flipped[:3, :3] = rotation_about(UP, np.pi)
    flipped[0, 3] = 93 + 0.04  # 40.02 -> 53.02: the same places, end for end
    flipped[1, 3] = 0.04
    matched = match(result, GroundTruth(truth, {3: Motion(slid), 4: Motion(flipped)}), 0.1)
    scores = livingscenes_scores(matched)
    assert scores.static == InstanceScores(
        present=2, matched=1, registrable=1, registered=1, rotation_right=1, present_with_motion=2
    )
    assert scores.dynamic == InstanceScores(
        present=3, matched=3, registrable=2, registered=1, rotation_right=1, present_with_motion=2
    )
    assert scores.to_dict()["all"]["matching_recall"] == pytest.approx(4 / 5)
    assert scores.to_dict()["all"]["registration_recall_of_present"] == pytest.approx(2 / 4)
    assert scores.to_dict()["scene_hit"] == {"0.25": True, "0.5": True, "0.75": True}
    two_fold = GroundTruth(truth, {3: Motion(slid), 4: Motion(flipped, symmetry_order=2)})
    assert livingscenes_scores(match(result, two_fold, 0.1)).dynamic.registered == 2
    # A motion that was registered is taken instead of the centroid's shift.
    rows = tuple(map(tuple, flipped.tolist()))
    result.objects = tuple(
        dataclasses.replace(item, T_world_motion=rows) if item.object_id == 14 else item
        for item in result.objects
    )
    known = GroundTruth(truth, {3: Motion(slid), 4: Motion(flipped)})
    assert livingscenes_scores(match(result, known, 0.1)).dynamic.registered == 2


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_presets_state_what_they_counted_with(build, name: str) -> None:
    truth = build.truth(line(0, 0, 3, STATIC, 1) + line(1, 0, 3, STATIC, 1))
    result = build.result(line(0, 0, 3, 11) + line(1, 0, 3, 11), {11: STATIC})
    report = preset_report(name, match(result, GroundTruth(truth), 0.1))
    data = json.loads(json.dumps(report.to_dict()))
    assert (data["preset"], data["parameters"]["voxel_m"], data["parameters"]["match_radius_m"]) == (
        name,
        0.05,
        0.1,
    )
    head = report.table().splitlines()
    assert head[0].startswith(f"preset {name}: ")
    assert head[1].startswith("voxel_m 0.05, match_radius_m 0.1, labels machine")


def test_the_papers_tables_agree_with_the_full_report(build) -> None:
    truth = build.truth(line(0, 0, 3, DISAPPEARED, 1) + line(1, 0, 2, APPEARED, 2) + line(1, 9, 1, STATIC, 0))
    result = build.result(line(0, 0, 3, 11) + line(1, 0, 3, 0) + line(1, 9, 1, 0), {11: DISAPPEARED})
    data = preset_report("paper", match(result, GroundTruth(truth), 0.1)).to_dict()
    assert data["change"]["replaced"] == Counts(tp=0, fp=0, fn=5).to_dict()  # the appeared half was missed
    assert data["change"]["appeared_disappeared"]["fp"] == 3
    assert data["change"]["micro"]["tp"] == 1
    assert data["change"]["macro_f1"] == pytest.approx((0.5 + 0 + 0) / 3)
    assert data["association"]["removed"]["recall"] == 1
    assert [item["tp"] for item in data["detection"]] == [1, 1, 0, 0]


def test_an_unknown_preset_is_one_line(tmp_path) -> None:
    with pytest.raises(InputError, match="choose one of paper, khronos, livingscenes, scenediff"):
        evaluate_preset("coco", tmp_path, tmp_path)
