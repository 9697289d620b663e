"""Progress as JSON, one object a line: how a run in its own process tells the viewer how far it is."""

from __future__ import annotations

import json
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from pipeline.progress import STAGES, ProgressEvent, Warned


@dataclass(frozen=True)
class Finished:
    """The result is whole; ``from_cache``: nothing had to be computed."""

    result: Path
    from_cache: bool


@dataclass(frozen=True)
class Failed:
    """The run ended without a result: one finished line."""

    message: str


Line = ProgressEvent | Warned | Finished | Failed


class ProgressLines:
    """Writes events as lines; usable as the engine's ``report``."""

    def __init__(self, stream: TextIO | None = None) -> None:
        """Write to ``stream`` (default: stderr)."""
        self._stream = stream or sys.stderr
        self._lock = threading.Lock()

    def __call__(self, event: Line) -> None:
        """Write one event."""
        with self._lock:
            self._stream.write(encode(event) + "\n")
            self._stream.flush()


def encode(event: Line) -> str:
    """One line without its end."""
    match event:
        case ProgressEvent(stage, done, total):
            record = {"event": "progress", "stage": stage, "done": done, "total": total}
        case Warned(message):
            record = {"event": "warning", "message": message}
        case Finished(result, from_cache):
            record = {"event": "finished", "result": str(result), "from_cache": from_cache}
        case Failed(message):
            record = {"event": "failed", "message": message}
    return json.dumps(record)


def decode(line: str) -> Line | None:
    """The event of a line; None for anything else (libraries write to stderr too)."""
    if not line.startswith('{"event"'):
        return None
    try:
        record = json.loads(line)
        match record["event"]:
            case "progress" if record["stage"] in dict(STAGES):
                return ProgressEvent(record["stage"], int(record["done"]), int(record["total"]))
            case "warning":
                return Warned(str(record["message"]))
            case "finished":
                return Finished(Path(record["result"]), bool(record["from_cache"]))
            case "failed":
                return Failed(str(record["message"]))
    except (ValueError, KeyError, TypeError):
        pass
    return None
