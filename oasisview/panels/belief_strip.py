"""Belief over time: a strip of labels for one object, and the slider that shows the whole map as it was."""

from __future__ import annotations

import json

from oasisview.belief import BeliefMoment, believed, moments
from oasisview.catalogue import Catalogue
from oasisview.panels.markup import GLYPHS, section, sends
from oasisview.shell import escape
from oasisview.wording import LABEL_NAMES
from pipeline.result import ChangeLabel, MapObject

NOT_MET_WORDS = "not met yet"


def strip_html(catalogue: Catalogue, item: MapObject, shown: int | None) -> str:
    """Label after each submap; a click shows the map of that moment. ``shown`` = the moment that it shows."""
    known = moments(catalogue)
    labels = believed(catalogue, item.object_id)
    if not known or not labels:
        return ""
    cells = "".join(
        _cell(number, moment, labels[moment.row], pressed=number == shown)
        for number, moment in enumerate(known)
    )
    return (
        section("Belief over time", course_words(known, labels))
        + f'<div class="oa-belief" role="group" aria-label="Belief over time">{cells}</div>'
    )


def course_words(known: tuple[BeliefMoment, ...], labels: tuple[ChangeLabel | None, ...]) -> str:
    """How the belief went: what it was at first, and from when it stayed as it is."""
    final = labels[known[-1].row]
    settled = len(known) - 1
    while settled > 0 and labels[known[settled - 1].row] is final:
        settled -= 1
    if settled == 0:
        return f"{_word(final)} from the start"
    return f"{_word(final)} from keyframe {known[settled].keyframe + 1} on"


def _cell(number: int, moment: BeliefMoment, label: ChangeLabel | None, *, pressed: bool) -> str:
    words = f"After keyframe {moment.keyframe + 1}: {_word(label)}"
    name = LABEL_NAMES[label] if label is not None else ""
    kind, sign = (f"oa-{name}", GLYPHS[name]) if label is not None else ("oa-unmet", "\u00b7")
    return (
        f'<button class="{kind}" aria-pressed="{str(pressed).lower()}" title="{escape(words)}. Click to see '
        f'the map of that moment." aria-label="{escape(words)}" {sends("belief_moment", number)}>'
        f"{sign}</button>"
    )


def _word(label: ChangeLabel | None) -> str:
    return NOT_MET_WORDS if label is None else LABEL_NAMES[label]


def slider_html(known: tuple[BeliefMoment, ...], shown: int, keyframe_count: int) -> str:
    """The bar over the map; -1 is before the first moment. Its words follow the hand without the server."""
    words = [
        "before anything was believed",
        *(f"as believed after keyframe {moment.keyframe + 1} of {keyframe_count}" for moment in known),
    ]
    return (
        '<div class="oa oa-preview" role="status"><b>Preview</b>'
        f"<output>{escape(words[shown + 1])}</output>"
        f'<input type="range" min="-1" max="{len(known) - 1}" value="{shown}" data-send="belief_moment" '
        f'aria-label="Moment of the later visit" data-texts="{escape(json.dumps(words))}" '
        "oninput=\"this.parentNode.querySelector('output').textContent="
        'JSON.parse(this.dataset.texts)[+this.value+1]">'
        f'<button {sends("end_preview")} title="Show what has been decided again">End</button></div>'
    )
