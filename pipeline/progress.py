"""How the engine tells what it is doing: plain events, shown by whoever called it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

# In the order in which a run goes through them: (name, what people read).
STAGES: tuple[tuple[str, str], ...] = (
    ("open", "Opening the recordings"),
    ("map_previous", "Mapping the previous visit"),
    ("map_current", "Mapping the current visit"),
    ("register", "Laying the visits on each other"),
    ("observe", "Checking what each visit saw of the other"),
    ("objects", "Finding objects"),
    ("compare", "Comparing keyframes"),
    ("decide", "Deciding what changed"),
    ("write", "Writing the result"),
)


@dataclass(frozen=True)
class ProgressEvent:
    """One step forward: ``done`` of ``total`` items of a stage named in ``STAGES``."""

    stage: str
    done: int
    total: int


@dataclass(frozen=True)
class Warned:
    """Work goes on, but something was left out or repaired: one finished line."""

    message: str


Report = Callable[[ProgressEvent | Warned], None]


def silent(event: ProgressEvent | Warned) -> None:
    """Report nothing."""
