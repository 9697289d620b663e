"""Whom an object was compared with: its part of the score matrix, the partner and the rejected rivals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import share_colour
from oasisview.panels.markup import chip, picture, section, sends
from oasisview.shell import escape
from pipeline.result import MapObject

SHOWN = 7
SHOWN_RIVALS = 2


@dataclass(frozen=True)
class Candidate:
    """An object of the other visit that might be the counterpart.

    Attributes:
        object_id: who.
        sigma: share of the selected object's patches that land on it; s_bar: quality of these matches.
        chosen: whether it is the partner.
    """

    object_id: int
    sigma: float
    s_bar: float
    chosen: bool


def candidates(catalogue: Catalogue, item: MapObject, limit: int = SHOWN) -> list[Candidate]:
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
        if others[index] == 0:  # people said that it is no object
            continue
        chosen = int(others[index]) == item.object_id
        if sigma[index] > 0 or chosen:
            found.append(Candidate(int(others[index]), float(sigma[index]), float(s_bar[index]), chosen))
    top = found[:limit]
    # The partner is always shown, however low it ranks.
    partner = next((c for c in found if c.chosen), None)
    return top if partner is None or partner in top else [*top[: limit - 1], partner]


def candidates_html(catalogue: Catalogue, item: MapObject) -> str:
    """Two heat rows, the partner framed, then the best rivals with the reason against each."""
    found = candidates(catalogue, item)
    before = item.sighting(0) is not None
    head = section("Candidates", f"{'row' if before else 'column'} of the score matrix")
    if not found:
        return head + '<div class="oa-note">None of its patches match an object of the other visit.</div>'
    other_session = 1 if before else 0
    partner = next((c for c in found if c.chosen), None)
    note = "Framed: the same object on the other visit." if partner is not None else "None was chosen."
    rivals = [c for c in found if not c.chosen][:SHOWN_RIVALS]
    rejected = section("Rejected") + "".join(
        _rival(catalogue, rival, partner, other_session) for rival in rivals
    )
    table = _table(catalogue, found, other_session)
    return head + table + f'<div class="oa-note">{note}</div>' + (rejected if rivals else "")


def replaced_html(catalogue: Catalogue, item: MapObject) -> str:
    """The other object of a *replaced* event, to click on; empty without one."""
    other = item.replaced_by if item.replaced_by is not None else item.replaces
    if other is None or other not in catalogue.objects:
        return ""
    text = "replaced by" if item.replaced_by is not None else "stands in the place of"
    pair = {item.object_id, other}
    event = next((e for e in catalogue.result.replaced if {e.disappeared_id, e.appeared_id} == pair), None)
    share = f"their bounds overlap by {wording.percent(event.overlap)}" if event is not None else ""
    return (
        f'<div class="oa-replaced" role="button" tabindex="0" {sends("select", other)}>'
        f"{chip('replaced')}{picture(catalogue.thumbnail_url(other), wording.object_name(other))}"
        f"<span>{text} <b>object #{other}</b><small>{share}</small></span></div>"
    )


def _table(catalogue: Catalogue, found: list[Candidate], session: int) -> str:
    pictures: list[str] = []
    numbers: list[str] = []
    sigma: list[str] = []
    quality: list[str] = []
    for candidate in found:
        frame = " oa-chosen" if candidate.chosen else ""
        name = wording.object_name(candidate.object_id)
        send = sends("select", candidate.object_id)
        tile = picture(catalogue.thumbnail_url(candidate.object_id, session), name)
        words = (
            f"{name}: {_case(catalogue, candidate)}; \u03c3 {candidate.sigma:.2f}, "
            f"quality {candidate.s_bar:.2f}. Click to select it."
        )
        tip = f'title="{escape(words)}"'
        pictures.append(
            f'<td><button class="oa-bare" {send} {tip} aria-label="{escape(words)}">{tile}</button></td>'
        )
        numbers.append(f'<th scope="col">{candidate.object_id}</th>')
        for row, value in ((sigma, candidate.sigma), (quality, candidate.s_bar)):
            ground, ink = share_colour(value)
            colours = f"background:{ground};color:{ink}"
            row.append(
                f'<td><button class="oa-cell{frame}" {send} {tip} aria-label="{escape(words)}" '
                f'style="{colours}">{value:.2f}</button></td>'
            )
    return (
        '<table class="oa-heat">'
        f"<tr><th></th>{''.join(pictures)}</tr><tr><th>#</th>{''.join(numbers)}</tr>"
        f'<tr><th title="share of matching patches">\u03c3</th>{"".join(sigma)}</tr>'
        f'<tr><th title="quality of these matches">s\u0304</th>{"".join(quality)}</tr></table>'
    )


def _case(catalogue: Catalogue, candidate: Candidate) -> str:
    if candidate.chosen:
        return "chosen, the same object on the other visit"
    return wording.CASE_WORDS[wording.pair_case(candidate.sigma, candidate.s_bar, catalogue.limits)]


def _rival(catalogue: Catalogue, rival: Candidate, partner: Candidate | None, session: int) -> str:
    reason = wording.rejection(
        rival.sigma,
        rival.s_bar,
        catalogue.limits,
        partner_id=partner.object_id if partner is not None else None,
        partner_sigma=partner.sigma if partner is not None else 1.0,
    )
    name = wording.object_name(rival.object_id)
    return (
        f'<div class="oa-rival" role="button" tabindex="0" {sends("select", rival.object_id)}>'
        f"{picture(catalogue.thumbnail_url(rival.object_id, session), name)}"
        f"<span>{name}<small>{escape(reason)}</small></span></div>"
    )
