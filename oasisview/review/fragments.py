"""What identities are made of: the machine's objects, each as one visit saw it, and groups of them.

A correction never edits objects. It says which fragments are one thing; every later state is a partition of
the same fragments, so nothing can get lost, and the machine's own partition is always there to return to.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pipeline.result import ChangeLabel

_FRAGMENT = re.compile(r"(\d{1,10})\.(\d{1,4})", re.ASCII)


class Fragment(NamedTuple):
    """An object of the machine (``object_id``) as one visit (``session``) saw it."""

    object_id: int
    session: int

    def __str__(self) -> str:
        return f"{self.object_id}.{self.session}"


Members = frozenset[Fragment]


@dataclass(frozen=True)
class Group:
    """Fragments that somebody said are one thing.

    Attributes:
        members: all fragments of it.
        label: what the person said became of it; None = what follows from the fragments.
        is_object: False = no object at all, part of the background.
    """

    members: Members
    label: ChangeLabel | None = None
    is_object: bool = True

    def __post_init__(self) -> None:
        if not self.members:
            raise ValueError("a group has at least one fragment")


def encode(groups: Sequence[Group]) -> str:
    """Groups as the journal keeps them; no groups are the empty text."""
    if not groups:
        return ""
    return json.dumps(
        [
            {"of": [str(fragment) for fragment in sorted(group.members)]}
            | ({} if group.label is None else {"label": int(group.label)})
            | ({} if group.is_object else {"object": False})
            for group in groups
        ],
        separators=(",", ":"),
    )


def decode(text: str) -> tuple[Group, ...]:
    """The groups of :func:`encode`.

    Raises:
        ValueError: the text is no such list.
    """
    if not text:
        return ()
    try:
        return tuple(
            Group(
                frozenset(_fragment(name) for name in entry["of"]),
                None if entry.get("label") is None else ChangeLabel(entry["label"]),
                bool(entry.get("object", True)),
            )
            for entry in json.loads(text)
        )
    except (TypeError, KeyError, AttributeError) as error:
        raise ValueError(f"no list of groups: {error}") from None


def all_members(groups: Iterable[Group]) -> Members:
    """Every fragment that the groups speak of."""
    return frozenset(fragment for group in groups for fragment in group.members)


def _fragment(name: str) -> Fragment:
    match = _FRAGMENT.fullmatch(name)
    if match is None:
        raise ValueError(f"no fragment: {name!r}")
    return Fragment(int(match[1]), int(match[2]))
