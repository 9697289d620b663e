"""The list of objects to review: what is left, most rewarding first, with label filters that count."""

from __future__ import annotations

from collections.abc import Mapping

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.decisions import Verdict
from oasisview.panels.markup import chip, empty, picture, sends
from oasisview.shell import escape
from oasisview.wording import LABEL_NAMES
from pipeline.result import ChangeLabel, MapObject

# In the order of the keys 1 to 5.
LABEL_ORDER = (
    ChangeLabel.STATIC,
    ChangeLabel.APPEARED,
    ChangeLabel.DISAPPEARED,
    ChangeLabel.MOVED,
    ChangeLabel.UNKNOWN,
)
DOUBTFUL_BELOW = 0.5


def queue_order(
    catalogue: Catalogue, verdicts: Mapping[int, Verdict], shown: frozenset[ChangeLabel]
) -> list[MapObject]:
    """Objects of the queue from top to bottom: doubtful, likely right, done; most doubt times size first.

    The machine's label filters, so that an object does not leave the list when it is overridden; what
    has been decided stays visible under Done.
    """
    listed = [item for item in catalogue.by_doubt() if item.label in shown or item.object_id in verdicts]
    return sorted(listed, key=lambda item: _group(item, verdicts))


def _group(item: MapObject, verdicts: Mapping[int, Verdict]) -> int:
    if item.object_id in verdicts:
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


def queue_html(catalogue: Catalogue, verdicts: Mapping[int, Verdict], shown: frozenset[ChangeLabel]) -> str:
    """The whole panel. Rows carry ``data-object``; the shell marks the selected one."""
    if not catalogue.objects:
        return f'<div class="oa oa-queue">{empty(wording.NO_OBJECTS)}</div>'
    order = queue_order(catalogue, verdicts, shown)
    parts = [f'<div class="oa oa-queue">{_header(catalogue, verdicts, shown, order)}']
    for group, title in enumerate(("Doubtful", "Likely right", "Done")):
        rows = [item for item in order if _group(item, verdicts) == group]
        if rows:
            parts.append(f'<div class="oa-group"><span>{title}</span><span>{len(rows)}</span></div>')
            parts += [_row(catalogue, item, verdicts.get(item.object_id)) for item in rows]
    if not order:
        parts.append(empty(wording.NOTHING_IN_QUEUE))
    elif all(item.object_id in verdicts for item in order):
        parts.append(empty(f"All {len(order)} reviewed. Export the map, or show another label above."))
    return "".join(parts) + "</div>"


def _header(
    catalogue: Catalogue,
    verdicts: Mapping[int, Verdict],
    shown: frozenset[ChangeLabel],
    order: list[MapObject],
) -> str:
    done = [verdicts[item.object_id] for item in order if item.object_id in verdicts]
    overridden = sum(not verdict.accepted for verdict in done)
    total = max(len(order), 1)
    chips = []
    for label in LABEL_ORDER:
        count = sum(item.label is label for item in catalogue.objects.values())
        pressed = "true" if label in shown else "false"
        name = LABEL_NAMES[label]
        chips.append(
            f'<button aria-pressed="{pressed}" title="Show or hide: {name} ({count})" '
            f'aria-label="{name}: {count}" {sends("filter", name)}>{chip(label)}{count}</button>'
        )
    accepted_share = 100 * (len(done) - overridden) / total
    return (
        '<div class="oa-queue-head"><div class="oa-spread">'
        f'<b data-role="reviewed">{len(done)} of {len(order)} reviewed</b>'
        f'<span class="oa-muted">{overridden} overridden</span></div>'
        f'<div class="oa-bar" title="accepted, overridden"><i style="width:{accepted_share:.1f}%"></i>'
        f'<i class="oa-over" style="width:{100 * overridden / total:.1f}%"></i></div>'
        f'<div class="oa-chips" role="group" aria-label="Labels to list">{"".join(chips)}</div></div>'
    )


def _row(catalogue: Catalogue, item: MapObject, verdict: Verdict | None) -> str:
    label = verdict.label if verdict is not None else item.label
    fact = wording.queue_fact(item, label)
    mark = "" if verdict is None else ("\u2713" if verdict.accepted else "\u270e")
    said = "" if verdict is None else f", {'accepted' if verdict.accepted else 'set'} by {verdict.who}"
    name = wording.object_name(item.object_id)
    done = " oa-done" if verdict is not None else ""
    return (
        f'<div class="oa-row{done}" role="button" tabindex="0" data-object="{item.object_id}" '
        f'{sends("select", item.object_id)} title="{escape(name)}: {LABEL_NAMES[label]}, {escape(fact)}, '
        f'{wording.percent(item.confidence)} sure{escape(said)}">'
        f"{picture(catalogue.thumbnail_url(item.object_id), name)}{chip(label)}"
        f'<span class="oa-name">#{item.object_id}<small>{escape(fact)}</small></span>'
        f'<span class="oa-meter"><i style="width:{100 * item.confidence:.0f}%"></i></span>'
        f'<span class="oa-mark">{mark}</span></div>'
    )
