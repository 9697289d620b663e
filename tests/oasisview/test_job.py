"""Jobs in their own process: what they tell, how they end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from oasisview.job import Job, JobState, RunningJob, start_job
from oasisview.progress_lines import Failed, Finished, decode, encode
from pipeline.progress import ProgressEvent, Warned
from pipeline.settings import Settings

PATIENCE_S = 20.0


def _start(monkeypatch: pytest.MonkeyPatch, script: str) -> RunningJob:
    command = [sys.executable, "-c", textwrap.dedent(script)]
    monkeypatch.setattr(Job, "command", lambda self: command)
    return start_job(Job(Path("s0"), Path("s1"), Path("r.oasis")))


def test_the_command_line_carries_paths_and_changed_settings() -> None:
    settings = Settings().override("change.tau_d_m", "0.2").override("keyframes.select", "off")
    command = Job(Path("s0"), Path("s1"), Path("r.oasis"), settings, overwrite=True).command()
    assert command[:5] == [sys.executable, "-m", "oasisview", "run", "s0"]
    assert command[command.index("-o") + 1] == "r.oasis"
    assert "keyframes.select=False" in command and "change.tau_d_m=0.2" in command
    assert command.count("--set") == 2 and "--overwrite" in command


@pytest.mark.parametrize(
    "event",
    [
        ProgressEvent("compare", 3, 40),
        Warned('frame "7" was left out\nand named'),
        Finished(Path("r.oasis"), True),
        Failed("they never meet"),
    ],
)
def test_lines_survive_the_way(event: ProgressEvent | Warned | Finished | Failed) -> None:
    assert "\n" not in encode(event)
    assert decode(encode(event) + "\n") == event


@pytest.mark.parametrize(
    "line",
    ["", "noise", '{"event"', '{"event": "progress"}', '{"event": "progress", "stage": "x", "done": 1}'],
)
def test_noise_is_no_event(line: str) -> None:
    assert decode(line) is None


def test_a_job_tells_how_far_it_is_and_what_came_out(monkeypatch: pytest.MonkeyPatch) -> None:
    job = _start(
        monkeypatch,
        """
        import sys
        from pathlib import Path
        from oasisview.progress_lines import Finished, ProgressLines
        from pipeline.progress import ProgressEvent, Warned
        say = ProgressLines()
        say(ProgressEvent("open", 1, 1))
        print("a library chats", file=sys.stderr)
        say(ProgressEvent("compare", 1, 2))
        say(Warned("frame 3 was left out"))
        say(ProgressEvent("compare", 2, 2))
        say(Finished(Path("r.oasis"), False))
        """,
    )
    assert job.wait(PATIENCE_S) == JobState(
        progress={"open": ProgressEvent("open", 1, 1), "compare": ProgressEvent("compare", 2, 2)},
        warnings=("frame 3 was left out",),
        result=Path("r.oasis"),
        exit_code=0,
    )
    assert list(job.events().progress) == ["open", "compare"]


def test_the_real_command_reports_wrong_input(tmp_path: Path) -> None:
    state = start_job(Job(tmp_path / "gone", tmp_path, tmp_path / "r.oasis")).wait(PATIENCE_S)
    assert state.error == f"there is no archive {tmp_path / 'gone'}: check the path"
    assert state.exit_code == 2


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("import sys; sys.exit('RuntimeError: it broke')", "(exit code 1): RuntimeError: it broke"),
        ("import os; os.kill(os.getpid(), 9)", "the run was killed, most likely for want of memory"),
    ],
)
def test_a_crash_is_told_in_one_line(monkeypatch: pytest.MonkeyPatch, script: str, said: str) -> None:
    state = _start(monkeypatch, script).wait(PATIENCE_S)
    assert state.error is not None and said in state.error and "\n" not in state.error
    assert state.exit_code == 1 and state.is_over


def test_cancelling_ends_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    job = _start(monkeypatch, "import time; time.sleep(60)")
    assert not job.events().is_over
    job.cancel()
    assert job.events().error == "cancelled; starting again goes on from where it was"
    job.cancel()


def test_a_job_ends_with_its_parent(tmp_path: Path) -> None:
    """However the parent ends: here it is killed, and cannot tidy up."""
    child = """
        import os, sys, time
        from pathlib import Path
        from oasisview.commands.run import _end_when_stdin_closes
        _end_when_stdin_closes()
        Path(sys.argv[1]).write_text(str(os.getpid()))
        time.sleep(60)
    """
    parent = f"""
        import sys, time
        from pathlib import Path
        from oasisview.job import Job, start_job
        Job.command = lambda self: [sys.executable, "-c", {textwrap.dedent(child)!r}, str(self.result)]
        start_job(Job(Path("s0"), Path("s1"), Path(sys.argv[1])))
        time.sleep(60)
    """
    note = tmp_path / "pid"
    process = subprocess.Popen([sys.executable, "-c", textwrap.dedent(parent), str(note)])
    try:
        pid = int(_eventually(lambda: note.read_text() if note.exists() else ""))
        assert _is_running(pid)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert _eventually(lambda: "gone" if not _is_running(pid) else "") == "gone"


def _is_running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (ProcessLookupError, FileNotFoundError):
        return False
    return state != "Z"  # an orphan may wait for whoever reaps it


def _eventually(ask: object) -> str:
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        answer = ask()  # type: ignore[operator]
        if answer:
            return str(answer)
        time.sleep(0.05)
    raise TimeoutError("it did not happen")
