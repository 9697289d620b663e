from __future__ import annotations

from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
import trimesh

from oasisview.export import export, exporter
from oasisview.palette import DARK, LIGHT, label_table
from pipeline.ply import read_ply
from pipeline.result import ChangeLabel
from pipeline.store import open_result

DTYPE = [
    *((axis, "<f4") for axis in "xyz"),
    *((name, "u1") for name in ("red", "green", "blue", "session", "label")),
    ("object_id", "<i4"),
    ("confidence", "<f4"),
]


def vertices_of(path: Path) -> np.ndarray:
    """Read without any PLY library: the contract's properties in the contract's order."""
    content = path.read_bytes()
    head, body = content.split(b"end_header\n", 1)
    assert head.startswith(b"ply\nformat binary_little_endian 1.0\n")
    vertices = np.frombuffer(body, dtype=DTYPE)
    assert f"element vertex {len(vertices)}\n".encode() in head
    return vertices


def test_every_map_point_with_final_labels(reviewed_path: Path, tmp_path: Path) -> None:
    out = tmp_path / "map.ply"
    export(reviewed_path, "ply", out)
    vertices = vertices_of(out)
    result = open_result(reviewed_path)
    assert len(vertices) == sum(len(session.points_world) for session in result.sessions)
    for session in result.sessions:
        mine = vertices[vertices["session"] == session.index]
        np.testing.assert_array_equal(
            np.stack([mine["x"], mine["y"], mine["z"]], axis=1), session.points_world
        )
        np.testing.assert_array_equal(mine["object_id"], session.object_ids)

    def labels(object_id: int) -> set[int]:
        return set(vertices["label"][vertices["object_id"] == object_id].tolist())

    assert labels(0) == labels(1) == labels(2) == labels(3) == {ChangeLabel.STATIC}
    assert labels(6) == {ChangeLabel.MOVED}  # overridden, was appeared
    assert labels(10) == {ChangeLabel.STATIC}  # overridden, was unknown
    assert labels(4) == {ChangeLabel.MOVED}  # override taken back
    assert labels(9) == labels(8) == {ChangeLabel.DISAPPEARED}
    assert labels(7) == labels(12) == {ChangeLabel.APPEARED}
    assert labels(11) == {ChangeLabel.UNKNOWN}


def test_confidence_is_the_machines_until_a_person_decides(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "ply", tmp_path / "map.ply")
    vertices = vertices_of(tmp_path / "map.ply")
    confidence = {
        object_id: set(vertices["confidence"][vertices["object_id"] == object_id].tolist())
        for object_id in (0, 1, 6, 9, 11)
    }
    assert confidence[0] == confidence[6] == confidence[9] == {1.0}
    assert confidence[1] == {float(np.float32(0.94))}
    assert confidence[11] == {float(np.float32(0.31))}


def test_colours_are_the_labels(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "ply", tmp_path / "map.ply")
    vertices = vertices_of(tmp_path / "map.ply")
    rgb = np.stack([vertices["red"], vertices["green"], vertices["blue"]], axis=1)
    expected = {0: (88, 89, 91), 1: (30, 156, 133), 2: (157, 50, 37), 3: (34, 47, 119), 4: (196, 117, 20)}
    assert set(vertices["label"].tolist()) == set(expected)
    for label, colour in expected.items():
        assert (rgb[vertices["label"] == label] == colour).all()


def test_independent_readers_agree(reviewed_path: Path, tmp_path: Path) -> None:
    out = tmp_path / "map.ply"
    export(reviewed_path, "ply", out)
    vertices = vertices_of(out)
    points = np.stack([vertices["x"], vertices["y"], vertices["z"]], axis=1)
    rgb = np.stack([vertices["red"], vertices["green"], vertices["blue"]], axis=1)
    cloud = trimesh.load(out)
    np.testing.assert_array_equal(np.asarray(cloud.vertices, dtype=np.float32), points)
    np.testing.assert_array_equal(np.asarray(cloud.colors)[:, :3], rgb)
    opened = o3d.t.io.read_point_cloud(str(out))
    np.testing.assert_array_equal(opened.point.positions.numpy(), points)
    np.testing.assert_array_equal(opened.point["label"].numpy().ravel(), vertices["label"])
    np.testing.assert_array_equal(opened.point["object_id"].numpy().ravel(), vertices["object_id"])
    assert len(read_ply(out)) == len(vertices)


def test_chunks_make_the_same_file(
    reviewed_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export(reviewed_path, "ply", tmp_path / "whole.ply")
    monkeypatch.setattr(exporter, "CHUNK_POINTS", 777)
    export(reviewed_path, "ply", tmp_path / "chunks.ply")
    assert (tmp_path / "chunks.ply").read_bytes() == (tmp_path / "whole.ply").read_bytes()


def test_without_a_journal_the_machine_stands_and_none_is_made(
    small_result_path: Path, tmp_path: Path
) -> None:
    export(small_result_path, "ply", tmp_path / "map.ply")
    vertices = vertices_of(tmp_path / "map.ply")
    assert set(vertices["label"][vertices["object_id"] == 6].tolist()) == {ChangeLabel.APPEARED}
    assert not (small_result_path / "review.sqlite").exists()


def test_palettes_tell_labels_apart() -> None:
    for palette in (LIGHT, DARK):
        assert set(palette) == set(ChangeLabel)
        assert len({tuple(row) for row in label_table(palette).tolist()}) == len(ChangeLabel)
