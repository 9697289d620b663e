"""Why the selected object has its label: a sentence, pictures, numbers against their limits, rivals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.decisions import Verdict
from oasisview.panels.before_after import before_after_html
from oasisview.panels.belief_strip import strip_html
from oasisview.panels.candidates import candidates_html, replaced_html
from oasisview.panels.markup import chip, empty, section
from oasisview.panels.verdict import undo_html, verdict_html
from oasisview.shell import escape
from oasisview.why import rivals_of, why
from oasisview.wording import CASE_WORDS, LABEL_NAMES, Limits
from pipeline.result import ChangeLabel, MapObject


def evidence_html(
    catalogue: Catalogue,
    object_id: int | None,
    verdict: Verdict | None,
    *,
    swipe: bool = False,
    belief: int | None = None,
    can_undo: bool = False,
    can_redo: bool = False,
    pieces: int = 1,
    conflict: str = "",
) -> str:
    """The whole panel for the selected object, or what to do where none is selected.

    ``pieces`` tells of how many of the machine's objects it is made.
    """
    item = catalogue.objects.get(object_id) if object_id is not None else None
    if item is None:
        hint = empty(wording.NOTHING_SELECTED if catalogue.objects else wording.NO_OBJECTS)
        return f'<div class="oa oa-evidence">{hint}{undo_html(can_undo=can_undo, can_redo=can_redo)}</div>'
    label = verdict.label if verdict is not None else item.label
    body = [
        _title(item, label, verdict),
        _why(catalogue, item, label, verdict),
        f'<div class="oa-conflict" role="alert">{escape(conflict)}</div>' if conflict else "",
        before_after_html(catalogue, item, swipe=swipe),
        _numbers(item, catalogue.limits),
        replaced_html(catalogue, item),
        candidates_html(catalogue, item),
        strip_html(catalogue, item, belief),
        _facts(item),
    ]
    return (
        f'<div class="oa oa-evidence" data-evidence="{item.object_id}">'
        f'<div class="oa-evidence-body">{"".join(body)}</div>'
        f"{verdict_html(item, verdict, can_undo=can_undo, can_redo=can_redo, pieces=pieces)}</div>"
    )


def _title(item: MapObject, label: ChangeLabel, verdict: Verdict | None) -> str:
    if verdict is None:
        state = f"{LABEL_NAMES[label]} \u00b7 {wording.percent(item.confidence)} sure"
    else:
        state = f"{LABEL_NAMES[label]} \u00b7 {'accepted' if verdict.accepted else 'set'} by {verdict.who}"
    return (
        f'<h3 class="oa-title">{chip(label)}'
        f'<span>Object <span class="oa-muted">#{item.object_id}</span></span>'
        f'<small data-role="label">{escape(state)}</small>'
        '<button data-copy-link class="oa-copy" title="Copy a link to this finding (L)">Link</button></h3>'
    )


def _why(catalogue: Catalogue, item: MapObject, label: ChangeLabel, verdict: Verdict | None) -> str:
    said = ""
    if verdict is not None and not verdict.accepted:
        said = f"<b>{escape(_said(item, verdict))}</b> "
    if verdict is not None and verdict.reason:
        said += f"<q>{escape(verdict.reason)}</q> "
    reason = escape(why(item, catalogue.limits, rivals_of(catalogue.result, item)))
    if verdict is not None and verdict.correction:
        reason = f"What the machine saw: {reason}"
    return f'<p class="oa-why oa-{LABEL_NAMES[label]}" data-role="why">{said}{reason}</p>'


def _said(item: MapObject, verdict: Verdict) -> str:
    if not verdict.correction:
        return wording.overridden(verdict.label, item.label, verdict.who)
    label = "" if verdict.label is item.label else f" But set to {LABEL_NAMES[verdict.label]}."
    return f"Corrected by {verdict.who}: {verdict.correction}.{label}"


def _numbers(item: MapObject, limits: Limits) -> str:
    def plain(value: float) -> str:
        return f"{value:.2f}"

    share = "Share of the object's patches that find their match on its best candidate"
    quality = "Mean confidence of those matches, 0 to 1"
    looked = "Share of the object's volume that the other visit observed"
    apart = "Distance between the object's centres on the two visits"
    percent = wording.percent
    rows = [
        _bullet("matching patches", "\u03c3", item.sigma, limits.tau_sigma, 1.0, percent, share),
        _bullet("match quality", "s\u0304", item.s_bar, limits.tau_s, 1.0, plain, quality),
        _bullet("place looked at", "\u03bd", item.coverage, limits.nu_min, 1.0, percent, looked),
    ]
    if item.displacement_m is not None:
        distance, limit = item.displacement_m, limits.tau_d_m
        scale = max(distance * 1.1, limit * 3)
        rows.append(_bullet("displacement", "d", distance, limit, scale, wording.length, apart))
    return (
        section("Evidence", CASE_WORDS[item.case])
        + "".join(rows)
        + '<div class="oa-note">The blue tick is the limit of each measure; the sentence above says what '
        + "decided.</div>"
    )


def _bullet(
    name: str, symbol: str, value: float, limit: float, scale: float, show: Callable[[float], str], tip: str
) -> str:
    reached = value >= limit
    width, at = (100 * float(np.clip(v / scale, 0, 1)) for v in (value, limit))
    return (
        f'<div class="oa-bullet" title="{escape(tip)}"><span>{name} <i class="oa-symbol">{symbol}</i></span>'
        f'<div class="oa-track"><i class="{"oa-reached" if reached else ""}" style="width:{width:.0f}%"></i>'
        f'<u style="left:{at:.0f}%"></u></div><span class="oa-value">{show(value)} '
        f"<small>{'&ge;' if reached else '&lt;'} {show(limit)}</small></span></div>"
    )


def _facts(item: MapObject) -> str:
    rows = "".join(
        f"<tr><td>{wording.visit_word(sighting.session)}</td><td>{wording.size(sighting.extent_m)}</td>"
        f"<td>{_count(len(sighting.keyframes), 'keyframe')}</td>"
        f"<td>{_count(sighting.point_count, 'point')}</td></tr>"
        '<tr><td></td><td colspan="3" class="oa-muted">centre '
        f"{wording.place(sighting.centroid_world_m)}</td></tr>"
        for sighting in item.sightings
    )
    settled = (
        "not settled by any submap"
        if item.decided_in_submap is None
        else f"settled in submap {item.decided_in_submap + 1}"
    )
    turned = f" \u00b7 turned by {np.degrees(item.rotation_rad):.0f}\u00b0" if item.rotation_rad else ""
    return section("Seen", settled + turned) + f'<table class="oa-facts">{rows}</table>'


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
