"""Which objects a person wants to see in the queue, and where they stand in it: pure, one per tab."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from oasisview.catalogue import changed_labels
from pipeline.result import ChangeLabel, MapObject

if TYPE_CHECKING:
    from oasisview.decisions import Verdict

DOUBTFUL_BELOW = 0.5
DECIDED = {"all": "decided or not", "open": "not decided", "done": "decided"}
VISITS = {"any": "any visit", "before": "before only", "now": "now only", "both": "on both visits"}
# Longest side of the bounds, metres: [low, high).
SIZES: Mapping[str, tuple[str, float, float]] = {
    "any": ("any size", 0.0, float("inf")),
    "small": ("under 30 cm", 0.0, 0.3),
    "medium": ("30 cm to 1 m", 0.3, 1.0),
    "large": ("over 1 m", 1.0, float("inf")),
}
_NUMBER = re.compile(r"#?\s*(\d{1,9})", re.ASCII)


@dataclass(frozen=True)
class QueueFilter:
    """What a tab lists.

    Attributes:
        labels: the machine's labels to list; what has been decided is listed whatever its label.
        decided, visit, size: a key of ``DECIDED``, ``VISITS`` and ``SIZES``.
        low_percent, high_percent: confidence of the machine, both ends included.
        disagreement: only what people disagree about.
        search: the start of an object's number; while there is one, nothing else filters.
    """

    labels: frozenset[ChangeLabel] = field(default_factory=changed_labels)
    decided: str = "all"
    visit: str = "any"
    size: str = "any"
    low_percent: int = 0
    high_percent: int = 100
    disagreement: bool = False
    search: str = ""

    @property
    def number(self) -> str:
        """The digits that are searched for; empty if nothing is."""
        found = _NUMBER.fullmatch(self.search.strip())
        return found[1] if found else ""

    @property
    def is_narrow(self) -> bool:
        """Whether anything but the labels filters."""
        plain = QueueFilter(self.labels)
        return self != plain

    def passes(self, item: MapObject, *, is_decided: bool, is_disputed: bool) -> bool:
        """Whether an object is listed, the labels and the search aside."""
        sides = [max(sighting.extent_m) for sighting in item.sightings]
        _, low_m, high_m = SIZES[self.size]
        before, now = item.sighting(0) is not None, item.sighting(1) is not None
        on_visits = {"any": True, "before": before and not now, "now": now and not before}
        return (
            (self.decided == "all" or (self.decided == "done") == is_decided)
            and on_visits.get(self.visit, before and now)
            and low_m <= max(sides, default=0.0) < high_m
            and self.low_percent <= round(100 * item.confidence) <= self.high_percent
            and (is_disputed or not self.disagreement)
        )


def listed(
    items: Sequence[MapObject], verdicts: Mapping[int, Verdict], labels: frozenset[ChangeLabel]
) -> list[MapObject]:
    """What the progress counts: objects of the chosen labels, and whatever has been decided.

    The machine's label chooses, so that an object does not leave the list when it is overridden.
    """
    return [item for item in items if item.label in labels or item.object_id in verdicts]


def queue_order(
    items: Sequence[MapObject],
    verdicts: Mapping[int, Verdict],
    chosen: QueueFilter,
    *,
    skipped: Sequence[int] = (),
    disputed: Collection[int] = (),
) -> list[MapObject]:
    """Objects of the queue from top to bottom: doubtful, likely right, skipped, done.

    Args:
        items: all objects, most rewarding first.
        skipped: what this tab put off, in that order.
        disputed: what people disagree about.
    """
    if chosen.search.strip():
        number = chosen.number
        found = [i for i in items if number and str(i.object_id).startswith(number)]
        return sorted(found, key=lambda item: item.object_id)  # the exact number comes first
    kept = [
        item
        for item in listed(items, verdicts, chosen.labels)
        if chosen.passes(item, is_decided=item.object_id in verdicts, is_disputed=item.object_id in disputed)
    ]
    place = {object_id: number for number, object_id in enumerate(skipped)}
    return sorted(kept, key=lambda item: (group(item, verdicts, skipped), place.get(item.object_id, -1)))


GROUPS = ("Doubtful", "Likely right", "Skipped", "Done")


def group(item: MapObject, verdicts: Mapping[int, Verdict], skipped: Collection[int]) -> int:
    """Which of ``GROUPS`` an object stands in."""
    if item.object_id in verdicts:
        return 3
    if item.object_id in skipped:
        return 2
    return 0 if item.confidence < DOUBTFUL_BELOW or item.label is ChangeLabel.UNKNOWN else 1


def next_to_review(order: list[MapObject], verdicts: Mapping[int, Verdict], after: int | None) -> int | None:
    """The first undecided object behind ``after`` in the list, from the top again at its end."""
    ids = [item.object_id for item in order]
    start = ids.index(after) + 1 if after in ids else 0
    return next((i for i in ids[start:] + ids[:start] if i not in verdicts), None)


def step(order: list[MapObject], selected: int | None, by: int) -> int | None:
    """The object ``by`` rows below the selected one, around the ends; the first if none is selected."""
    if not order:
        return None
    ids = [item.object_id for item in order]
    if selected not in ids:
        return ids[0] if by > 0 else ids[-1]
    return ids[(ids.index(selected) + by) % len(ids)]
