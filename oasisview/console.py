"""Progress for people, on stderr: bars in a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING

from pipeline.progress import STAGES, ProgressEvent, Warned

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

_TITLES = {**dict(STAGES), "generate": "Recording two synthetic visits", "export": "Writing the export"}
_SECONDS_BETWEEN_LINES = 5.0


class ConsoleProgress:
    """A context manager whose value is the engine's ``report``."""

    def __init__(self) -> None:
        """Choose bars or lines by what stderr is."""
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}
        self._printed_at: dict[str, float] = {}
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            self._bars = Progress(
                TextColumn("{task.description:<42}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                console=Console(stderr=True),
            )

    def __enter__(self) -> ConsoleProgress:
        if self._bars:
            self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bars:
            self._bars.stop()

    def __call__(self, event: ProgressEvent | Warned) -> None:
        """Show one event."""
        if isinstance(event, Warned):
            self._say(f"warning: {event.message}")
        elif self._bars:
            if event.stage not in self._tasks:
                title = _TITLES.get(event.stage, event.stage)
                self._tasks[event.stage] = self._bars.add_task(title, total=event.total)
            self._bars.update(self._tasks[event.stage], completed=event.done, total=event.total)
        else:
            self._print_line(event)

    def _print_line(self, event: ProgressEvent) -> None:
        now = time.monotonic()
        last = self._printed_at.get(event.stage)
        if last is None or event.done >= event.total or now - last >= _SECONDS_BETWEEN_LINES:
            self._printed_at[event.stage] = now
            self._say(f"{_TITLES.get(event.stage, event.stage)}: {event.done}/{event.total}")

    def _say(self, line: str) -> None:
        if self._bars:
            self._bars.console.print(line, markup=False, highlight=False)
        else:
            print(line, file=sys.stderr, flush=True)
