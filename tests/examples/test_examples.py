"""The examples run as their docstrings say."""

from __future__ import annotations

import csv
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def run_example(name: str, *arguments: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")


def test_evidence_of_an_object_is_printed(
    small_result_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_example("02_evidence_of_an_object.py", small_result_path, 1, monkeypatch=monkeypatch)

    printed = capsys.readouterr().out
    assert printed.startswith("#1: ")
    assert "believed after each submap" in printed


def test_an_override_reaches_the_export(
    small_result_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out.csv"
    run_example(
        "03_override_and_export.py", small_result_path, 1, "unknown", "a test", out, monkeypatch=monkeypatch
    )

    rows = {row["id"]: row for row in csv.DictReader(out.read_text().splitlines())}
    assert rows["1"]["label_final"] == "unknown"
    assert rows["1"]["decided_by"] == "example"


@pytest.mark.parametrize("example", sorted(path.name for path in EXAMPLES.glob("0[1-3]_*.py")))
def test_an_example_without_arguments_says_how_to_call_it(
    example: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit) as stopped:
        run_example(example, monkeypatch=monkeypatch)

    assert f"python examples/{example}" in str(stopped.value)
