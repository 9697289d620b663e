"""Names and reasons as people write them, made fit for a journal that others read."""

from __future__ import annotations

import unicodedata

from pipeline.errors import InputError

MAX_WHO_LENGTH = 80
MAX_WHY_LENGTH = 500

# Bidirectional overrides: a name or reason must not be able to turn the text around it.
_BIDIRECTIONAL = frozenset("\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")


def checked_name(who: str) -> str:
    """A person's name; ``InputError`` if it is empty or too long."""
    name = one_line(who)
    if not name:
        raise InputError("a decision needs the name of who decides", "say who you are")
    if len(name) > MAX_WHO_LENGTH:
        raise InputError(
            f"the name is {len(name)} characters long", f"use at most {MAX_WHO_LENGTH} characters"
        )
    return name


def checked_reason(why: str) -> str:
    """A reason, which may be empty; ``InputError`` if it is too long."""
    reason = one_line(why)
    if len(reason) > MAX_WHY_LENGTH:
        raise InputError(
            f"the reason is {len(reason)} characters long", f"use at most {MAX_WHY_LENGTH} characters"
        )
    return reason


def one_line(text: str) -> str:
    """One line of printable text: line breaks become spaces, control characters and lone surrogates go."""
    spaced = "".join(" " if character.isspace() else character for character in text)
    kept = (
        character
        for character in spaced
        if unicodedata.category(character) not in ("Cc", "Cs") and character not in _BIDIRECTIONAL
    )
    return " ".join("".join(kept).split())
