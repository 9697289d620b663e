"""Who decided what, when and why: the journal as a list, newest first, each a state to return to."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime

from oasisview import wording
from oasisview.correction_words import event_words
from oasisview.panels.markup import chip, empty, sends
from oasisview.review import Event, Kind, MachineMap
from oasisview.shell import escape

PAGE_LENGTH = 200


def when(at: str) -> str:
    """An ISO 8601 time in this machine's zone, to the minute; the text itself if it is no time."""
    try:
        return datetime.fromisoformat(at).astimezone().strftime("%d %b %Y, %H:%M")
    except ValueError:
        return at


def journal_html(
    events: Sequence[Event],
    machine: MachineMap,
    undone: Collection[int] = (),
    *,
    user: str = "",
    mine: bool = False,
    shown: int = PAGE_LENGTH,
) -> str:
    """The panel.

    Args:
        events: the whole journal, oldest first.
        machine: what the events are about.
        undone: decisions that do not count at present; struck through.
        user, mine: whose page it is, and whether it lists that person's entries only.
        shown: most entries to list; a button asks for more.
    """
    if not events:
        return f'<div class="oa oa-journal">{empty(wording.NO_DECISIONS)}</div>'
    listed = [event for event in events if not mine or event.who == user]
    rows = "".join(
        _row(event, machine, events, is_undone=event.id in undone, is_last=event.id == len(events))
        for event in reversed(listed[-shown:])
    )
    entries = "1 entry" if len(listed) == 1 else f"{len(listed)} entries"
    older = len(listed) - shown
    end = (
        f'<button class="oa-more" {sends("journal_more")}>Show older entries ({older} more)</button>'
        if older > 0
        else _beginning()
    )
    return (
        f'<div class="oa oa-journal">{_whose(mine=mine)}<div class="oa-note">{entries}, newest first. '
        f"Nothing is ever removed; undo is an entry too.</div>{rows}{end}</div>"
    )


def _whose(*, mine: bool) -> str:
    buttons = "".join(
        f'<button aria-pressed="{str(mine == is_mine).lower()}" {sends("journal_who", value)}>{word}</button>'
        for value, word, is_mine in (("all", "Everybody's", False), ("mine", "Mine", True))
    )
    return f'<span class="oa-segments" role="group" aria-label="Whose entries">{buttons}</span>'


def _beginning() -> str:
    return (
        '<div class="oa-first"><span></span><span>What the machine found'
        f"{_restore_button(0, 'Go back to what the machine found')}</span></div>"
    )


def _restore_button(event_id: int, tip: str) -> str:
    return f'<button class="oa-restore" {sends("restore", event_id)} title="{tip}">back to here</button>'


def _sign(event: Event) -> str:
    """The label that an entry gave; a sign of its own where it is about more, or less, than an object."""
    sign = {Kind.DROP: "\u00d7", Kind.RESTORE: "\u21ba", Kind.WHAT_IF: "\u2026"}.get(event.kind)
    if sign is None:
        return chip(event.new_label)
    return f'<span class="oa-chip oa-event" aria-hidden="true">{sign}</span>'


def _row(
    event: Event, machine: MachineMap, events: Sequence[Event], *, is_undone: bool, is_last: bool
) -> str:
    target = events[event.target_id - 1] if event.target_id and event.kind in (Kind.UNDO, Kind.REDO) else None
    reason = f"<q>{escape(event.why)}</q>" if event.why else ""
    subject = target or event
    named = subject.kind in (Kind.LABEL, Kind.ACCEPT, Kind.NOTE)  # the others name what they are about
    number = f"<b>#{event.object_id}</b> " if named else ""
    select = sends("select", event.object_id) if event.object_id else ""
    back = "" if is_last else _restore_button(event.id, f"Go back to how it was after entry {event.id}")
    return (
        f'<div class="oa-entry{" oa-undone" if is_undone else ""}" role="button" tabindex="0" '
        f'data-event="{event.id}" {select}>{_sign(event if named else subject)}'
        f'<span><span class="oa-what">{number}{escape(event_words(event, machine, target))}{reason}</span>'
        f"<small>{event.id} \u00b7 {escape(event.who)} \u00b7 {escape(when(event.at))}{back}</small></span>"
        "</div>"
    )
