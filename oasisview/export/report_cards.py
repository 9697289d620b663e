"""One entry of the report for each change: pictures of both visits, why, the numbers, who decided."""

from __future__ import annotations

import base64
from functools import lru_cache

import numpy as np

from oasisview import wording
from oasisview.assets import Asset
from oasisview.export.exporter import ReviewedResult
from oasisview.export.report_marks import standalone
from oasisview.export.report_words import Change, count, decided, is_standing
from oasisview.object_views import ObjectView, ObjectViews
from oasisview.shell import escape
from oasisview.why import why
from oasisview.wording import Limits
from pipeline.result import ChangeLabel

CROP_QUALITY = 82


class ReportCards:
    """Writes the entries of a result; pictures are read when an entry is made."""

    def __init__(self, reviewed: ReviewedResult, changes: list[Change]) -> None:
        result = reviewed.result
        self._limits = Limits.of(result)
        self._notes_of = reviewed.notes_of
        self._machine_ids = lambda object_id: reviewed.corrected.objects[object_id].machine_ids
        self._number = {change.item.object_id: change.number for change in changes}
        self._taken_by = {
            e.disappeared_id: e.appeared_id for e in reviewed.replaced if is_standing(reviewed, e)
        }
        self._takes = {new: gone for gone, new in self._taken_by.items()}
        mask = lru_cache(maxsize=64)(lambda s, k: reviewed.object_mask(result.sessions[s], k))
        self._views = ObjectViews(result, mask, lambda _, make: _data_uri(make()), crop_quality=CROP_QUALITY)

    def card(self, change: Change) -> str:
        """The entry as HTML."""
        views = self._views.before_after(change.item.object_id)
        return (
            f'<article class="change c-{change.name}" id="change-{change.number}">'
            f"<div><h3>{standalone(change.name, str(change.number))}<span>{self._title(change)}</span>"
            f"<small>object #{change.item.object_id}</small></h3>"
            f'<p class="why">{escape(self._why(change))}</p>{self._facts(change)}</div>'
            f"{_figure(change, 0, views.before)}{_figure(change, 1, views.after)}</article>\n"
        )

    def row(self, change: Change) -> str:
        """The entry's line in the table of all changes."""
        last = change.item.sightings[-1] if change.item.sightings else None
        distance = change.item.displacement_m
        moved = wording.length(distance) if distance is not None and change.label is ChangeLabel.MOVED else ""
        checked = "" if change.final.decided_by is None else escape(change.final.decided_by)
        sign = standalone(change.name, str(change.number))
        return (
            f'<tr><td><a href="#change-{change.number}">{sign}</a></td>'
            f"<td>{change.name}{self._exchange(change)}</td><td>#{change.item.object_id}</td>"
            f"<td>{wording.size(last.extent_m) if last else ''}</td><td>{moved}</td>"
            f"<td>{wording.percent(change.item.confidence)}</td><td>{checked}</td></tr>\n"
        )

    def _title(self, change: Change) -> str:
        distance = change.item.displacement_m
        if change.label is ChangeLabel.MOVED and distance is not None:
            return f"Moved by {wording.length(distance)}"
        if change.item.object_id in self._taken_by and change.label is ChangeLabel.DISAPPEARED:
            return f"Gone{self._exchange(change)}"
        if change.item.object_id in self._takes and change.label is ChangeLabel.APPEARED:
            return f"New{self._exchange(change)}"
        return {
            ChangeLabel.MOVED: "Moved",
            ChangeLabel.APPEARED: "New",
            ChangeLabel.DISAPPEARED: "Gone",
        }.get(change.label, "Not decided")

    def _exchange(self, change: Change) -> str:
        """Which entry stands in its place now, or stood there before."""
        object_id = change.item.object_id
        if object_id in self._taken_by and change.label is ChangeLabel.DISAPPEARED:
            return f", replaced by no. {self._number[self._taken_by[object_id]]}"
        if object_id in self._takes and change.label is ChangeLabel.APPEARED:
            return f", replaces no. {self._number[self._takes[object_id]]}"
        return ""

    def _why(self, change: Change) -> str:
        machine = why(change.item, self._limits)
        if not change.final.overridden:
            return machine
        who = change.final.decided_by or ""
        if change.label is change.item.label:
            return f"{who} corrected what belongs to this object. What the machine went by: {machine}"
        said = wording.overridden(change.label, change.item.label, who)
        return f"{said} What the machine went by: {machine}"

    def _facts(self, change: Change) -> str:
        item = change.item
        rows: list[tuple[str, str]] = []
        if item.sightings:
            last = item.sightings[-1]
            rows.append(("size", wording.size(last.extent_m)))
            rows.append(("centre", wording.place(last.centroid_world_m)))
            if len(item.sightings) > 1 and change.label is ChangeLabel.MOVED:
                rows.append(("was at", wording.place(item.sightings[0].centroid_world_m)))
        if item.displacement_m is not None:
            rows.append(("displacement", wording.length(item.displacement_m)))
        if item.rotation_rad is not None and change.label is ChangeLabel.MOVED:
            rows.append(("turned by", f"{np.degrees(item.rotation_rad):.0f}\u00b0"))
        machine = wording.LABEL_NAMES[item.label]
        rows.append(("confidence", f"{wording.percent(item.confidence)} (machine: {machine})"))
        parts = self._machine_ids(item.object_id)
        if parts != (item.object_id,):
            rows.append(("made of", "the machine's " + ", ".join(f"#{part}" for part in parts)))
        rows.append(("decision", decided(change)))
        rows += [("note", f"{n.who}: {n.why}") for n in self._notes_of(item.object_id)]
        cells = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in rows)
        return f"<dl>{cells}</dl>"


def unchanged(reviewed: ReviewedResult) -> str:
    """The objects that are where they were, as one paragraph; empty if there are none."""
    same = [i.object_id for i in reviewed.objects if reviewed.final[i.object_id].label is ChangeLabel.STATIC]
    if not same:
        return ""
    ids = ", ".join(f"#{object_id}" for object_id in same)
    return (
        f"<section><h2>{standalone('static')}Not changed</h2>"
        f'<p class="small">{count(len(same), "object")}: {ids}.</p></section>\n'
    )


def _figure(change: Change, session: int, view: ObjectView | None) -> str:
    word = wording.visit_word(session)
    if view is None:
        share = wording.percent(change.item.coverage)
        return (
            f'<figure><div class="none">{word}: no picture shows this place '
            f"({share} of it was looked at)</div></figure>"
        )
    caption, mark = word, ""
    if view.place is not None:
        caption = f"{word}: the same place"
        x, y, width, height = (f"{v:.1f}" for v in view.place)
        mark = f'<rect x="{x}" y="{y}" width="{width}" height="{height}" class="place"/>'
    elif view.outline:
        mark = f'<path d="{view.outline}" class="halo"/><path d="{view.outline}" class="line"/>'
    return (
        f'<figure><div class="picture"><img src="{view.url}" alt="{caption}">'
        f'<svg viewBox="0 0 100 100" preserveAspectRatio="none" aria-hidden="true">{mark}</svg></div>'
        f"<figcaption>{caption}<small>keyframe {view.keyframe + 1}</small></figcaption></figure>"
    )


def _data_uri(asset: Asset | None) -> str:
    if asset is None:
        return ""
    return f"data:{asset.content_type};base64,{base64.b64encode(asset.data).decode()}"
