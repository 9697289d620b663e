"""Why the selected object has its label, and the bar of verdicts under it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oasisview import wording
from oasisview.catalogue import BeforeAfter, Catalogue, ObjectView
from oasisview.decisions import Verdict
from oasisview.heatmap_colours import share_colour
from oasisview.panels.markup import chip, empty, key, picture, section, sends
from oasisview.panels.queue import LABEL_ORDER
from oasisview.shell import escape
from oasisview.wording import CASE_WORDS, LABEL_NAMES, LABEL_WORDS, Limits
from pipeline.result import ChangeLabel, MapObject

CANDIDATES = 7
RIVALS = 2


@dataclass(frozen=True)
class Candidate:
    """An object of the other visit that might be the counterpart.

    Attributes:
        object_id: who; sigma: share of the selected object's patches that land on it; s_bar: their
            quality; chosen: whether it is the partner.
    """

    object_id: int
    sigma: float
    s_bar: float
    chosen: bool


def candidates(catalogue: Catalogue, item: MapObject, limit: int = CANDIDATES) -> list[Candidate]:
    """The row (or column) of the score matrix that belongs to an object, best first, without zeros."""
    matrix = catalogue.result.score_matrix
    before, after = item.sighting(0), item.sighting(1)
    if before is not None and 0 <= before.instance < matrix.sigma.shape[0]:
        sigma, s_bar = matrix.sigma[before.instance], matrix.s_bar[before.instance]
        others = matrix.column_object_ids
    elif after is not None and 0 <= after.instance < matrix.sigma.shape[1]:
        sigma, s_bar = matrix.sigma_backward[:, after.instance], matrix.s_bar[:, after.instance]
        others = matrix.row_object_ids
    else:
        return []
    found: list[Candidate] = []
    for index in np.argsort(-np.asarray(sigma, np.float64), kind="stable"):
        other = int(others[index])
        chosen = other == item.object_id
        if sigma[index] <= 0 and not chosen:
            continue
        found.append(Candidate(other, float(sigma[index]), float(s_bar[index]), chosen))
    top = found[:limit]
    # The partner is always shown, however low it ranks.
    partner = next((c for c in found if c.chosen), None)
    return top if partner is None or partner in top else [*top[: limit - 1], partner]


def evidence_html(
    catalogue: Catalogue,
    object_id: int | None,
    verdict: Verdict | None,
    *,
    swipe: bool = False,
    can_undo: bool = False,
    can_redo: bool = False,
    conflict: str = "",
) -> str:
    """The whole panel for the selected object, or what to do where none is selected."""
    item = catalogue.objects.get(object_id) if object_id is not None else None
    if item is None:
        return f'<div class="oa oa-evidence">{empty(wording.NOTHING_SELECTED)}{_undo_bar(can_undo, can_redo)}</div>'
    label = verdict.label if verdict is not None else item.label
    body = [
        _title(item, label, verdict),
        _why(item, label, verdict, catalogue.limits),
        f'<div class="oa-conflict" role="alert">{escape(conflict)}</div>' if conflict else "",
        _pictures(catalogue, item, swipe=swipe),
        _numbers(item, catalogue.limits),
        _replaced(catalogue, item),
        _candidates(catalogue, item),
        _facts(catalogue, item),
    ]
    return (
        f'<div class="oa oa-evidence" data-evidence="{item.object_id}"><div class="oa-evidence-body">'
        f"{''.join(body)}</div>{_verdict_bar(item, verdict, can_undo, can_redo)}</div>"
    )


def _title(item: MapObject, label: ChangeLabel, verdict: Verdict | None) -> str:
    if verdict is None:
        state = f"{LABEL_NAMES[label]} \u00b7 {wording.percent(item.confidence)} sure"
    else:
        state = f"{LABEL_NAMES[label]} \u00b7 {'accepted' if verdict.accepted else 'set'} by {verdict.who}"
    return (
        f'<h3 class="oa-title">{chip(label)}<span>Object <span class="oa-muted">#{item.object_id}</span></span>'
        f'<small data-role="label">{escape(state)}</small></h3>'
    )


def _why(item: MapObject, label: ChangeLabel, verdict: Verdict | None, limits: Limits) -> str:
    said = ""
    if verdict is not None and not verdict.accepted:
        said = f"<b>{escape(wording.overridden(verdict.label, item.label, verdict.who))}</b> "
    if verdict is not None and verdict.reason:
        said += f"<q>{escape(verdict.reason)}</q> "
    reason = escape(wording.why(item, limits))
    return f'<p class="oa-why oa-{LABEL_NAMES[label]}" data-role="why">{said}{reason}</p>'


def _pictures(catalogue: Catalogue, item: MapObject, *, swipe: bool) -> str:
    views = catalogue.before_after(item.object_id)
    button = f'<button {sends("swipe")} aria-pressed="{str(swipe).lower()}" title="One over the other">swipe {key("X")}</button>'
    head = f'<div class="oa-section"><span>Before and after</span>{button}</div>'
    if swipe and views.before is not None and views.after is not None:
        return head + (
            f'<div class="oa-swipe"><img src="{escape(views.after.url)}" alt="After">'
            f'<img class="oa-over" src="{escape(views.before.url)}" alt="Before">'
            '<span class="oa-caption">Before \u25c2 \u25b8 After</span>'
            '<input type="range" min="0" max="100" value="50" aria-label="Before or after" '
            "oninput=\"this.parentNode.style.setProperty('--x',this.value+'%')\"></div>"
        )
    figures = "".join(_figure(item, session, view) for session, view in ((0, views.before), (1, views.after)))
    return head + f'<div class="oa-crops">{figures}{_lines(views)}</div>{_link_note(views)}'


def _figure(item: MapObject, session: int, view: ObjectView | None) -> str:
    word = wording.visit_word(session)
    if view is None:
        return (
            f'<figure><div class="oa-none">{word}: no keyframe shows this place<br>'
            f"{wording.percent(item.coverage)} of it was looked at</div></figure>"
        )
    label = LABEL_NAMES[item.label]
    if view.place is not None:
        x, y, width, height = view.place
        mark = f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" class="oa-place"/>'
        caption = f"{word}: same place \u00b7 kf {view.keyframe + 1}"
    else:
        mark = (
            f'<path d="{view.outline}" class="oa-halo"/><path d="{view.outline}" class="oa-line oa-{label}"/>'
        )
        caption = f"{word} \u00b7 kf {view.keyframe + 1}"
    jump = sends("keyframe", {"session": session, "keyframe": view.keyframe})
    return (
        f'<figure {jump} title="Show this keyframe below the map">{picture(view.url, caption)}'
        f'<svg viewBox="0 0 100 100" preserveAspectRatio="none">{mark}</svg>'
        f'<span class="oa-caption">{caption}</span></figure>'
    )


def _lines(views: BeforeAfter) -> str:
    """Patch links over both crops: the grid is 47.5 % | 5 % gap | 47.5 % wide (panels.css)."""
    if not views.lines:
        return ""
    drawn = []
    for line in views.lines:
        x1, y1 = line.before[0] * 47.5, line.before[1] * 100
        x2, y2 = 52.5 + line.after[0] * 47.5, line.after[1] * 100
        kind = "oa-link" if line.lands_on_object else "oa-link oa-astray"
        drawn.append(f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>')
    return (
        '<svg class="oa-links" viewBox="0 0 100 100" preserveAspectRatio="none" '
        f'aria-label="{len(drawn)} patch matches">{"".join(drawn)}</svg>'
    )


def _link_note(views: BeforeAfter) -> str:
    if views.before is None or views.after is None:
        return ""
    if views.lines:
        landing = sum(line.lands_on_object for line in views.lines)
        count = len(views.lines)
        if landing == count:
            text = f"Its {count} strongest patch matches, all on the same object."
        elif landing:
            text = (
                f"Its {count} strongest patch matches: {landing} on the same object, dashed ones elsewhere."
            )
        else:
            text = f"Its {count} strongest patch matches (dashed) end on other things."
    elif views.compared:
        text = "No patch of the object finds a match in the other picture."
    else:
        text = "These two keyframes were not compared patch by patch."
    return f'<div class="oa-note">{text}</div>'


def _numbers(item: MapObject, limits: Limits) -> str:
    rows = [
        _bullet("matching patches", "\u03c3", item.sigma, limits.tau_sigma, 1.0, wording.percent,
                "Share of the object's patches that find their match on the counterpart"),
        _bullet("match quality", "s\u0304", item.s_bar, limits.tau_s, 1.0, lambda v: f"{v:.2f}",
                "Mean confidence of those matches, 0 to 1"),
        _bullet("place looked at", "\u03bd", item.coverage, limits.nu_min, 1.0, wording.percent,
                "Share of the object's volume that the other visit observed"),
    ]  # fmt: skip
    if item.displacement_m is not None:
        rows.append(
            _bullet("displacement", "d", item.displacement_m, limits.tau_d_m,
                    max(item.displacement_m * 1.1, limits.tau_d_m * 3), wording.length,
                    "Distance between the object's centres on the two visits")
        )  # fmt: skip
    return (
        section("Evidence", CASE_WORDS[item.case])
        + f'<div class="oa-bullets">{"".join(rows)}</div>'
        + '<div class="oa-note">The blue tick is the limit that decides.</div>'
    )


def _bullet(name: str, symbol: str, value: float, limit: float, scale: float, show, tip: str) -> str:  # type: ignore[no-untyped-def]
    reached = value >= limit
    width, at = (100 * float(np.clip(v / scale, 0, 1)) for v in (value, limit))
    sign = "\u2265" if reached else "&lt;"
    return (
        f'<div class="oa-bullet" title="{escape(tip)}"><span>{name} <i class="oa-symbol">{symbol}</i></span>'
        f'<div class="oa-track"><i class="{"oa-reached" if reached else ""}" style="width:{width:.0f}%"></i>'
        f'<u style="left:{at:.0f}%"></u></div>'
        f'<span class="oa-value">{show(value)} <small>{sign} {show(limit)}</small></span></div>'
    )


def _replaced(catalogue: Catalogue, item: MapObject) -> str:
    other = item.replaced_by if item.replaced_by is not None else item.replaces
    if other is None or other not in catalogue.objects:
        return ""
    event = next(
        (e for e in catalogue.result.replaced if item.object_id in (e.disappeared_id, e.appeared_id)), None
    )
    text = "replaced by" if item.replaced_by is not None else "stands in the place of"
    share = f" \u00b7 bounds overlap by {wording.percent(event.overlap)}" if event is not None else ""
    return (
        f'<div class="oa-replaced" role="button" tabindex="0" {sends("select", other)}>{chip("replaced")}'
        f"{picture(catalogue.thumbnail_url(other), wording.object_name(other))}"
        f"<span>{text} <b>object #{other}</b><small>{share}</small></span></div>"
    )


def _candidates(catalogue: Catalogue, item: MapObject) -> str:
    found = candidates(catalogue, item)
    which = "row" if item.sighting(0) is not None else "column"
    head = section("Candidates", f"{which} of the score matrix")
    if not found:
        return (
            head + '<div class="oa-note">No patch of this object matched any object of the other visit.</div>'
        )
    pictures: list[str] = []
    numbers: list[str] = []
    sigma: list[str] = []
    quality: list[str] = []
    for candidate in found:
        mark = " oa-chosen" if candidate.chosen else ""
        name = wording.object_name(candidate.object_id)
        send = sends("select", candidate.object_id)
        pictures.append(
            f'<td {send} title="Show {name}">{picture(catalogue.thumbnail_url(candidate.object_id), name)}</td>'
        )
        numbers.append(f"<td>{candidate.object_id}</td>")
        for row, value in ((sigma, candidate.sigma), (quality, candidate.s_bar)):
            ground, ink = share_colour(value)
            row.append(
                f'<td class="oa-cell{mark}" {send} style="background:{ground};color:{ink}">{value:.2f}</td>'
            )
    table = (
        '<table class="oa-heat">'
        f"<tr><th></th>{''.join(pictures)}</tr><tr><th>#</th>{''.join(numbers)}</tr>"
        f'<tr><th title="share of matching patches">\u03c3</th>{"".join(sigma)}</tr>'
        f'<tr><th title="quality of the matches">s\u0304</th>{"".join(quality)}</tr></table>'
    )
    partner = next((c for c in found if c.chosen), None)
    chosen = (
        '<div class="oa-note">The framed column is the chosen partner: the same object on the other visit.</div>'
        if partner is not None
        else '<div class="oa-note">None was chosen.</div>'
    )
    rivals = [c for c in found if not c.chosen][:RIVALS]
    rows = "".join(_rival(catalogue, c, partner) for c in rivals)
    return head + table + chosen + (section("Rejected") + rows if rivals else "")


def _rival(catalogue: Catalogue, candidate: Candidate, partner: Candidate | None) -> str:
    reason = wording.rejection(
        candidate.sigma,
        candidate.s_bar,
        catalogue.limits,
        partner_id=partner.object_id if partner is not None else None,
    )
    name = wording.object_name(candidate.object_id)
    return (
        f'<div class="oa-rival" role="button" tabindex="0" {sends("select", candidate.object_id)}>'
        f"{picture(catalogue.thumbnail_url(candidate.object_id), name)}"
        f"<span>{name}<small>{escape(reason)}</small></span></div>"
    )


def _facts(catalogue: Catalogue, item: MapObject) -> str:
    rows = []
    for sighting in item.sightings:
        word = wording.visit_word(sighting.session)
        rows.append(
            f"<tr><td>{word}</td><td>{wording.size(sighting.extent_m)}</td>"
            f"<td>{len(sighting.keyframes)} keyframes</td><td>{sighting.point_count} points</td></tr>"
        )
    settled = (
        "not settled by any submap"
        if item.decided_in_submap is None
        else f"settled in submap {item.decided_in_submap + 1}"
    )
    turned = f" \u00b7 turned by {np.degrees(item.rotation_rad):.0f}\u00b0" if item.rotation_rad else ""
    return section("Seen", settled + turned) + f'<table class="oa-facts">{"".join(rows)}</table>'


def _verdict_bar(item: MapObject, verdict: Verdict | None, can_undo: bool, can_redo: bool) -> str:
    buttons = []
    for number, label in enumerate(LABEL_ORDER, start=1):
        name = LABEL_NAMES[label]
        machine = " oa-machine" if label is item.label else ""
        pressed = "true" if verdict is not None and verdict.label is label else "false"
        tip = f"Set to {name}" + (" (what the machine said)" if machine else "")
        buttons.append(
            f'<button class="oa-{name}{machine}" aria-pressed="{pressed}" title="{tip}" '
            f"{sends('decide', name)}>{chip(label)}<span>{LABEL_WORDS[label]}</span>{key(str(number))}</button>"
        )
    accept = f"Accept \u201c{LABEL_WORDS[item.label]}\u201d"
    return (
        f'<div class="oa-verdict"><div class="oa-verdicts" role="group" aria-label="Label">{"".join(buttons)}</div>'
        f'<div class="oa-accept"><button class="oa-primary" data-accept {sends("accept")}>{accept} {key("Enter")}</button>'
        f'<button data-open="note" title="Write a note about this object (M)">note {key("M")}</button>'
        f"{_undo_buttons(can_undo, can_redo)}</div></div>"
    )


def _undo_buttons(can_undo: bool, can_redo: bool) -> str:
    return (
        f'<button {sends("undo")} title="Undo (U)" aria-label="Undo" {"" if can_undo else "disabled"}>\u21b6</button>'
        f'<button {sends("redo")} title="Redo (R)" aria-label="Redo" {"" if can_redo else "disabled"}>\u21b7</button>'
    )


def _undo_bar(can_undo: bool, can_redo: bool) -> str:
    if not can_undo and not can_redo:
        return ""
    return f'<div class="oa-verdict"><div class="oa-accept">{_undo_buttons(can_undo, can_redo)}</div></div>'
