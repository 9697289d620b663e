"""What the browser may tell the server: a parser for every kind of event.

Everything that arrives is untrusted. A parser takes the decoded JSON value and returns a checked one, or
raises ``ValueError``; the shell drops and logs what does not parse.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")
Parser = Callable[[Any], T]

MAX_TEXT_LENGTH = 500  # of what people write: notes and reasons
# Sent by the shell of every page.
OWN_KINDS = frozenset({"hello", "note", "undo", "swipe", "overview", "escape"})


def nothing(value: Any) -> None:
    """An event without a value."""
    if value is not None:
        raise ValueError("no value expected")


def flag(value: Any) -> bool:
    """True or false."""
    if not isinstance(value, bool):
        raise ValueError("true or false expected")
    return value


def whole_number(low: int, high: int) -> Parser[int]:
    """A whole number in [low, high]."""

    def parse(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ValueError(f"a whole number from {low} to {high} expected")
        return value

    return parse


def number(low: float, high: float) -> Parser[float]:
    """A finite number in [low, high]."""

    def parse(value: Any) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError("a number expected")
        if not math.isfinite(value) or not low <= value <= high:
            raise ValueError(f"a number from {low} to {high} expected")
        return float(value)

    return parse


def choice(*choices: str) -> Parser[str]:
    """One of the given words."""

    def parse(value: Any) -> str:
        if not isinstance(value, str) or value not in choices:
            raise ValueError(f"one of {', '.join(choices)} expected")
        return value

    return parse


def text(max_length: int = MAX_TEXT_LENGTH) -> Parser[str]:
    """Text of a person, without control characters except line breaks; surrounding space is cut off."""

    def parse(value: Any) -> str:
        if not isinstance(value, str) or len(value) > max_length:
            raise ValueError(f"text of at most {max_length} characters expected")
        return "".join(c for c in value if c.isprintable() or c == "\n").strip()

    return parse


def list_of(parser: Parser[T], max_length: int) -> Parser[list[T]]:
    """A list of at most ``max_length`` values that each parse."""

    def parse(value: Any) -> list[T]:
        if not isinstance(value, list) or len(value) > max_length:
            raise ValueError(f"a list of at most {max_length} expected")
        return [parser(item) for item in value]

    return parse


def record(**fields: Parser[Any]) -> Parser[dict[str, Any]]:
    """An object with exactly these fields, each parsed."""

    def parse(value: Any) -> dict[str, Any]:
        if not isinstance(value, dict) or value.keys() != fields.keys():
            raise ValueError(f"an object with {', '.join(fields)} expected")
        return {name: parser(value[name]) for name, parser in fields.items()}

    return parse


OBJECT_ID_MAX = 2**31 - 1
object_id = whole_number(1, OBJECT_ID_MAX)


@dataclass(frozen=True)
class PixelClick:
    """A click in one of the pictures of the band.

    Attributes:
        session, keyframe: the picture, as the page named it (``data-session``, ``data-keyframe``).
        u, v: place in the picture from its top left corner, both in [0, 1].
    """

    session: int
    keyframe: int
    u: float
    v: float


def pixel_click(value: Any) -> PixelClick:
    """Parse a :class:`PixelClick`; session and keyframe still have to be checked against the result."""
    fields = record(
        session=whole_number(0, 10_000),
        keyframe=whole_number(0, 10_000_000),
        u=number(0.0, 1.0),
        v=number(0.0, 1.0),
    )(value)
    return PixelClick(**fields)


@dataclass(frozen=True)
class Hello:
    """The first event of a page: what its address asked for.

    Attributes:
        object_id: of ``?object=12``; None if absent or not a number.
        width_px, height_px: size of the window.
        address: further words of the address (``keyframe``, ``map``), unchecked.
        remembered: what the browser kept of earlier pages, unchecked.
    """

    object_id: int | None
    width_px: int
    height_px: int
    address: Mapping[str, str] = field(default_factory=dict)
    remembered: Mapping[str, Any] = field(default_factory=dict)


def hello(value: Any) -> Hello:
    """Parse a :class:`Hello`; a deep link that makes no sense is ignored rather than refused."""
    fields = record(
        search=lambda search: search,
        remembered=lambda kept: kept,
        width=whole_number(0, 100_000),
        height=whole_number(0, 100_000),
    )(value)
    search = fields["search"] if isinstance(fields["search"], Mapping) else {}
    asked = search.get("object")
    wanted: int | None = None
    if isinstance(asked, str) and asked.isascii() and asked.isdigit() and len(asked) < 10:
        wanted = int(asked) or None
    return Hello(
        object_id=wanted,
        width_px=fields["width"],
        height_px=fields["height"],
        address={k: search[k] for k in ("keyframe", "map") if isinstance(search.get(k), str)},
        remembered=fields["remembered"] if isinstance(fields["remembered"], Mapping) else {},
    )
