"""The command: help that suffices, exit codes, and errors of one line."""

from __future__ import annotations

import inspect
import json
import subprocess
import sys
from pathlib import Path

import pytest

from oasisview.cli import main
from oasisview.commands import COMMANDS, export, options

NO_RESULT = (
    "oasisview: there is no result at gone.oasis: make one with `oasisview run PREVIOUS CURRENT -o RESULT`"
)
CONTRACT_COMMANDS = ["demo", "view", "run", "export", "evaluate", "check", "generate", "batch", "models"]


def _said(capsys: pytest.CaptureFixture[str], *argv: str) -> tuple[int, str]:
    """Exit code and the only line on stderr; stdout must be empty."""
    code = main(argv)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1 and "Traceback" not in captured.err
    return code, captured.err.rstrip("\n")


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert [command.NAME for command in COMMANDS] == CONTRACT_COMMANDS
    for name in [*CONTRACT_COMMANDS, "exit codes"]:
        assert name in text


@pytest.mark.parametrize("command", CONTRACT_COMMANDS)
def test_every_command_has_help_of_its_own(capsys: pytest.CaptureFixture[str], command: str) -> None:
    assert main([command, "--help"]) == 0
    text = capsys.readouterr().out
    assert text.startswith(f"usage: oasisview {command}")
    if command in ("demo", "view"):
        assert all(option in text for option in ("--host", "--port", "--no-open", "127.0.0.1", "8080"))
    if command in ("run", "evaluate", "check", "batch", "models"):
        assert "--json" in text


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == "oasisview 0.1.0\n"


def test_help_imports_nothing_heavy() -> None:
    heavy = ("numpy", "torch", "open3d", "cv2", "viser", "scipy", "rich")
    script = f"import sys, oasisview.cli; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_runs_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "oasisview", "run", "only-one"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == ("oasisview: two visits are needed: name the previous and the current archive\n")


@pytest.mark.parametrize(
    ("argv", "line"),
    [
        ([], "oasisview: the following arguments are required: COMMAND: see `oasisview --help`"),
        (
            ["frobnicate"],
            "oasisview: argument COMMAND: invalid choice: 'frobnicate' (choose from 'demo', 'view', 'run', "
            "'export', 'evaluate', 'check', 'generate', 'batch', 'models'): see `oasisview --help`",
        ),
        (["run", "--nope"], "oasisview: unrecognized arguments: --nope: see `oasisview --help`"),
        (
            ["run", "a", "b", "c", "-o", "r.oasis"],
            "oasisview: 3 visits were named, and more than two are not supported yet: "
            "compare them two at a time",
        ),
        (["run", "gone", "gone", "-o", "r.oasis"], "oasisview: there is no archive gone: check the path"),
        (["run", ".", "."], "oasisview: no result folder was named: add -o NAME.oasis"),
        (["run", "--set", "x"], "oasisview: --set x names no value: write --set section.name=value"),
        (
            ["run", "--set", "change.tau=1"],
            "oasisview: there is no setting 'change.tau': `oasisview run --settings` lists them all",
        ),
        (
            ["run", "--set", "change.tau_d_m=far"],
            "oasisview: change.tau_d_m cannot be 'far': it is a number of type float",
        ),
        (
            ["run", "--features", "dinov3"],
            "oasisview: features backend dinov3 is not in this version: choose embedded",
        ),
        (["run", "--masks", "magic"], "oasisview: there is no masks backend 'magic': choose embedded"),
        (["view", "gone", "too"], "oasisview: there is no archive gone: check the path"),
        (
            ["view", "gone.oasis"],
            NO_RESULT,
        ),
        (
            ["view", "."],
            "oasisview: . is not a result: to compare two visits name both: oasisview view PREVIOUS CURRENT",
        ),
        (
            ["view", ".", "--port", "99999"],
            "oasisview view: argument --port: 99999 is not a port (1 to 65535): see `oasisview view --help`",
        ),
        (
            ["demo", "--port", "many"],
            "oasisview demo: argument --port: many is not a port (1 to 65535): see `oasisview demo --help`",
        ),
        (
            ["export", "gone.oasis", "--format", "docx", "-o", "x"],
            "oasisview: there is no export format 'docx': choose one of report, csv, json, geojson, ply, "
            "laz, glb, heatmaps, coco",
        ),
        (
            ["export", "gone.oasis", "--format", "ply", "-o", "x"],
            NO_RESULT,
        ),
        (["evaluate", "r", "gone.ply"], "oasisview: there is no ground truth gone.ply: check the path"),
        (["check", "gone"], "oasisview: there is no archive gone: check the path"),
        (
            ["generate", "office", "out"],
            "oasisview generate: the following arguments are required: --seed: "
            "see `oasisview generate --help`",
        ),
        (
            ["generate", "moon", "out", "--seed", "1"],
            "oasisview generate: argument SCENE: invalid choice: 'moon' (choose from 'office', 'carpark', "
            "'warehouse', 'market', 'hillside', 'tunnel'): see `oasisview generate --help`",
        ),
        (["batch", "gone.csv"], "oasisview: there is no file gone.csv: check the path"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_calls_get_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    argv: list[str],
    line: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, said = _said(capsys, *argv)
    assert code == 2
    # Newer Pythons list choices without quotes.
    assert said.replace("'", "") == line.replace("'", "")
    assert list(tmp_path.iterdir()) == []


def test_result_of_another_schema(small_result_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    manifest = small_result_path / "result.json"
    manifest.write_text(json.dumps({**json.loads(manifest.read_text()), "schema_version": 7}))
    code, said = _said(capsys, "view", str(small_result_path))
    assert code == 2
    assert said == (
        f"oasisview: {small_result_path} was written by schema 7, this program reads 1: run it again"
    )


def test_check_of_what_is_no_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = _said(capsys, "check", str(tmp_path))
    assert code == 2
    assert said.startswith(f"oasisview: {tmp_path} holds no recording of a known format: looked for ")
    assert main(["check", str(tmp_path), "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["usable"] is False


def test_bugs_give_code_1_and_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(_: object) -> int:
        raise RuntimeError("it broke")

    monkeypatch.setattr("oasisview.commands.models.run_command", fail)
    assert main(["models"]) == 1
    captured = capsys.readouterr()
    assert "Traceback" in captured.err
    assert captured.err.endswith("oasisview: internal error, please report it: it broke\n")


def test_interrupt_gives_code_1_and_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(_: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("oasisview.commands.models.run_command", interrupt)
    code, said = _said(capsys, "models")
    assert (code, said) == (1, "oasisview: interrupted; the same command goes on from where it was")


def test_models_says_what_can_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["models", "--json"]) == 0
    backends = {(b["kind"], b["name"]): b for b in json.loads(capsys.readouterr().out)}
    assert backends["features", "embedded"]["available"] and backends["masks", "embedded"]["available"]
    for key in (("features", "dinov3"), ("masks", "sam2"), ("depth", "depth-anything")):
        assert not backends[key]["available"] and backends[key]["weights"] == "not in this version"
    assert main(["models"]) == 0
    assert "dinov3" in capsys.readouterr().out


def test_settings_are_listed_with_units_and_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "--settings", "--set", "change.tau_d_m=0.25"]) == 0
    text = capsys.readouterr().out
    (line,) = [line for line in text.splitlines() if "change.tau_d_m" in line]
    assert "0.25 m" in line and "[tau_d]" in line
    assert main(["run", "--settings", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["change"]["tau_d_m"] == 0.1


def test_what_help_repeats_is_what_the_packages_offer() -> None:
    from oasisview.export import FORMATS
    from pipeline.synthetic import HELD_OUT_SCENES, SCENES, generate

    assert set(export.FORMATS) == set(FORMATS)
    assert options.SCENES == SCENES and options.HELD_OUT_SCENES == HELD_OUT_SCENES
    assert inspect.signature(generate).parameters["frames"].default == options.SCENE_FRAMES
