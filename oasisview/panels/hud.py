"""What floats over the map: which visit, which colours, which layers; and the legend."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

from oasisview.panels.markup import chip, key, sends
from oasisview.panels.queue import LABEL_ORDER
from oasisview.shell import escape
from oasisview.wording import LABEL_NAMES

MODES: Mapping[str, str] = {"before": "Before", "after": "After", "both": "Both"}
COLOURS: Mapping[str, str] = {"label": "Change", "identity": "Identity", "true": "True colours"}


@dataclass(frozen=True)
class Layers:
    """What stands in the map besides the selected visits' points."""

    boxes: bool = True
    names: bool = True
    keyframes: bool = False
    path: bool = False
    ceiling: bool = False
    background: bool = True
    ghost: bool = False

    def switched(self, name: str, on: bool) -> Layers:
        """A copy with one layer switched; ``ValueError`` if there is none of that name."""
        if name not in LAYER_WORDS:
            raise ValueError(f"no layer is called {name!r}")
        return replace(self, **{name: on})


LAYER_WORDS: Mapping[str, str] = {
    "boxes": "Boxes of changed objects",
    "names": "Names of changed objects",
    "background": "Background points",
    "ceiling": "Ceiling",
    "ghost": "Ghost: objects of the other visit",
    "keyframes": "Keyframe cameras",
    "path": "Path of the robot",
}
assert set(LAYER_WORDS) == {field.name for field in fields(Layers)}


def hud_html(mode: str, colours: str, layers: Layers, *, dark: bool, measuring: bool = False) -> str:
    """Switches at the top left of the map."""
    visits = "".join(
        f'<button aria-pressed="{str(mode == m).lower()}" {sends("mode", m)} '
        f'title="{_mode_tip(m)}">{word}</button>'
        for m, word in MODES.items()
    )
    paints = "".join(
        f'<label><input type="radio" name="oa-colours" value="{c}" {"checked" if colours == c else ""} '
        f'data-send="colours">{word}</label>'
        for c, word in COLOURS.items()
    )
    switches = "".join(
        f'<label><input type="checkbox" {"checked" if getattr(layers, name) else ""} '
        f'data-send="layer" data-key="{name}">{word}</label>'
        for name, word in LAYER_WORDS.items()
    )
    theme, sign = ("Light page", "\u2600") if dark else ("Dark page", "\u263e")
    return (
        '<div class="oa oa-hud">'
        f'<span class="oa-segments" role="group" aria-label="Map of which visit">{visits}</span>'
        f'<button {sends("belief")} title="Look back at what was believed during the later visit">'
        "Over time</button>"
        f'<button {sends("overview")} title="See the whole site (H)">Overview</button>'
        f'<button {sends("measure")} aria-pressed="{str(measuring).lower()}" '
        'title="Measure a distance (T)">Measure</button>'
        '<details><summary title="What the map shows and how it is coloured">Layers</summary>'
        f'<div class="oa-popup"><b>Colour of objects</b>{paints}<b>Show</b>{switches}</div></details>'
        f'<button {sends("theme", not dark)} title="{theme}" aria-label="{theme}">{sign}</button>'
        f'<button data-open="help" title="Keys" aria-label="Keys">{key("?")}</button></div>'
    )


def _mode_tip(mode: str) -> str:
    return {
        "before": "Map of the earlier visit (B)",
        "after": "Map of the later visit (B)",
        "both": "Map of the later visit, with what is gone or moved as it was",
    }[mode]


def legend_html(colours: str, mode: str) -> str:
    """What the colours of the map mean."""
    if colours == "label":
        items = "".join(f"<span>{chip(label)}{LABEL_NAMES[label]}</span>" for label in LABEL_ORDER)
        items += f"<span>{chip('replaced')}replaced pair (dashed box)</span>"
        if mode == "both":
            items += '<span class="oa-muted">diamonds: as it was before</span>'
    elif colours == "identity":
        items = "<span>One colour per object, the same on both visits; grey is background</span>"
    else:
        items = "<span>Colours as recorded</span>"
    return f'<div class="oa oa-legend">{items}</div>'


def who_html(user: str, others: Sequence[tuple[str, int | None]], name: str) -> str:
    """Whose page this is, and who else is looking, at which object."""
    rest = ""
    if others:
        rest = f'<div class="oa-others">also here: {", ".join(_other(*other) for other in others)}</div>'
    return f'<div class="oa oa-who"><b>{escape(name)}</b> \u00b7 {escape(user)}{rest}</div>'


def _other(name: str, object_id: int | None) -> str:
    if object_id is None:
        return escape(name)
    tip = f'title="Look at what {escape(name)} looks at"'
    return f'{escape(name)} <button class="oa-at" {sends("select", object_id)} {tip}>#{object_id}</button>'
