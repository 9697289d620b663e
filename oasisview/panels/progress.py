"""What a page shows while the pipeline is at work, and when it fails."""

from __future__ import annotations

from collections.abc import Sequence

from oasisview import wording
from oasisview.job import JobState
from oasisview.panels.markup import sends
from oasisview.shell import escape
from pipeline.progress import STAGES

SHOWN_WARNINGS = 50


def progress_html(state: JobState, names: Sequence[str], seconds: float, *, can_cancel: bool = True) -> str:
    """The page's content; ``names`` are the archives that are compared."""
    title = f"Comparing {' with '.join(escape(name) for name in names)}" if names else "Comparing two visits"
    begun = [position for position, (name, _) in enumerate(STAGES) if name in state.progress]
    current = max(begun, default=-1)
    rows = "".join(_row(state, position, current) for position in range(len(STAGES)))
    return (
        f'<div class="oa-progress" data-stage="{current}"><h2>{title}</h2>'
        f"<ol>{rows}</ol>{_warnings(state.warnings)}{_foot(state, seconds, can_cancel)}</div>"
    )


def message_html(title: str, message: str) -> str:
    """A page with nothing but a message: while a result opens, or why it cannot be opened."""
    return (
        f'<div class="oa-progress"><h2>{escape(title)}</h2><p data-role="message">{escape(message)}</p></div>'
    )


def _row(state: JobState, position: int, current: int) -> str:
    name, text = STAGES[position]
    event = state.progress.get(name)
    share = min(event.done / event.total, 1.0) if event is not None and event.total > 0 else 0.0
    if position < current or state.result is not None or share >= 1.0:
        kind, mark, share, count = "done", "\u2713", 1.0, ""
    elif position == current:
        kind, mark = "now", "\u25b8"
        count = f"{event.done} of {event.total}" if event is not None and event.total > 0 else ""
    else:
        kind, mark, count = "later", "", ""
    return (
        f'<li class="oa-stage-{kind}"><span>{mark}</span><span>{escape(text)}</span>'
        f'<span class="oa-track"><i style="width:{100 * share:.0f}%"></i></span><small>{count}</small></li>'
    )


def _warnings(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    lines = "".join(f"<li>{escape(line)}</li>" for line in warnings[-SHOWN_WARNINGS:])
    word = "warning" if len(warnings) == 1 else "warnings"
    opened = "open" if len(warnings) <= 3 else ""
    return (
        f'<details class="oa-warnings" {opened}><summary>{len(warnings)} {word}</summary>'
        f"<ul>{lines}</ul></details>"
    )


def _foot(state: JobState, seconds: float, can_cancel: bool) -> str:
    if state.error is not None:
        return (
            '<div class="oa-failed" role="alert"><b>No result.</b> '
            f'<span data-role="error">{escape(state.error[:1].upper() + state.error[1:])}</span></div>'
        )
    button = f"<button {sends('cancel')}>Cancel</button>" if can_cancel else ""
    return (
        f'<div class="oa-foot"><span class="oa-muted">{wording.duration(seconds)} so far. '
        f"The result opens here by itself.</span>{button}</div>"
    )
