"""Sentences of the report that only the report says; what is said of an object comes from ``wording``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from oasisview import wording
from oasisview.export.exporter import ReviewedResult
from oasisview.review import FinalLabel
from pipeline.result import ChangeLabel, MapObject, ReplacedEvent, SessionResult

# In which order changes are listed and numbered.
SECTIONS: tuple[tuple[ChangeLabel, str, str], ...] = (
    (ChangeLabel.MOVED, "Moved", "Seen on both visits, in another place."),
    (ChangeLabel.APPEARED, "New", "Not there on the earlier visit, although it had looked."),
    (ChangeLabel.DISAPPEARED, "Gone", "Not there any more, although the later visit looked."),
    (ChangeLabel.UNKNOWN, "Not decided", "Too little was seen, or what was seen does not settle it."),
)


@dataclass(frozen=True)
class Change:
    """One numbered entry of the report: an object whose final label is not static."""

    number: int
    item: MapObject
    final: FinalLabel

    @property
    def label(self) -> ChangeLabel:
        """The final label."""
        return self.final.label

    @property
    def name(self) -> str:
        """The label as the contract calls it."""
        return wording.LABEL_NAMES[self.label]


def numbered_changes(reviewed: ReviewedResult) -> list[Change]:
    """All changes, numbered in the order of the report: by section, then by object."""
    sections = [label for label, _, _ in SECTIONS]
    listed = [i for i in reviewed.objects if reviewed.final[i.object_id].label in sections]
    listed.sort(key=lambda i: (sections.index(reviewed.final[i.object_id].label), i.object_id))
    return [Change(n, item, reviewed.final[item.object_id]) for n, item in enumerate(listed, start=1)]


def moment(at: str | None) -> str:
    """An ISO 8601 time for readers, as it was written: its own zone, no conversion."""
    if not at:
        return "date not recorded"
    try:
        time = datetime.fromisoformat(at)
    except ValueError:
        return at
    day = f"{time.day} {time:%B %Y}"
    if len(at) <= len("2026-11-23"):
        return day
    zone = "" if time.tzinfo is None else " UTC" if not time.utcoffset() else f" ({time:%z})"
    return f"{day}, {time:%H:%M}{zone}"


def now() -> str:
    """The present moment in UTC, for readers."""
    return moment(datetime.now(UTC).isoformat(timespec="minutes"))


def visit_name(session: SessionResult) -> str:
    """Which visit, its name and when it was."""
    return f"{session.name or wording.visit_word(session.index)} ({moment(session.captured_at)})"


def count(number: int, thing: str) -> str:
    """A number with its noun."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def summary(reviewed: ReviewedResult) -> tuple[str, ...]:
    """What changed, in a few sentences."""
    final = [reviewed.final[item.object_id] for item in reviewed.objects]
    if not final:
        return ("No objects were found in these visits, so nothing can be said about them.",)
    by_label = Counter(entry.label for entry in final)
    moved, new, gone = (
        by_label[label] for label in (ChangeLabel.MOVED, ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED)
    )
    changed, unknown = moved + new + gone, by_label[ChangeLabel.UNKNOWN]
    parts = [f"{moved} moved" if moved else "", f"{new} new" if new else "", f"{gone} gone" if gone else ""]
    if changed:
        verb = "is a change" if changed == 1 else "are changes"
        said = f"Of {count(len(final), 'object')}, {changed} {verb}: {_listed([p for p in parts if p])}."
    else:
        said = f"None of the {count(len(final), 'object')} is known to have changed."
    pairs = len(_standing_pairs(reviewed))
    if pairs:
        said += f" In {count(pairs, 'place')} a new object stands where another one was before."
    same = by_label[ChangeLabel.STATIC]
    rest = "1 object is where it was." if same == 1 else f"{same} objects are where they were."
    if unknown:
        rest += f" {unknown} could not be decided and {'is' if unknown == 1 else 'are'} listed last."
    return said, rest, _who_decided(final)


def _who_decided(final: Sequence[FinalLabel]) -> str:
    listed = [entry for entry in final if entry.label is not ChangeLabel.STATIC or entry.overridden]
    decided = [entry for entry in listed if entry.decided_by is not None]
    if not listed:
        return ""
    if not decided:
        return (
            "Nobody has checked this yet: every label is the machine's, with its own estimate of confidence."
        )
    people = _listed(sorted({entry.decided_by or "" for entry in decided}))
    overridden = sum(entry.overridden for entry in decided)
    said = f"{people} checked {len(decided)} of the {len(listed)} changed, corrected or undecided objects"
    if overridden:
        said += f" and corrected the machine {'once' if overridden == 1 else f'{overridden} times'}"
    return said + ("; the rest is the machine's word." if len(decided) < len(listed) else ".")


def _standing_pairs(reviewed: ReviewedResult) -> list[ReplacedEvent]:
    """Replaced events of which both sides still carry the label that makes them one."""
    return [event for event in reviewed.replaced if is_standing(reviewed, event)]


def is_standing(reviewed: ReviewedResult, event: ReplacedEvent) -> bool:
    """Whether a replaced event survived the inspectors' decisions."""
    gone, new = reviewed.final.get(event.disappeared_id), reviewed.final.get(event.appeared_id)
    return (
        gone is not None
        and new is not None
        and gone.label is ChangeLabel.DISAPPEARED
        and new.label is ChangeLabel.APPEARED
    )


def decided(change: Change) -> str:
    """Who decided, when and why; or that nobody did."""
    final = change.final
    if final.decided_by is None:
        return "not checked by a person"
    relabelled = final.overridden and final.label is not change.item.label
    did = "set by" if relabelled else "corrected by" if final.overridden else "confirmed by"
    said = f"{did} {final.decided_by} on {moment(final.decided_at)}"
    if relabelled:
        said += f" (the machine said {wording.LABEL_NAMES[change.item.label]})"
    return f"{said}: {final.why}" if final.why else said


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
