"""Who decided what, when and why: the journal as a list, newest first."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from oasisview import wording
from oasisview.panels.markup import chip, empty, sends
from oasisview.review import Event, Kind
from oasisview.shell import escape
from oasisview.wording import LABEL_NAMES

SHOWN = 300


def when(at: str) -> str:
    """An ISO 8601 time in this machine's zone, to the minute; the text itself if it is no time."""
    try:
        return datetime.fromisoformat(at).astimezone().strftime("%d %b %Y, %H:%M")
    except ValueError:
        return at


def journal_html(events: Sequence[Event]) -> str:
    """The panel; undone decisions are struck through."""
    if not events:
        return f'<div class="oa oa-journal">{empty(wording.NO_DECISIONS)}</div>'
    undone: set[int] = set()
    for event in events:
        if event.target_id is not None:
            (undone.add if event.kind is Kind.UNDO else undone.discard)(event.target_id)
    rows = "".join(_row(event, struck=event.id in undone) for event in reversed(events[-SHOWN:]))
    entries = "1 entry" if len(events) == 1 else f"{len(events)} entries"
    older = len(events) - SHOWN
    more = f'<div class="oa-note">{older} older entries are in review.sqlite.</div>' if older > 0 else ""
    return (
        f'<div class="oa oa-journal"><div class="oa-note">{entries}, newest first. '
        f"Nothing is ever removed; undo is an entry too.</div>{rows}{more}</div>"
    )


def parts(count: int) -> str:
    """How much a decision about many objects is about."""
    return f"{count} thing{'' if count == 1 else 's'}"


def _row(event: Event, *, struck: bool) -> str:
    new, old = LABEL_NAMES[event.new_label], LABEL_NAMES[event.old_label]
    what = {
        Kind.ACCEPT: f"accepted as {new}",
        Kind.LABEL: f"{old} \u2192 {new}",
        Kind.NOTE: "note",
        Kind.UNDO: f"undone, {new} again",
        Kind.REDO: f"redone, {new} again",
        Kind.MERGE: f"merged with others, now {new}",
        Kind.SAME: f"the same as another, now {new}",
        Kind.SPLIT: f"not one object, now {new}",
        Kind.DROP: "not an object",
        Kind.KEEP: "an object after all",
        Kind.RESTORE: "an earlier state restored",
        Kind.WHAT_IF: f"and others by other limits ({parts(len(event.groups))})",
    }[event.kind]
    reason = f"<q>{escape(event.why)}</q>" if event.why else ""
    return (
        f'<div class="oa-entry{" oa-undone" if struck else ""}" role="button" tabindex="0" '
        f'data-event="{event.id}" {sends("select", max(event.object_id, 1))}>{chip(event.new_label)}'
        f"<span><b>{f'#{event.object_id}' if event.object_id else 'All'}</b> {what}{reason}"
        f"<small>{escape(event.who)} \u00b7 {escape(when(event.at))}</small></span></div>"
    )
