"""What every format has in common: refusals, and nothing half-written."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

import oasisview.export.exporter as exporter_module
import oasisview.export.heatmaps as heatmaps_module
import oasisview.export.ply_points as ply_module
from oasisview.cli import main
from oasisview.commands import export as command
from oasisview.export import FORMATS, export
from pipeline.errors import InputError, ResultError, StorageError


def test_formats_are_those_of_the_contract() -> None:
    suffixes = {name: exporter.suffix for name, exporter in FORMATS.items()}
    assert suffixes == {
        "report": ".html",
        "csv": ".csv",
        "json": ".json",
        "geojson": ".geojson",
        "ply": ".ply",
        "laz": ".laz",
        "glb": ".glb",
        "heatmaps": "",
        "coco": ".json",
    }


def test_the_commands_help_says_what_the_formats_are() -> None:
    assert {name: exporter.summary for name, exporter in FORMATS.items()} == command.FORMATS


def test_unknown_format_lists_the_others(small_result_path: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'xls': choose one of report, csv, json, "):
        export(small_result_path, "xls", tmp_path / "map.xls")


@pytest.mark.parametrize("format", FORMATS)
def test_missing_result_writes_nothing(tmp_path: Path, format: str) -> None:
    with pytest.raises(ResultError, match="no result"):
        export(tmp_path / "none.oasis", format, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("format", ["ply", "csv", "json", "geojson", "laz", "glb", "coco"])
def test_a_file_is_replaced_and_a_folder_is_not(small_result_path: Path, tmp_path: Path, format: str) -> None:
    out = tmp_path / "map"
    out.write_text("an earlier export")
    export(small_result_path, format, out)
    first = out.read_bytes()
    assert len(first) > 100
    export(small_result_path, format, out)
    assert out.read_bytes() == first
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="is a folder"):
        export(small_result_path, format, tmp_path / "folder")


@pytest.mark.parametrize("format", FORMATS)
def test_a_result_cannot_be_exported_over_itself(small_result_path: Path, format: str) -> None:
    before = (small_result_path / "objects.json").read_bytes()
    for inside in ("objects.json", "sessions", "new"):
        with pytest.raises(InputError):
            export(small_result_path, format, small_result_path / inside)
    assert (small_result_path / "objects.json").read_bytes() == before


@pytest.mark.parametrize("format", FORMATS)
def test_full_disk_leaves_the_earlier_export(
    small_result_path: Path, tmp_path: Path, format: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    export(small_result_path, format, out)
    before = {path.name: path.read_bytes() for path in [out, *out.rglob("*")] if path.is_file()}
    assert before

    def full(*arguments: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    monkeypatch.setattr(heatmaps_module.tifffile, "imwrite", full)
    with pytest.raises(StorageError, match="the disk is full"):
        export(small_result_path, format, out)
    assert {path.name: path.read_bytes() for path in [out, *out.rglob("*")] if path.is_file()} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", small_result_path.name]


def test_failing_halfway_leaves_no_file(
    small_result_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exporter_module, "CHUNK_POINTS", 1000)
    written = []
    whole = ply_module._vertices

    def fails_at_the_third(*arguments: object):
        written.append(1)
        if len(written) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        return whole(*arguments)

    monkeypatch.setattr(ply_module, "_vertices", fails_at_the_third)
    with pytest.raises(StorageError, match="the disk is full"):
        export(small_result_path, "ply", tmp_path / "map.ply")
    assert [path.name for path in tmp_path.iterdir()] == [small_result_path.name]


def test_damaged_journal_is_one_line_and_no_export(small_result_path: Path, tmp_path: Path) -> None:
    (small_result_path / "review.sqlite").write_text("not a database, but long enough to look at" * 9)
    with pytest.raises(ResultError, match=r"review\.sqlite is not a journal"):
        export(small_result_path, "csv", tmp_path / "map.csv")
    assert not (tmp_path / "map.csv").exists()


@pytest.mark.parametrize("format", FORMATS)
def test_a_place_without_objects_is_exported_too(objectless_path: Path, tmp_path: Path, format: str) -> None:
    export(objectless_path, format, tmp_path / "out")
    content = (tmp_path / "out").read_bytes() if (tmp_path / "out").is_file() else b"folder"
    expected = {
        "report": b"No objects were found in these visits",
        "csv": b"id,label_machine,label_final",
        "json": b"[]",
        "geojson": b'"features": [\n]}',
        "coco": b'"annotations": []}',
        "glb": b"background_session_1",
        "heatmaps": b"folder",
    }
    assert expected.get(format, b"") in content


def test_the_command_tells_how_far_it_is_and_names_the_file(
    small_result_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "map.laz"
    assert main(["export", str(small_result_path), "--format", "laz", "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert said.out == f"{out}\n"
    assert said.err.splitlines()[-1] == "Writing the export: 2/2"
    assert main(["export", "--help"]) == 0
    listed = capsys.readouterr().out
    assert all(f"  {name} " in listed for name in FORMATS)
