"""Commands that call the engine: what they pass on, print and refuse. The engine is a stand-in here."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from fixture_result import write_small_result

from oasisview.cache import cached_result_path, demo_folder
from oasisview.cli import main
from oasisview.job import Job
from pipeline.errors import SceneMismatchError
from pipeline.progress import ProgressEvent, Report, Warned
from pipeline.result import Result
from pipeline.settings import Settings
from pipeline.store import finished_result, open_result


class Engine:
    """Stands in for ``pipeline.run``: writes the small result under a key made of what it was given."""

    def __init__(self) -> None:
        self.calls: list[dict[str, Any]] = []
        self.error: Exception | None = None

    def run(
        self, previous: Path, current: Path, *, settings: Settings, output: Path, report: Report
    ) -> Result:
        self.calls.append({"previous": previous, "current": current, "settings": settings, "output": output})
        if self.error:
            raise self.error
        key = f"{previous.name} {current.name} {sorted(settings.to_dict()['change'].items())}"
        done = finished_result(output, key)
        if done is None:
            report(ProgressEvent("open", 1, 1))
            report(Warned("frame 3 was left out"))
            write_small_result(output.parent, output.name, key)
            manifest = json.loads((output / "result.json").read_text())
            manifest["settings"] = settings.to_dict()
            for item, archive in zip(manifest["inputs"], (previous, current), strict=True):
                item["archive"] = str(archive)
            (output / "result.json").write_text(json.dumps(manifest))
            done = open_result(output)
        return done


@pytest.fixture
def engine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Engine:
    stand_in, module = Engine(), ModuleType("pipeline.system")
    module.run = stand_in.run  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pipeline.system", module)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OASISVIEW_CACHE", str(tmp_path / "cache"))
    for name in ("s0", "s1", "s2"):
        (tmp_path / name).mkdir()
    return stand_in


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, dict[str, Any]]]:
    calls: list[tuple[Any, dict[str, Any]]] = []
    module = ModuleType("oasisview.app")
    module.serve = lambda source, **options: calls.append((source, options))  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "oasisview.app", module)
    monkeypatch.setattr("oasisview.app", module, raising=False)
    return calls


def test_run_prints_the_summary_and_keeps_progress_off_stdout(
    engine: Engine, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(["run", "s0", "s1", "-o", "r.oasis", "--set", "change.tau_d_m=0.2", "--masks", "embedded"]) == 0
    )
    captured = capsys.readouterr()
    assert captured.out == "r.oasis: 3 appeared, 2 disappeared, 2 moved, 3 static, 2 unknown\n"
    assert captured.err == "Opening the recordings: 1/1\nwarning: frame 3 was left out\n"
    assert engine.calls[0]["settings"].change.tau_d_m == 0.2
    assert engine.calls[0]["output"] == Path("r.oasis")


def test_a_fitting_result_is_taken_from_cache(engine: Engine, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "s0", "s1", "-o", "r.oasis", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert main(["run", "s0", "s1", "-o", "r.oasis", "--json"]) == 0
    second = json.loads(capsys.readouterr().out)
    assert (first.pop("from_cache"), second.pop("from_cache")) == (False, True)
    assert first == second and first["summary"]["moved"] == 2 and len(first["warnings"]) == 1
    assert main(["run", "s0", "s1", "-o", "r.oasis"]) == 0
    assert "(taken from cache)" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("argv", "what"),
    [(["s0", "s2"], "recordings"), (["s0", "s1", "--set", "change.tau_d_m=0.2"], "settings")],
)
def test_a_foreign_result_is_replaced_only_on_demand(
    engine: Engine, capsys: pytest.CaptureFixture[str], argv: list[str], what: str
) -> None:
    assert main(["run", "s0", "s1", "-o", "r.oasis"]) == 0
    key = open_result("r.oasis").manifest["key"]
    capsys.readouterr()
    assert main(["run", *argv, "-o", "r.oasis"]) == 2
    assert capsys.readouterr().err == (
        f"oasisview: r.oasis holds the result of other {what}: add --overwrite to replace it (decisions of "
        "inspectors are kept), or name another folder\n"
    )
    assert open_result("r.oasis").manifest["key"] == key
    assert main(["run", *argv, "-o", "r.oasis", "--overwrite"]) == 0
    assert open_result("r.oasis").manifest["key"] != key


def test_the_same_pair_named_from_another_folder_fits(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "s0", "s1", "-o", "r.oasis"]) == 0
    monkeypatch.chdir(tmp_path / "s2")
    assert main(["run", "../s0", "../s1", "-o", "../r.oasis"]) == 0
    assert "(taken from cache)" in capsys.readouterr().out


def test_errors_of_the_engine_are_one_line(engine: Engine, capsys: pytest.CaptureFixture[str]) -> None:
    engine.error = SceneMismatchError(
        "s0 and s1 never see the same place", "check that they\nbelong together"
    )
    assert main(["run", "s0", "s1", "-o", "r.oasis"]) == 2
    assert capsys.readouterr().err == (
        "oasisview: s0 and s1 never see the same place: check that they belong together\n"
    )


def test_progress_for_a_program(engine: Engine, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "s0", "s1", "-o", "r.oasis", "--progress-json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert [line["event"] for line in lines] == ["progress", "warning", "finished"]
    assert lines[-1] == {"event": "finished", "result": "r.oasis", "from_cache": False}
    engine.error = SceneMismatchError("they never meet")
    assert main(["run", "s0", "s1", "-o", "r.oasis", "--progress-json"]) == 2
    assert json.loads(capsys.readouterr().err) == {"event": "failed", "message": "they never meet"}


def test_view_serves_a_result(small_result_path: Path, served: list[tuple[Any, dict[str, Any]]]) -> None:
    assert main(["view", str(small_result_path), "--no-open", "--host", "0.0.0.0", "--port", "9000"]) == 0
    assert served == [(small_result_path, {"host": "0.0.0.0", "port": 9000, "open_browser": False})]


def test_view_serves_two_visits_as_a_job(
    engine: Engine, served: list[tuple[Any, dict[str, Any]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.readers.open_session", lambda _: None)
    assert main(["view", "s0", "s1", "--set", "change.tau_d_m=0.2"]) == 0
    ((job, options),) = served
    settings = Settings().override("change.tau_d_m", "0.2")
    assert job == Job(
        Path("s0"), Path("s1"), cached_result_path(Path("s0"), Path("s1"), settings), settings, overwrite=True
    )
    assert options == {"host": "127.0.0.1", "port": 8080, "open_browser": True}


def test_view_refuses_an_unusable_archive_before_serving(
    engine: Engine, served: list[tuple[Any, dict[str, Any]]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", "s0", "s1"]) == 2
    assert "s0 holds no recording of a known format" in capsys.readouterr().err
    assert served == []


def test_demo_generates_once(
    engine: Engine, served: list[tuple[Any, dict[str, Any]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[Any, ...]] = []

    def generate(scene: str, out: Path, seed: int, frames: int, report: Report) -> None:
        made.append((scene, out, seed, frames))
        out.mkdir(parents=True)

    monkeypatch.setattr("pipeline.synthetic.generate", generate)
    for _ in range(2):
        assert main(["demo", "--scene", "market", "--seed", "3", "--frames", "9", "--no-open"]) == 0
    folder = demo_folder("market", 3, 9)
    assert made == [("market", folder, 3, 9)]
    assert [(job.previous, job.current) for job, _ in served] == [(folder / "s0", folder / "s1")] * 2
    assert served[0][0].result == served[1][0].result


def test_results_of_different_settings_are_cached_apart(engine: Engine) -> None:
    default = Settings()
    paths = {
        cached_result_path(Path("s0"), Path("s1"), default),
        cached_result_path(Path("s0"), Path("s1"), default.override("change.tau_d_m", 0.2)),
        cached_result_path(Path("s1"), Path("s0"), default),
    }
    assert len(paths) == 3
    assert cached_result_path(Path("s0"), Path("s1"), default) == cached_result_path(
        Path("s2/../s0"), Path("s1").absolute(), default
    )
