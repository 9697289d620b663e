"""What people said about identities reaches the formats that have no test of their own for it."""

from __future__ import annotations

import json
from pathlib import Path

import laspy
import numpy as np
import pytest

from oasisview.export import export
from oasisview.review import Journal, corrections
from pipeline.store import open_result


@pytest.fixture
def corrected_path(small_result_path: Path) -> Path:
    """Ann: 8 and 7 are the same thing, and 12 is no object."""
    with Journal.of(open_result(small_result_path)) as journal:
        for make in (lambda s: corrections.same(s, 8, 7), lambda s: corrections.drop(s, 12)):
            made = make(journal.corrected())
            journal.correct(made.kind, made.object_id, made.groups, who="Ann", why="seen it")
    return small_result_path


def test_every_format_knows_the_same_objects(corrected_path: Path, tmp_path: Path) -> None:
    for format in ("laz", "glb", "geojson", "coco", "report"):
        export(corrected_path, format, tmp_path / format)
    wanted = set(range(1, 12)) - {8}
    assert set(np.unique(np.asarray(laspy.read(tmp_path / "laz").object_id)).tolist()) == wanted | {0}
    features = json.loads((tmp_path / "geojson").read_text())["features"]
    assert {feature["id"] for feature in features} == wanted
    seven = next(feature["properties"] for feature in features if feature["id"] == 7)
    assert (seven["machine_ids"], seven["label"]) == ("7;8", "static")
    annotations = json.loads((tmp_path / "coco").read_text())["annotations"]
    assert {annotation["attributes"]["object_id"] for annotation in annotations} == wanted
    glb = (tmp_path / "glb").read_bytes()
    assert b"object_7_session_0" in glb and b"object_7_session_1" in glb
    assert b"object_8_" not in glb and b"object_12_" not in glb
    report = (tmp_path / "report").read_text("utf-8")
    assert "object #8<" not in report and "object #12<" not in report
    assert "replaces no." not in report  # 7 took nobody's place any more
    assert "are the same object: static" in report
    assert "<td>not an object: #12</td>" in report
