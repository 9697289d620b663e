"""The list of objects to review: what is left, most rewarding first, with label filters that count."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.decisions import Verdict
from oasisview.panels.markup import chip, empty, picture, sends
from oasisview.queue_filter import GROUPS, QueueFilter, group, listed, queue_order
from oasisview.review import DroppedObject
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


def queue_html(
    catalogue: Catalogue,
    verdicts: Mapping[int, Verdict],
    chosen: QueueFilter,
    *,
    skipped: Sequence[int] = (),
    disputed: Collection[int] = (),
    dropped: Sequence[DroppedObject] = (),
) -> str:
    """The whole panel. Rows carry ``data-object``; the shell marks the selected one.

    Args:
        skipped: what this tab put off; disputed: what people disagree about, by object id.
        dropped: what people said is no object.
    """
    if not catalogue.objects and not dropped:
        return f'<div class="oa oa-queue">{empty(wording.NO_OBJECTS)}</div>'
    order = queue_order(catalogue.by_doubt(), verdicts, chosen, skipped=skipped, disputed=disputed)
    counted = listed(list(catalogue.objects.values()), verdicts, chosen.labels)
    parts = [f'<div class="oa oa-queue">{_header(catalogue, verdicts, chosen, counted)}']
    if chosen.is_narrow:
        parts.append(_narrowed(order, counted, chosen))
    is_search = bool(chosen.search.strip())
    for number, title in enumerate(("Found",) if is_search else GROUPS):
        rows = [item for item in order if is_search or group(item, verdicts, skipped) == number]
        if rows:
            parts.append(_group_head(title, len(rows)))
            parts += [
                _row(catalogue, item, verdicts.get(item.object_id), item.object_id in disputed)
                for item in rows
            ]
    none = [
        entry
        for entry in dropped
        if not chosen.is_narrow or (chosen.number and str(entry.object_id).startswith(chosen.number))
    ]
    if none:
        parts.append(_group_head("Not objects", len(none)))
        parts += [_dropped_row(entry, entry.object_id in disputed) for entry in none]
    if not counted and not chosen.is_narrow:
        parts.append(empty(wording.NOTHING_IN_QUEUE))
    elif counted and all(item.object_id in verdicts for item in counted):
        parts.append(empty(f"All {len(counted)} decided. Export the map, or show another label above."))
    return "".join(parts) + "</div>"


def _header(
    catalogue: Catalogue,
    verdicts: Mapping[int, Verdict],
    chosen: QueueFilter,
    counted: list[MapObject],
) -> str:
    done = [verdicts[item.object_id] for item in counted if item.object_id in verdicts]
    overridden = sum(not verdict.accepted for verdict in done)
    total = max(len(counted), 1)
    chips = []
    for label in LABEL_ORDER:
        count = sum(item.label is label for item in catalogue.objects.values())
        pressed = "true" if label in chosen.labels else "false"
        name = LABEL_NAMES[label]
        chips.append(
            f'<button aria-pressed="{pressed}" title="Show or hide: {name} ({count})" '
            f'aria-label="{name}: {count}" {sends("filter", name)}>{chip(label)}{count}</button>'
        )
    accepted_share = 100 * (len(done) - overridden) / total
    return (
        '<div class="oa-queue-head"><div class="oa-spread">'
        f'<b data-role="reviewed">{len(done)} of {len(counted)} decided</b>'
        f'<span class="oa-muted">{overridden} corrected</span></div>'
        f'<div class="oa-bar" title="accepted, corrected"><i style="width:{accepted_share:.1f}%"></i>'
        f'<i class="oa-over" style="width:{100 * overridden / total:.1f}%"></i></div>'
        f'<div class="oa-chips" role="group" aria-label="Labels to list">{"".join(chips)}</div></div>'
    )


def _narrowed(order: list[MapObject], counted: list[MapObject], chosen: QueueFilter) -> str:
    if chosen.search.strip():
        said = f"{len(order)} found" if chosen.number else "Search by number: 12 or #12"
        if chosen.number and not order:
            said = f"No object #{chosen.number}"
    else:
        said = f"{len(order)} of {len(counted)} listed"
    return (
        f'<div class="oa-narrowed" role="status"><span data-role="narrowed">{escape(said)}</span>'
        f'<button {sends("queue_all")} title="End search and filter">Show all</button></div>'
    )


def _group_head(title: str, count: int) -> str:
    return f'<div class="oa-group"><span>{title}</span><span>{count}</span></div>'


def _row(catalogue: Catalogue, item: MapObject, verdict: Verdict | None, is_disputed: bool) -> str:
    label = verdict.label if verdict is not None else item.label
    fact = wording.queue_fact(item, label)
    mark = "" if verdict is None else ("\u2713" if verdict.accepted else "\u270e")
    said = "" if verdict is None else f", {'accepted' if verdict.accepted else 'set'} by {verdict.who}"
    if is_disputed:
        mark, said = "\u26a1", f"{said}; inspectors disagree"
    name = wording.object_name(item.object_id)
    state = (" oa-done" if verdict is not None else "") + (" oa-disputed" if is_disputed else "")
    return (
        f'<div class="oa-row{state}" role="button" tabindex="0" data-object="{item.object_id}" '
        f'{sends("select", item.object_id)} title="{escape(name)}: {LABEL_NAMES[label]}, {escape(fact)}, '
        f'{wording.percent(item.confidence)} sure{escape(said)}">'
        f"{picture(catalogue.thumbnail_url(item.object_id), name)}{chip(label)}"
        f'<span class="oa-name">#{item.object_id}<small>{escape(fact)}</small></span>'
        f'<span class="oa-meter"><i style="width:{100 * item.confidence:.0f}%"></i></span>'
        f'<span class="oa-mark">{mark}</span></div>'
    )


def _dropped_row(entry: DroppedObject, is_disputed: bool) -> str:
    who = escape(entry.event.who)
    said = f"said by {who}" + ("; inspectors disagree" if is_disputed else "")
    return (
        f'<div class="oa-dropped" data-dropped="{entry.object_id}">'
        f'<span class="oa-name">#{entry.object_id}<small>{said}</small></span>'
        f'<button {sends("keep", entry.object_id)} title="It is an object after all">bring back</button>'
        "</div>"
    )
