from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from oasisview.what_if_limits import LIMIT_OF_KEY, LIMITS, Trial
from pipeline.settings import Settings

OWN = Settings()


def test_nothing_tried_is_the_own_settings_to_the_last_bit() -> None:
    assert Trial.of(OWN).settings == OWN
    assert Trial.of(OWN).differences == ()
    for limit in LIMITS:
        moved = Trial.of(OWN).with_step(limit.key, limit.low)
        back = moved.with_step(limit.key, limit.step_of(OWN))
        assert back.settings == OWN, limit.key


@pytest.mark.parametrize("limit", LIMITS, ids=lambda limit: limit.key)
@given(share=st.floats(0, 1))
def test_a_step_is_the_setting_it_stands_for(limit, share: float) -> None:
    step = round(limit.low + share * (limit.high - limit.low))
    settings = Trial.of(OWN).with_step(limit.key, step).settings

    assert limit.step_of(settings) == step
    assert limit.words(step)


def test_chances_are_log_odds_and_lengths_metres() -> None:
    trial = Trial.of(OWN).with_step("change", 88).with_step("tau_d", 150)

    assert trial.settings.change.min_log_odds == pytest.approx(math.log(0.88 / 0.12))
    assert trial.settings.change.tau_d_m == pytest.approx(1.5)
    assert trial.differences == (
        "place changed 88% instead of 50%",
        "displacement 1.50 m instead of 10 cm",
    )


def test_limits_that_a_rule_does_not_use_are_no_difference() -> None:
    trial = Trial.of(OWN).with_step("change", 88).with_rule("paper")

    assert trial.differences == ("decided by matches alone",)
    assert trial.settings.change.rule == "paper"


@pytest.mark.parametrize(("key", "step"), [("tau_s", 101), ("change", 4), ("tau_d", -1)])
def test_steps_beyond_the_slider_are_refused(key: str, step: int) -> None:
    with pytest.raises(ValueError, match=LIMIT_OF_KEY[key].key):
        Trial.of(OWN).with_step(key, step)
