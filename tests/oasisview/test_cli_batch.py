"""Many pairs: the table, the order of things, and what one failure does to the others."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path

import pytest

from oasisview.cli import main
from oasisview.job import Job
from oasisview.jobs_file import read_jobs
from pipeline.errors import InputError
from pipeline.settings import Settings

# Ends as the name of the current visit asks.
_STAND_IN = """
import sys
from pathlib import Path
from oasisview.progress_lines import Failed, Finished, ProgressLines
how, result = sys.argv[1], Path(sys.argv[2])
if how == "crash":
    sys.exit("it broke")
ProgressLines()(Failed("they never meet") if how == "bad" else Finished(result, how == "cached"))
"""


@pytest.fixture(autouse=True)
def _stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        Job, "command", lambda job: [sys.executable, "-c", _STAND_IN, job.current.name, str(job.result)]
    )


def _table(folder: Path, *currents: str) -> Path:
    rows = [f"before,{current},{number}.oasis" for number, current in enumerate(currents)]
    path = folder / "jobs.csv"
    path.write_text("\n".join(["previous,current,result", *rows]) + "\n")
    return path


def test_every_job_gets_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["batch", str(_table(tmp_path, "good", "cached")), "--workers", "2"]) == 0
    lines = sorted(capsys.readouterr().out.splitlines())
    assert [line.split()[0] for line in lines] == ["cached", "done"]
    assert lines[1].endswith(f"s  {tmp_path / '0.oasis'}")


@pytest.mark.parametrize(("how", "code"), [("bad", 2), ("crash", 1)])
def test_one_failure_does_not_stop_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], how: str, code: int
) -> None:
    assert main(["batch", str(_table(tmp_path, how, "good")), "--json"]) == code
    captured = capsys.readouterr()
    outcomes = [json.loads(line) for line in captured.out.splitlines()]
    assert [outcome["status"] for outcome in outcomes] == ["failed", "done"]
    assert outcomes[0]["exit_code"] == code and outcomes[0]["message"]
    assert captured.err == "oasisview: 1 of 2 jobs failed: the same call tries them again\n"


@pytest.mark.skipif(importlib.util.find_spec("ray") is not None, reason="ray is installed")
def test_ray_has_to_be_installed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["batch", str(_table(tmp_path, "good")), "--engine", "ray"]) == 2
    assert (
        capsys.readouterr().err == "oasisview: ray is not installed: pip install ray, or use --engine local\n"
    )


def test_paths_start_at_the_table(tmp_path: Path) -> None:
    path = tmp_path / "jobs.csv"
    path.write_text(
        "\ufeffprevious, current, result, note\ns0, /far/s1, out/r.oasis, hello\n", encoding="utf-8"
    )
    (job,) = read_jobs(path, Settings())
    assert (job.previous, job.current, job.result) == (
        tmp_path / "s0",
        Path("/far/s1"),
        tmp_path / "out/r.oasis",
    )


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "names no jobs"),
        (b"previous,current,result\n", "names no jobs"),
        (b"previous,result\na,b\n", "has no column current"),
        (b"previous,current,result\na,b\n", "line 2 of .* has an empty cell"),
        (b"previous,current,result\na,b,r\nc,d,r\n", "line 3 of .* names .*r again"),
        (b"previous,current,result\n\xff\xfe,b,r\n", "has to be a CSV file in UTF-8"),
    ],
)
def test_wrong_tables_are_told(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "jobs.csv").write_bytes(content)
    with pytest.raises(InputError, match=said) as caught:
        read_jobs(tmp_path / "jobs.csv", Settings())
    assert "\n" not in str(caught.value)
