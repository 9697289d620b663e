from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

from oasisview.export import export
from pipeline.store import open_result


def read_csv(path: Path) -> dict[int, dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {int(row["id"]): row for row in rows}


def read_json(path: Path) -> dict[int, dict[str, Any]]:
    return {row["id"]: row for row in json.loads(path.read_text(encoding="utf-8"))}


def test_json_keeps_both_labels_and_who_decided(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "json", tmp_path / "map.json")
    rows = read_json(tmp_path / "map.json")
    assert list(rows) == list(range(1, 13))
    assert {tuple(row) for row in rows.values()} == {tuple(rows[1])}
    assert (rows[6]["label_machine"], rows[6]["label_final"]) == ("appeared", "moved")
    assert (rows[6]["decided_by"], rows[6]["why"]) == ("=Ann", 'it, "stood" there; see photo')
    assert rows[6]["decided_at"].endswith("+00:00")
    assert (rows[9]["label_final"], rows[9]["decided_by"], rows[9]["why"]) == (
        "disappeared",
        "Ann",
        "Gewiß ✓",
    )
    assert (rows[4]["label_final"], rows[4]["decided_by"], rows[4]["why"]) == ("moved", None, None)
    assert [note["text"] for note in rows[1]["notes"]] == ["look again"]


def test_json_numbers_are_the_results(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "json", tmp_path / "map.json")
    rows = read_json(tmp_path / "map.json")
    result = open_result(reviewed_path)
    for item in result.objects:
        row = rows[item.object_id]
        last = item.sightings[-1]
        assert [row[f"centroid_{axis}_m"] for axis in "xyz"] == pytest.approx(last.centroid_world_m)
        assert [row[f"extent_{axis}_m"] for axis in "xyz"] == pytest.approx(last.extent_m, abs=1e-6)
        assert row["sessions_seen"] == [sighting.session for sighting in item.sightings]
        for name in ("sigma", "s_bar", "coverage", "confidence", "displacement_m", "rotation_rad"):
            assert row[name] == pytest.approx(getattr(item, name), abs=1e-6)
        assert (row["case"], row["replaced_by"], row["replaces"]) == (
            item.case.value,
            item.replaced_by,
            item.replaces,
        )
    assert rows[5]["rotation_rad"] == pytest.approx(1.570796)
    assert [rows[4][f"centroid_{axis}_m"] - rows[4][f"from_{axis}_m"] for axis in "xyz"] == pytest.approx(
        [0.8, -0.2, 0.0], abs=1e-6
    )
    assert rows[6]["from_x_m"] is None
    assert (rows[8]["counterpart_id"], rows[7]["counterpart_id"], rows[1]["counterpart_id"]) == (7, 8, 1)


def test_csv_says_the_same_as_json(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "csv", tmp_path / "map.csv")
    export(reviewed_path, "json", tmp_path / "map.json")
    table, rows = read_csv(tmp_path / "map.csv"), read_json(tmp_path / "map.json")
    assert list(table) == list(rows)
    for object_id, row in rows.items():
        assert list(table[object_id]) == list(row)
        for name, value in row.items():
            cell = table[object_id][name]
            if name in ("machine_ids", "sessions_seen", "notes"):
                continue
            if value is None:
                assert cell == ""
            elif isinstance(value, float):
                assert float(cell) == value
            else:
                assert cell.removeprefix("'") == str(value)
    assert table[1]["sessions_seen"] == "0;1"
    assert table[1]["notes"] == "Ann: look again"


def test_csv_cells_are_never_formulas(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "csv", tmp_path / "map.csv")
    table = read_csv(tmp_path / "map.csv")
    assert table[6]["decided_by"] == "'=Ann"
    negative = [
        row[name]
        for row in table.values()
        for name in row
        if name.endswith("_m") and row[name].startswith("-")
    ]
    assert negative  # numbers stay numbers, also negative ones
    assert all(float(cell) < 0 for cell in negative)
