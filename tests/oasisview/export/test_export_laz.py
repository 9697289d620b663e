"""The LAZ file: its header by hand, its points by laspy."""

from __future__ import annotations

import struct
from pathlib import Path

import laspy
import numpy as np

from oasisview.export import export, exporter
from pipeline.result import ChangeLabel
from pipeline.store import open_result


def test_header_is_las_1_4_with_compressed_coloured_points(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "laz", tmp_path / "map.laz")
    content = (tmp_path / "map.laz").read_bytes()
    total = sum(len(s.points_world) for s in open_result(reviewed_path).sessions)
    assert content[:4] == b"LASF"
    assert struct.unpack_from("<H", content, 6)[0] & 16  # WKT bit, which formats 6 to 10 demand
    assert (content[24], content[25]) == (1, 4)
    assert content[58:67] == b"oasisview"
    assert struct.unpack_from("<H", content, 94)[0] == 375  # header size of 1.4
    assert content[104] == 7 | 128  # point format, and the bit that laszip sets
    assert struct.unpack_from("<H", content, 105)[0] == 36 + 10  # bytes of a point with the extras
    assert struct.unpack_from("<Q", content, 247)[0] == total
    assert b"object_id" in content[375:4000]


def test_points_with_final_labels(reviewed_path: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(exporter, "CHUNK_POINTS", 777)
    export(reviewed_path, "laz", tmp_path / "map.laz")
    las = laspy.read(tmp_path / "map.laz")
    result = open_result(reviewed_path)
    assert list(las.point_format.extra_dimension_names) == ["session", "label", "object_id", "confidence"]
    for session in result.sessions:
        mine = np.asarray(las.session) == session.index
        points = np.stack([las.x, las.y, las.z], axis=1)[mine]
        np.testing.assert_allclose(points, session.points_world, atol=0.51e-4)
        np.testing.assert_array_equal(np.asarray(las.object_id)[mine], session.object_ids)
    labels = {i: set(np.asarray(las.label)[np.asarray(las.object_id) == i].tolist()) for i in (0, 6, 9, 10)}
    assert labels == {
        0: {ChangeLabel.STATIC},
        6: {ChangeLabel.MOVED},
        9: {ChangeLabel.DISAPPEARED},
        10: {ChangeLabel.STATIC},
    }
    confidence = np.asarray(las.confidence)
    assert set(confidence[np.asarray(las.object_id) == 6].tolist()) == {1.0}
    assert set(confidence[np.asarray(las.object_id) == 1].tolist()) == {float(np.float32(0.94))}
    rgb = np.stack([las.red, las.green, las.blue], axis=1)[np.asarray(las.label) == ChangeLabel.MOVED]
    assert (rgb == np.array([196, 117, 20]) * 257).all()
    np.testing.assert_allclose(las.header.mins, np.min([las.x, las.y, las.z], axis=1), atol=1e-4)
