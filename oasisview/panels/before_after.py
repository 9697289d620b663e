"""Crops of an object on both visits with the patch matches between them, or one over the other."""

from __future__ import annotations

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import link_colour
from oasisview.object_views import BeforeAfter, ObjectView
from oasisview.panels.markup import key, picture, sends
from oasisview.shell import escape
from oasisview.wording import LABEL_NAMES
from pipeline.result import MapObject

# Widths of a crop and of the gap between the two, percent of the panel (panels.css has the same).
CROP_WIDTH, GAP_WIDTH = 47.5, 5.0


def before_after_html(catalogue: Catalogue, item: MapObject, *, swipe: bool) -> str:
    """The pictures; where a visit lacks the object, the same place is shown instead."""
    views = catalogue.before_after(item.object_id)
    head = (
        '<div class="oa-section"><span>Before and after</span>'
        f'<button {sends("swipe")} aria-pressed="{str(swipe).lower()}" title="One over the other">'
        f"swipe {key('X')}</button></div>"
    )
    if swipe:
        swiped = _registered(catalogue, item, views)
        if swiped:
            return head + swiped
    figures = _figure(item, 0, views.before) + _figure(item, 1, views.after)
    return head + f'<div class="oa-crops">{figures}{_lines(views)}</div>{_note(views)}'


def _registered(catalogue: Catalogue, item: MapObject, views: BeforeAfter) -> str:
    """One picture over the other from one viewpoint: that of the crop that shows the object itself."""
    shown = [view for view in (views.after, views.before) if view is not None]
    shown.sort(key=lambda view: view.place is not None)
    for view in shown:
        other = catalogue.same_viewpoint_url(view.session, view.keyframe, view.box)
        if other:
            before, after = (view.url, other) if view.session == 0 else (other, view.url)
            visit = wording.visit_word(view.session).lower()
            seen = f"seen from kf {view.keyframe + 1} of {visit}"
            line = f"oa-line oa-{LABEL_NAMES[item.label]}"
            outline = (
                '<svg viewBox="0 0 100 100" preserveAspectRatio="none">'
                f'<path d="{view.outline}" class="oa-halo"/><path d="{view.outline}" class="{line}"/></svg>'
            )
            pictures = swipe_html(before, after, seen)
            return f'<div class="oa-swipe">{pictures}{outline}</div>{_swipe_note(visit)}'
    return ""


def _swipe_note(visit: str) -> str:
    other = "before" if visit == "after" else "after"
    return (
        f'<div class="oa-note">The picture of {other} is drawn from the camera of {visit}, by depth and '
        "poses; hatched: no picture shows it.</div>"
    )


def swipe_html(before_url: str, after_url: str, seen: str) -> str:
    """Two pictures of one viewpoint with a slider between them; all sliders of a page move together."""
    return (
        f'<img class="oa-under" src="{escape(after_url)}" alt="After, {escape(seen)}" draggable="false">'
        f'<img class="oa-over" src="{escape(before_url)}" alt="Before, {escape(seen)}" draggable="false">'
        f'<span class="oa-caption">Before \u25c2 \u25b8 After \u00b7 {escape(seen)}</span>'
        '<input type="range" min="0" max="100" value="50" data-swipe aria-label="Before or after">'
    )


def _figure(item: MapObject, session: int, view: ObjectView | None) -> str:
    word = wording.visit_word(session)
    if view is None:
        return (
            f'<figure><div class="oa-none">{word}: no keyframe shows this place<br>'
            f"{wording.percent(item.coverage)} of it was looked at</div></figure>"
        )
    if view.place is not None:
        x, y, width, height = (f"{v:.1f}" for v in view.place)
        mark = f'<rect x="{x}" y="{y}" width="{width}" height="{height}" class="oa-place"/>'
        caption = f"{word}: same place \u00b7 kf {view.keyframe + 1}"
    else:
        line = f"oa-line oa-{LABEL_NAMES[item.label]}"
        mark = f'<path d="{view.outline}" class="oa-halo"/><path d="{view.outline}" class="{line}"/>'
        caption = f"{word} \u00b7 kf {view.keyframe + 1}"
    jump = sends("keyframe", {"session": session, "keyframe": view.keyframe})
    return (
        f'<figure {jump} title="Show keyframe {view.keyframe + 1} below the map">'
        f'{picture(view.url, caption)}<svg viewBox="0 0 100 100" preserveAspectRatio="none">{mark}</svg>'
        f'<span class="oa-caption">{caption}</span></figure>'
    )


def _lines(views: BeforeAfter) -> str:
    if not views.lines:
        return ""
    drawn = []
    for line in views.lines:
        x1, y1 = line.before[0] * CROP_WIDTH, line.before[1] * 100
        x2, y2 = CROP_WIDTH + GAP_WIDTH + line.after[0] * CROP_WIDTH, line.after[1] * 100
        kind = "oa-link" if line.lands_on_object else "oa-link oa-astray"
        ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
        drawn.append(f'<line class="oa-link-ground" {ends}/>')
        drawn.append(f'<line class="{kind}" style="--s:{link_colour(line.score)}" {ends}/>')
    return (
        '<svg class="oa-links" viewBox="0 0 100 100" preserveAspectRatio="none" role="img" '
        f'aria-label="{len(views.lines)} patch matches">{"".join(drawn)}</svg>'
    )


def _note(views: BeforeAfter) -> str:
    if views.before is None or views.after is None:
        return ""
    count, landing = len(views.lines), sum(line.lands_on_object for line in views.lines)
    if not views.compared:
        text = "These two keyframes were not compared patch by patch."
    elif count == 0:
        text = "No patch of the object finds a match in the other picture."
    elif count == 1:
        text = f"Its only patch match in view ends {'on the same object' if landing else 'elsewhere'}."
    elif landing == count:
        text = f"Its {count} strongest patch matches, all on the same object."
    elif landing:
        text = f"Its {count} strongest patch matches: {landing} on the same object, dashed ones elsewhere."
    else:
        text = f"Its {count} strongest patch matches (dashed) end on other things."
    return f'<div class="oa-note">{text}</div>'
