"""Pieces of HTML that several panels share. Everything that is not ours goes through ``escape``."""

from __future__ import annotations

import json
from typing import Any

from oasisview.shell import escape
from oasisview.wording import LABEL_NAMES
from pipeline.result import ChangeLabel

# Each label is told apart without colour too: by its sign and by the shape of its chip (panels.css).
GLYPHS: dict[str, str] = {
    "static": "=",
    "appeared": "+",
    "disappeared": "\u2212",
    "moved": "\u2192",
    "unknown": "?",
    "replaced": "\u21c4",
}


def chip(label: ChangeLabel | str) -> str:
    """The sign of a label in its colour."""
    name = LABEL_NAMES[label] if isinstance(label, ChangeLabel) else label
    return f'<span class="oa-chip oa-{name}" aria-hidden="true">{GLYPHS[name]}</span>'


def sends(kind: str, value: Any = None) -> str:
    """Attributes that make an element send an event when clicked."""
    if value is None:
        return f'data-send="{escape(kind)}"'
    return f'data-send="{escape(kind)}" data-value="{escape(json.dumps(value))}"'


def picture(url: str, description: str) -> str:
    """An image, or an empty tile where there is none."""
    if not url:
        return '<span class="oa-noimage" role="img" aria-label="no picture"></span>'
    return f'<img src="{escape(url)}" alt="{escape(description)}" loading="lazy" draggable="false">'


def key(name: str) -> str:
    """A key of the keyboard."""
    return f"<kbd>{escape(name)}</kbd>"


def section(title: str, note: str = "") -> str:
    """Heading of a part of a panel, with a quiet note at its right."""
    return f'<div class="oa-section"><span>{escape(title)}</span><small>{escape(note)}</small></div>'


def empty(message: str) -> str:
    """What stands in a panel that has nothing to show: a sentence that says what to do."""
    return f'<div class="oa-empty">{escape(message)}</div>'
