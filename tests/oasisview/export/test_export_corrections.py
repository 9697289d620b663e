"""Corrections of identity reach every export."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from oasisview.export import ReviewedResult, export
from oasisview.review import Journal, corrections
from pipeline.ply import read_ply
from pipeline.result import ChangeLabel, Result
from pipeline.store import open_result


@pytest.fixture
def corrected_path(small_result_path: Path) -> Path:
    """Ann: 8 and 7 are the same, 4 is two, 12 is no object, 6 and 11 are one (all fragments of one visit)."""
    with Journal.of(open_result(small_result_path)) as journal:
        journal.note(8, "the black box", who="Ann")
        for make in (
            lambda s: corrections.same(s, 8, 7),
            lambda s: corrections.split_visits(s, 4),
            lambda s: corrections.drop(s, 12),
            lambda s: corrections.merge(s, (6, 11)),
        ):
            made = make(journal.corrected())
            journal.correct(made.kind, made.object_id, made.groups, who="Ann", why="seen it")
    return small_result_path


def test_rows_are_the_corrected_objects(corrected_path: Path, tmp_path: Path) -> None:
    export(corrected_path, "json", tmp_path / "map.json")
    rows = {row["id"]: row for row in json.loads((tmp_path / "map.json").read_text())}
    assert sorted(rows) == [1, 2, 3, 4, 5, 6, 7, 9, 10, 16]
    same = rows[7]
    assert (same["label_machine"], same["label_final"], same["machine_ids"]) == ("appeared", "static", [7, 8])
    assert (same["decided_by"], same["why"], same["sessions_seen"]) == ("Ann", "seen it", [0, 1])
    assert same["displacement_m"] == pytest.approx(0.05) and same["replaces"] is None
    assert [note["text"] for note in same["notes"]] == ["the black box"]
    assert (rows[4]["label_final"], rows[16]["label_final"]) == ("disappeared", "appeared")
    assert rows[4]["machine_ids"] == rows[16]["machine_ids"] == [4]
    assert rows[6]["machine_ids"] == [6, 11] and rows[6]["label_machine"] == "appeared"
    assert rows[1]["machine_ids"] == [1] and rows[1]["decided_by"] is None


def test_points_carry_the_corrected_objects(
    corrected_path: Path, small_result: Result, tmp_path: Path
) -> None:
    export(corrected_path, "ply", tmp_path / "map.ply")
    points = read_ply(tmp_path / "map.ply")
    machine = np.concatenate([np.asarray(s.object_ids) for s in small_result.sessions])
    session = np.asarray(points.session)
    expected = {
        (8, 0): (7, ChangeLabel.STATIC), (7, 1): (7, ChangeLabel.STATIC),
        (4, 0): (4, ChangeLabel.DISAPPEARED), (4, 1): (16, ChangeLabel.APPEARED),
        (12, 1): (0, ChangeLabel.STATIC), (11, 1): (6, ChangeLabel.APPEARED),
        (1, 0): (1, ChangeLabel.STATIC),
    }  # fmt: skip
    for (machine_id, visit), (object_id, label) in expected.items():
        chosen = (machine == machine_id) & (session == visit)
        assert chosen.any()
        assert set(np.asarray(points.object_id)[chosen]) == {object_id}
        assert set(np.asarray(points.label)[chosen]) == {int(label)}


def test_masks_belief_and_matrix_of_the_reviewed_result_agree_with_its_objects(corrected_path: Path) -> None:
    machine = open_result(corrected_path)
    result = ReviewedResult.of(machine).result
    before, after = machine.sessions[1].object_mask(2), result.sessions[1].object_mask(2)
    assert after.dtype == before.dtype and set(np.unique(after[before == 4])) <= {16}
    assert not np.isin(after, (11, 12)).any() and np.isin(before, (6, 11, 12)).any()
    matrix = result.score_matrix
    rows = dict(zip(machine.score_matrix.row_object_ids, matrix.row_object_ids, strict=True))
    columns = dict(zip(machine.score_matrix.column_object_ids, matrix.column_object_ids, strict=True))
    assert (rows[8], columns[7], rows[4], columns[4], columns[12]) == (7, 7, 4, 16, 0)
    assert result.belief.shape == (machine.belief.shape[0], len(result.objects))
    assert result.belief[-1].tolist() == [int(item.label) for item in result.objects]
    assert result.object(16).sightings[0].session == 1
    with pytest.raises(KeyError):
        result.object(8)
    assert result.links(0, 0) is not None or machine.links(0, 0) is None
    assert result.sessions[0].image_path(0).is_file()


def test_without_corrections_the_result_is_the_machines_own(small_result: Result) -> None:
    assert ReviewedResult.of(small_result).result is small_result
