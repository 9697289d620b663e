"""The bar of verdicts at the foot of the evidence: five labels, accept, note, undo and redo."""

from __future__ import annotations

from oasisview.decisions import Verdict
from oasisview.panels.markup import chip, key, sends
from oasisview.panels.queue import LABEL_ORDER
from oasisview.wording import LABEL_NAMES, LABEL_WORDS
from pipeline.result import ChangeLabel, MapObject


def verdict_html(
    item: MapObject, verdict: Verdict | None, *, can_undo: bool, can_redo: bool, pieces: int = 1
) -> str:
    """The bar for an object; the machine's label is dashed, the standing decision filled.

    ``pieces`` tells of how many of the machine's objects it is made.
    """
    decided = verdict.label if verdict is not None else None
    buttons = "".join(
        _button(number, label, item.label, decided) for number, label in enumerate(LABEL_ORDER, start=1)
    )
    return (
        '<div class="oa-verdict">'
        f'<div class="oa-verdicts" role="group" aria-label="Label">{buttons}</div>'
        f'<div class="oa-accept"><button class="oa-primary" data-accept {sends("accept")}>'
        f"Accept \u201c{LABEL_WORDS[item.label]}\u201d {key('Enter')}</button>"
        f'<button data-open="note" title="Write a note about this object (M)">note {key("M")}</button>'
        f"{_correct_menu(item, pieces)}{_undo_buttons(can_undo, can_redo)}</div></div>"
    )


def _correct_menu(item: MapObject, pieces: int) -> str:
    """What can be said about the object itself rather than its label."""
    entries = [
        ("same", "Same as \u2026", "An object of the other visit is this one, in place or moved"),
        ("merge", "Merge with \u2026", "Another object is a piece of this one"),
    ]
    if len(item.sightings) > 1:
        entries.append(("split", "These are two", "Another object on each visit: one went, one came"))
    if pieces > 1:
        entries.append(("apart", "Take apart", "The pieces are objects of their own again"))
    entries.append(("drop", "Not an object", "Its points become background"))
    buttons = "".join(
        f'<button {sends("correct", name)} title="{tip}">{word}</button>' for name, word, tip in entries
    )
    return (
        '<details class="oa-correct"><summary title="Say what is one object, and what is none">correct'
        "</summary>"
        f'<div class="oa-menu" role="menu">{buttons}</div></details>'
    )


def undo_html(*, can_undo: bool, can_redo: bool) -> str:
    """Only undo and redo, for when no object is selected; empty if there is nothing to take back."""
    if not can_undo and not can_redo:
        return ""
    buttons = _undo_buttons(can_undo, can_redo)
    return f'<div class="oa-verdict"><div class="oa-accept">{buttons}</div></div>'


def _button(number: int, label: ChangeLabel, machine: ChangeLabel, decided: ChangeLabel | None) -> str:
    name = LABEL_NAMES[label]
    by_machine = " oa-machine" if label is machine else ""
    tip = f"Set to {name}" + (" (what the machine said)" if label is machine else "")
    return (
        f'<button class="oa-{name}{by_machine}" aria-pressed="{str(label is decided).lower()}" '
        f'title="{tip}" {sends("decide", name)}>'
        f"{chip(label)}<span>{LABEL_WORDS[label]}</span>{key(str(number))}</button>"
    )


def _undo_buttons(can_undo: bool, can_redo: bool) -> str:
    return "".join(
        f'<button {sends(name.lower())} title="{name} ({name[0]})" aria-label="{name}" '
        f"{'' if possible else 'disabled'}>{sign}</button>"
        for name, possible, sign in (("Undo", can_undo, "\u21b6"), ("Redo", can_redo, "\u21b7"))
    )
