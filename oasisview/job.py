"""A run of the engine in a process of its own, so that the viewer stays responsive and survives it."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO

from oasisview.progress_lines import Failed, Finished, decode
from pipeline.progress import ProgressEvent, Warned
from pipeline.settings import Settings

_KEPT_LINES = 40
_SECONDS_TO_STOP = 5.0


@dataclass(frozen=True)
class Job:
    """What to compute and where the result goes; ``overwrite`` replaces a result of other inputs."""

    previous: Path
    current: Path
    result: Path
    settings: Settings = field(default_factory=Settings)
    overwrite: bool = False

    def command(self) -> list[str]:
        """The command line that does it."""
        command = [sys.executable, "-m", "oasisview", "run", str(self.previous), str(self.current)]
        command += ["-o", str(self.result), "--progress-json", "--until-stdin-closes"]
        for name, value in self.settings_overrides():
            command += ["--set", f"{name}={value}"]
        return [*command, "--overwrite"] if self.overwrite else command

    def settings_overrides(self) -> list[tuple[str, str]]:
        """Settings that differ from the defaults, as ``section.name`` and text."""
        default = Settings().to_dict()
        return [
            (f"{section}.{name}", str(value))
            for section, entries in self.settings.to_dict().items()
            for name, value in entries.items()
            if value != default[section][name]
        ]


@dataclass(frozen=True)
class JobState:
    """A snapshot of a running job.

    Attributes:
        progress: the latest event of each stage that has begun, in order of beginning.
        warnings: finished lines.
        result: the finished result's folder, or None.
        from_cache: the result was there already.
        error: one finished line if it failed or was cancelled, else None.
        exit_code: that of the command: 0, 2 for wrong input, 1 for anything else; None while it runs.
    """

    progress: dict[str, ProgressEvent] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    result: Path | None = None
    from_cache: bool = False
    error: str | None = None
    exit_code: int | None = None

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self.result is not None or self.error is not None


class RunningJob:
    """A started job. All methods may be called from any thread."""

    def __init__(self, job: Job) -> None:
        """Start the process; :func:`start_job` reads better."""
        self.job = job
        self._changed = threading.Condition()
        self._state = JobState()
        self._last_lines: deque[str] = deque(maxlen=_KEPT_LINES)
        self._cancelled = False
        # The child ends when its stdin closes, which the system does for a parent that dies in any way.
        # A session of its own: Ctrl-C in the terminal is for the parent to handle.
        self._process = subprocess.Popen(
            job.command(),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        )
        self._listener = threading.Thread(target=self._listen, name="oasisview-job", daemon=True)
        self._listener.start()

    def events(self) -> JobState:
        """The latest state."""
        with self._changed:
            return self._state

    def wait(self, timeout_s: float | None = None) -> JobState:
        """Block until the job is over (or the time is up) and return the state."""
        with self._changed:
            self._changed.wait_for(lambda: self._state.is_over, timeout_s)
            return self._state

    def cancel(self) -> None:
        """Stop the process; what is done stays and can be resumed. Harmless when it is over."""
        self._cancelled = True
        if self._process.poll() is None:
            with suppress(ProcessLookupError):
                self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(_SECONDS_TO_STOP)
            except subprocess.TimeoutExpired:
                self._process.kill()
        self._listener.join(_SECONDS_TO_STOP)

    def _listen(self) -> None:
        assert self._process.stderr is not None
        with self._process.stderr as lines:
            self._read(lines)
        code = self._process.wait()
        if self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()
        with self._changed:
            if not self._state.is_over:
                self._state = replace(self._state, error=self._why_it_ended(code), exit_code=1)
            self._changed.notify_all()

    def _read(self, lines: IO[str]) -> None:
        for line in lines:
            event = decode(line)
            with self._changed:
                match event:
                    case ProgressEvent():
                        progress = {**self._state.progress, event.stage: event}
                        self._state = replace(self._state, progress=progress)
                    case Warned(message):
                        self._state = replace(self._state, warnings=(*self._state.warnings, message))
                    case Finished(result, from_cache):
                        self._state = replace(self._state, result=result, from_cache=from_cache, exit_code=0)
                    case Failed(message):
                        self._state = replace(self._state, error=message, exit_code=2)
                    case None:
                        if line.strip():
                            self._last_lines.append(line.strip())
                self._changed.notify_all()

    def _why_it_ended(self, code: int) -> str:
        if self._cancelled:
            return "cancelled; starting again goes on from where it was"
        if code == -signal.SIGKILL:
            return "the run was killed, most likely for want of memory; close other programs and start again"
        said = self._last_lines[-1] if self._last_lines else "it said nothing"
        return f"the run ended unexpectedly (exit code {code}): {said}"


def start_job(job: Job) -> RunningJob:
    """Start ``python -m oasisview run`` for a job; it ends with this process at the latest."""
    return RunningJob(job)
