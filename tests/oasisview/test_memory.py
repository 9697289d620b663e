from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview.memory import keyframe_address, recall_places, recall_tastes, tastes
from oasisview.page import Choices
from oasisview.panels.hud import COLOURS, LAYER_WORDS, Layers
from pipeline.result import ChangeLabel

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
)


@given(
    dark=st.booleans(),
    colours=st.sampled_from(sorted(COLOURS)),
    layers=st.fixed_dictionaries({name: st.booleans() for name in LAYER_WORDS}),
    shown=st.frozensets(st.sampled_from(ChangeLabel)),
)
def test_tastes_come_back_as_they_were(dark, colours, layers, shown) -> None:
    liked = Choices(dark=dark, colours=colours, layers=Layers(**layers), shown=shown)
    fresh = Choices()
    recall_tastes(fresh, json.loads(json.dumps(tastes(liked))))
    assert fresh == liked


@given(st.fixed_dictionaries({}, optional={k: JSON for k in ("dark", "colours", "layers", "shown", "other")}))
def test_nonsense_in_the_browser_never_hurts(kept) -> None:
    choices = Choices()
    recall_tastes(choices, kept)
    assert isinstance(choices.dark, bool) and choices.colours in COLOURS
    assert all(isinstance(getattr(choices.layers, name), bool) for name in LAYER_WORDS)
    assert choices.shown <= frozenset(ChangeLabel)


def test_places_of_the_address_are_found_again() -> None:
    choices = Choices()
    recall_places(choices, {"keyframe": keyframe_address(0, 16), "map": "both"}, (17, 3))
    assert (choices.session, choices.keyframe) == (0, 16)
    assert (choices.mode, choices.wanted_mode) == ("both", "both")


@pytest.mark.parametrize("asked", ["2.4", "3.1", "0.1", "1.0", "1.-1", "", "1.1.1", "x", "\u0661.\u0661"])
def test_keyframes_that_are_not_there_are_ignored(asked: str) -> None:
    choices = Choices()
    recall_places(choices, {"keyframe": asked, "map": "sideways"}, (17, 3))
    assert (choices.session, choices.keyframe, choices.mode) == (1, 0, "after")
