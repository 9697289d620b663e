from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.evaluation import read_ground_truth
from pipeline.ply import write_ply

IDENTITY = np.eye(4).tolist()
DOUBLED = np.diag([2, 2, 2, 1]).tolist()


@pytest.fixture
def truth_ply(build, tmp_path: Path) -> Path:
    write_ply(tmp_path / "gt.ply", build.truth([(0, 0, 1, 3)]))
    return tmp_path / "gt.ply"


def test_motions_are_read_beside_the_points(truth_ply: Path) -> None:
    assert read_ground_truth(truth_ply).motions == {}
    matrix = [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]]
    record = {
        "schema_version": 1,
        "motions": [
            {"object_id": 3, "T_world_motion": matrix, "symmetry_order": 4},
            {"object_id": 9, "T_world_motion": IDENTITY},
        ],
    }
    truth_ply.with_suffix(".json").write_text(json.dumps(record))
    truth = read_ground_truth(truth_ply)
    assert len(truth.points) == 1
    assert truth.motions[3].symmetry_order == 4
    np.testing.assert_array_equal(truth.motions[3].T_world_motion[:3, 3], [5, 6, 7])  # row by row
    assert truth.motions[9].symmetry_order == 1


@pytest.mark.parametrize(
    ("record", "message"),
    [
        ({"schema_version": 2}, "schema version 2, this program reads 1"),
        ([], "schema version None"),
        ({"schema_version": 1, "motions": 7}, "motions is not a list"),
        ({"schema_version": 1, "motions": [7]}, "motion 0 is not an object"),
        ({"schema_version": 1, "motions": [{"object_id": 0}]}, "motion 0 has the object_id 0"),
        ({"schema_version": 1, "motions": [{"object_id": True}]}, "object_id True"),
        (
            {"schema_version": 1, "motions": [{"object_id": 1, "symmetry_order": -1}]},
            "symmetry_order -1",
        ),
        (
            {"schema_version": 1, "motions": [{"object_id": 1, "T_world_motion": [[2, 0], [0, 2]]}]},
            "object 1 has no rigid 4x4",
        ),
        (
            {"schema_version": 1, "motions": [{"object_id": 1, "T_world_motion": DOUBLED}]},
            "object 1 has no rigid 4x4",
        ),
        (
            {"schema_version": 1, "motions": [{"object_id": 4, "T_world_motion": IDENTITY}] * 2},
            "object 4 has two motions",
        ),
    ],
)  # fmt: skip
def test_broken_motions_are_one_line(truth_ply: Path, record: object, message: str) -> None:
    truth_ply.with_suffix(".json").write_text(json.dumps(record))
    with pytest.raises(InputError, match=message):
        read_ground_truth(truth_ply)


def test_json_that_is_none_is_one_line(truth_ply: Path) -> None:
    truth_ply.with_suffix(".json").write_text("{")
    with pytest.raises(InputError, match="not valid JSON"):
        read_ground_truth(truth_ply)
