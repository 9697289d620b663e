"""The band under the map: one keyframe, its counterpart of the other visit, and what differs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from oasisview import crops, wording
from oasisview.catalogue import Catalogue
from oasisview.heatmap_colours import CIVIDIS, GEOMETRIC_RANGE_M, geometric_anchors, gradient_css
from oasisview.panels.before_after import swipe_html
from oasisview.panels.markup import empty, key, sends
from oasisview.panels.patch_overlay import PatchOverlay, patch_overlay
from oasisview.patch_links import PatchPick
from oasisview.shell import escape
from oasisview.wording import LABEL_NAMES
from pipeline.result import ChangeLabel

PREVIOUS_SIGN, NEXT_SIGN = "\u25c0", "\u25b6"
LabelOf = Callable[[int], ChangeLabel]


def band_html(
    catalogue: Catalogue,
    session: int,
    keyframe: int,
    selected: int | None,
    label_of: LabelOf,
    *,
    dark: bool,
    pick: PatchPick | None = None,
    with_links: bool = False,
    swipe: bool = False,
) -> str:
    """The band for a keyframe of a visit; what changes while scrubbing carries ``data-part``.

    ``pick`` is a patch whose match is shown; ``with_links`` shows the matches of the selected object;
    ``swipe`` lays the other visit over the keyframe, from its own viewpoint.
    """
    visit = catalogue.session(session)
    if not visit.keyframes:
        return f'<div class="oa-band">{empty(f"{visit.name} holds no keyframe.")}</div>'
    pair = catalogue.covisible(session, keyframe)
    other = 1 - session
    record = visit.keyframes[keyframe]
    this_word, other_word = wording.visit_word(session), wording.visit_word(other)
    overlay = None
    if pair is not None:
        shown = (keyframe, pair.other_keyframe) if session == 0 else (pair.other_keyframe, keyframe)
        overlay = patch_overlay(catalogue, shown, pick, selected if with_links else None)
    note = f"kf {keyframe + 1}"
    same = catalogue.same_viewpoint_url(session, keyframe) if swipe else ""
    pictures = [
        _image(catalogue, "this", this_word, note, session, keyframe, selected, label_of, overlay, same)
    ]
    if pair is None:
        nothing = f'<div class="oa-pic">{empty(wording.NO_SHARED_VIEW)}</div>'
        titles = {"other": other_word, "semantic": "Looks different", "geometric": "Shape different"}
        pictures += [_figure(part, title, "", nothing, "") for part, title in titles.items()]
    else:
        note = f"kf {pair.other_keyframe + 1} \u00b7 {wording.percent(pair.shared)} shared"
        pictures.append(
            _image(
                catalogue, "other", other_word, note, other, pair.other_keyframe, selected, label_of, overlay
            )
        )
        pictures.append(_heatmap(catalogue, "semantic", session, keyframe, selected, label_of, dark=dark))
        pictures.append(_heatmap(catalogue, "geometric", session, keyframe, selected, label_of, dark=dark))
    title = f"frame {record.frame_index} of the recording, submap {record.submap + 1}"
    return (
        f'<div class="oa-band" data-session="{session}" data-keyframe="{keyframe}">'
        f"{_scrubber(catalogue, session, keyframe, selected, title, with_links=with_links, swipe=swipe)}"
        f'<div class="oa-pictures">{"".join(pictures)}</div></div>'
    )


def _scrubber(
    catalogue: Catalogue,
    session: int,
    keyframe: int,
    selected: int | None,
    title: str,
    *,
    with_links: bool,
    swipe: bool,
) -> str:
    count = len(catalogue.session(session).keyframes)
    switch = "".join(
        f'<button aria-pressed="{str(session == s).lower()}" {sends("visit", s)} '
        f'title="Step through {escape(catalogue.session(s).name)}">{wording.visit_word(s)}</button>'
        for s in (0, 1)
    )
    best_tip = "The keyframe that shows the selected object best"
    return (
        '<div class="oa-scrub">'
        f'<span class="oa-segments" data-part="visit" role="group" aria-label="Visit">{switch}</span>'
        f"{_step(-1, 'Previous keyframe', 'P', PREVIOUS_SIGN)}"
        f'<label class="oa-jump" title="Type a number to jump there">'
        f'<input type="number" min="1" max="{count}" value="{keyframe + 1}" data-part="jump" '
        'data-send="jump" aria-label="Keyframe number"></label>'
        f'<span class="oa-muted" data-part="count" title="{escape(title)}">/ {count}</span>'
        f'<span class="oa-slider">{_ticks(catalogue, session, count, selected)}'
        f'<input type="range" min="0" max="{max(count - 1, 0)}" value="{keyframe}" data-part="slider" '
        'data-send="scrub" aria-label="Keyframe"></span>'
        f"{_step(1, 'Next keyframe', 'N', NEXT_SIGN)}"
        f'<span data-part="step" class="oa-steps"><button {sends("swipe")} '
        f'aria-pressed="{str(swipe).lower()}" title="One visit over the other, from one viewpoint (X)">'
        "swipe</button>"
        f"<button {sends('links')} "
        f'aria-pressed="{str(with_links).lower()}" title="Draw where the selected object\'s patches match">'
        f'links</button><button {sends("best_view")} title="{best_tip}" '
        f"{'' if selected is not None else 'disabled'}>best view</button>"
        f'<button {sends("fly_keyframe")} title="Move the camera of the map to this keyframe (V)">'
        f"go there {key('V')}</button></span></div>"
    )


def _step(by: int, name: str, hotkey: str, sign: str) -> str:
    send = sends("step_keyframe", by)
    return f'<button {send} title="{name} ({hotkey})" aria-label="{name}">{sign}</button>'


def _ticks(catalogue: Catalogue, session: int, count: int, selected: int | None) -> str:
    """Marks above the slider where the selected object is seen."""
    item = catalogue.objects.get(selected) if selected is not None else None
    sighting = item.sighting(session) if item is not None else None
    marks = ""
    if sighting is not None and count > 1:
        marks = "".join(
            f'<rect x="{100 * k / (count - 1) - 0.4:.2f}" y="0" width="0.8" height="4"/>'
            for k in sighting.keyframes
        )
    return (
        '<svg class="oa-ticks" data-part="ticks" viewBox="0 0 100 4" preserveAspectRatio="none" '
        f'aria-hidden="true">{marks}</svg>'
    )


def _image(
    catalogue: Catalogue,
    part: str,
    title: str,
    note: str,
    session: int,
    keyframe: int,
    selected: int | None,
    label_of: LabelOf,
    overlay: PatchOverlay | None,
    same_viewpoint: str = "",
) -> str:
    url = catalogue.image_url(session, keyframe)
    pictures = f'<img src="{escape(url)}" alt="{escape(title)}, {escape(note)}" draggable="false">'
    if same_viewpoint:
        before, after = (url, same_viewpoint) if session == 0 else (same_viewpoint, url)
        pictures = swipe_html(before, after, note)
    body = _clickable(
        pictures
        + _overlay(catalogue, session, keyframe, selected, label_of)
        + (overlay.marks(session) if overlay is not None else ""),
        session,
        keyframe,
        catalogue,
    )
    if overlay is not None and part == "other":
        body = f'<div class="oa-told">{body}{overlay.words()}</div>'
    return _figure(part, title, note, body, "")


def _heatmap(
    catalogue: Catalogue,
    kind: str,
    session: int,
    keyframe: int,
    selected: int | None,
    label_of: LabelOf,
    *,
    dark: bool,
) -> str:
    url = catalogue.heatmap_url(kind, session, keyframe, dark=dark)
    title = "Looks different" if kind == "semantic" else "Shape different"
    body = _clickable(
        f'<img src="{escape(url)}" alt="{title}" draggable="false">'
        + _overlay(catalogue, session, keyframe, selected, label_of),
        session,
        keyframe,
        catalogue,
    )
    if kind == "semantic":
        bar = _colour_bar("same 0", "1 changed", gradient_css(CIVIDIS))
        note = "semantic"
    else:
        reach = f"{GEOMETRIC_RANGE_M:.1f} m"
        bar = _colour_bar(f"gone \u2212{reach}", f"+{reach} new", gradient_css(geometric_anchors(dark=dark)))
        note = "geometric"
    return _figure(kind, title, note, body, bar)


CAPTION_TIPS = {
    "this": "The keyframe chosen above (kf); click an object in it to select it",
    "other": "The keyframe (kf) of the other visit that sees most of the same surfaces, and how much of them",
    "semantic": "How unlike every patch looks to its best match on the other visit: bright has changed",
    "geometric": "Depth against the surface of the other visit, seen from here: orange is new in front, "
    "purple is gone",
}


def _figure(part: str, title: str, note: str, body: str, bar: str) -> str:
    tip = escape(CAPTION_TIPS.get(part, title))
    return (
        f'<figure data-part="{part}"><figcaption title="{tip}"><b>{escape(title)}</b>'
        f"<small>{escape(note)}</small></figcaption>{body}{bar}</figure>"
    )


def _clickable(content: str, session: int, keyframe: int, catalogue: Catalogue) -> str:
    camera = catalogue.session(session).keyframes[keyframe].camera
    return (
        f'<div class="oa-pic" data-pixel="pixel" data-session="{session}" data-keyframe="{keyframe}" '
        f'style="--aspect:{camera.width}/{camera.height}"><div class="oa-frame">{content}</div></div>'
    )


def _overlay(
    catalogue: Catalogue, session: int, keyframe: int, selected: int | None, label_of: LabelOf
) -> str:
    """Boxes with names for the pointer, and the outline of the selected object."""
    mask = catalogue.mask(session, keyframe)
    height, width = mask.shape
    boxes = []
    for object_id, area in enumerate(ndimage.find_objects(mask.astype(np.int32)), start=1):
        if area is None or object_id not in catalogue.objects:
            continue
        rows, columns = area
        x, y = 100 * columns.start / width, 100 * rows.start / height
        w, h = 100 * (columns.stop - columns.start) / width, 100 * (rows.stop - rows.start) / height
        name = f"{wording.object_name(object_id)}: {LABEL_NAMES[label_of(object_id)]}"
        place = f'x="{x:.1f}" y="{y:.1f}" width="{w:.1f}" height="{h:.1f}"'
        boxes.append((w * h, f"<rect {place}><title>{name}</title></rect>"))
    # Biggest first, so that the small ones on top answer the pointer.
    marks = "".join(box for _, box in sorted(boxes, key=lambda entry: -entry[0]))
    if selected is not None:
        path = crops.outline_path(mask == selected)
        if path:
            label = LABEL_NAMES[label_of(selected)]
            marks += f'<path class="oa-halo" d="{path}"/><path class="oa-line oa-{label}" d="{path}"/>'
    return f'<svg viewBox="0 0 100 100" preserveAspectRatio="none">{marks}</svg>'


def _colour_bar(low: str, high: str, gradient: str) -> str:
    tip = "not seen by both visits"
    return (
        f'<div class="oa-colours"><span>{low}</span><i style="background:{gradient}"></i><span>{high}</span>'
        f'<i class="oa-hatch" title="{tip}"></i><span title="{tip}">unseen</span></div>'
    )
