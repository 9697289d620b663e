"""What a page finds again after a reload: tastes are kept in the browser, places in the page's address.

Both come back from a browser and are untrusted: what makes no sense is left out, never refused, so that a
stale memory cannot keep anybody from opening a result.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from oasisview.page import Choices
from oasisview.panels.hud import COLOURS, LAYER_WORDS, MODES
from oasisview.wording import LABEL_NAMES, LABEL_OF_NAME

_PLACE = re.compile(r"([12])\.([1-9]\d{0,6})", re.ASCII)


def tastes(choices: Choices) -> dict[str, Any]:
    """Theme, colours, layers and queue filter of a page, for the browser to keep."""
    return {
        "dark": choices.dark,
        "colours": choices.colours,
        "layers": {name: getattr(choices.layers, name) for name in LAYER_WORDS},
        "shown": sorted(LABEL_NAMES[label] for label in choices.shown),
    }


def recall_tastes(choices: Choices, kept: Mapping[str, Any]) -> None:
    """Set a page's choices to what its browser kept (:func:`tastes`)."""
    if isinstance(kept.get("dark"), bool):
        choices.dark = kept["dark"]
    colours = kept.get("colours")
    if isinstance(colours, str) and colours in COLOURS:
        choices.colours = colours
    layers = kept.get("layers")
    if isinstance(layers, Mapping):
        for name in LAYER_WORDS:
            if isinstance(layers.get(name), bool):
                choices.layers = choices.layers.switched(name, layers[name])
    shown = kept.get("shown")
    if isinstance(shown, list):
        choices.shown = frozenset(
            LABEL_OF_NAME[n] for n in shown if isinstance(n, str) and n in LABEL_OF_NAME
        )


def keyframe_address(session: int, keyframe: int) -> str:
    """A keyframe in the address, counted as people count: ``2.17`` is the 17th of the second visit."""
    return f"{session + 1}.{keyframe + 1}"


def recall_places(choices: Choices, address: Mapping[str, str], keyframe_counts: tuple[int, int]) -> None:
    """Set map and keyframe of a page to what its address asks for; what is not there is ignored."""
    mode = address.get("map")
    if mode is not None and mode in MODES:
        choices.mode = choices.wanted_mode = mode
    place = _PLACE.fullmatch(address.get("keyframe", ""))
    if place is not None:
        session, keyframe = int(place[1]) - 1, int(place[2]) - 1
        if keyframe < keyframe_counts[session]:
            choices.session, choices.keyframe = session, keyframe
