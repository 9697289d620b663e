"""The Map tab: saved views, measured distances, and the box that the map is cut to."""

from __future__ import annotations

from collections.abc import Sequence

from oasisview.panels.journal import when
from oasisview.panels.markup import empty, key, section, sends
from oasisview.saved_views import SavedView
from oasisview.scene.cut import AXES, STEP_M, CutBox
from oasisview.scene.tape import Measurement
from oasisview.shell import escape

_AXIS_WORDS = {"x": "x", "y": "y", "height": "Height"}


def views_html(views: Sequence[SavedView]) -> str:
    """Saved views; a click flies there."""
    rows = "".join(
        f'<div class="oa-kept"><button {sends("fly_view", view.view_id)} title="Fly there">'
        f"<b>{escape(view.name)}</b><small>{escape(view.who)} \u00b7 {escape(when(view.at))}</small></button>"
        f'<button {sends("remove_view", view.view_id)} title="Remove" '
        f'aria-label="Remove {escape(view.name)}">\u00d7</button></div>'
        for view in views
    )
    none = empty("No views yet. Save what you see to find it again, with its camera, object and cut.")
    return (
        f'<div class="oa oa-tools">{section("Saved views")}{rows or none}'
        f'<button {sends("ask_view")} class="oa-wide">Save this view</button></div>'
    )


def tape_html(measurements: Sequence[Measurement], *, active: bool) -> str:
    """The distances of this tab."""
    rows = "".join(
        f'<div class="oa-kept"><span data-measured="{number}">{escape(measurement.words())}</span>'
        f'<button {sends("remove_distance", number)} title="Remove" '
        f'aria-label="Remove distance {number}">\u00d7</button></div>'
        for number, measurement in enumerate(measurements, start=1)
    )
    hint = "Click two points of the map. Esc takes the last step back." if active else ""
    clear = f"<button {sends('remove_distance', 0)}>Remove all</button>" if len(measurements) > 1 else ""
    word = "Stop measuring" if active else "Measure a distance"
    return (
        f'<div class="oa oa-tools">{section("Distances")}{rows}'
        f'<div class="oa-note">{hint}</div>'
        f'<div class="oa-pair"><button {sends("measure")} aria-pressed="{str(active).lower()}">{word} '
        f"{key('T')}</button>{clear}</div></div>"
    )


def cut_html(box: CutBox) -> str:
    """Two sliders for each axis, metres; height counts from the lowest part of the map."""
    rows = "".join(_axis(box, axis) for axis in reversed(range(3)))
    return (
        f'<div class="oa oa-tools">{section("Cut the map", "metres")}'
        '<div class="oa-note">Only what lies between the sliders is drawn.</div>'
        f"{rows}"
        f'<div class="oa-pair"><button {sends("cut_around")}>Around the object</button>'
        f"<button {sends('cut_reset')}>Show everything</button></div>"
        f'<div class="oa-note">{key("C")} switches the cut on and off.</div></div>'
    )


def _axis(box: CutBox, axis: int) -> str:
    name = AXES[axis]
    low, high = box.frame.low_m[axis], box.frame.high_m[axis]
    return (
        f'<div class="oa-cut"><span>{_AXIS_WORDS[name]}</span>'
        f"{_slider(f'{name}_low', 'from', box.low_m[axis], low, high)}"
        f"{_slider(f'{name}_high', 'to', box.high_m[axis], low, high)}</div>"
    )


def _slider(face: str, word: str, value: float, low: float, high: float) -> str:
    label = f"{_AXIS_WORDS[face.rpartition('_')[0]]} {word}, metres"
    return (
        f'<label><input type="range" min="{low:g}" max="{high:g}" step="{STEP_M}" value="{value:g}" '
        f'data-send="cut_{face}" aria-label="{label}" '
        'oninput="this.nextElementSibling.value=Number(this.value).toFixed(2)">'
        f"<output>{value:.2f}</output></label>"
    )


def tools_html(hint: str, *, cut: bool) -> str:
    """Below the switches over the map: what the tape waits for, and that the map is cut."""
    said = ""
    if hint:
        end = f"<small>{key('Esc')} back</small><button {sends('measure')}>Done</button>"
        said += _state("tape", "Measuring", hint, end)
    if cut:
        end = f"<button {sends('cut_reset')}>Show everything</button>"
        said += _state("cut", "Cut", "Parts of the map are not drawn.", end)
    return said


def _state(role: str, name: str, words: str, end: str) -> str:
    return (
        f'<div class="oa oa-tool-state" role="status" data-role="{role}"><b>{name}</b> '
        f"<span>{escape(words)}</span>{end}</div>"
    )
