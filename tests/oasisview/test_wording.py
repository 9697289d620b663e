from __future__ import annotations

from dataclasses import replace

import pytest

from oasisview import wording
from oasisview.wording import Limits
from pipeline.result import ChangeLabel, MatchCase, Result

LIMITS = Limits(tau_sigma=0.3, tau_s=0.85, tau_d_m=0.1, nu_min=0.5)


def test_limits_come_from_the_result(small_result: Result) -> None:
    limits = Limits.of(small_result)
    assert limits.tau_d_m == small_result.manifest["settings"]["change"]["tau_d_m"]
    assert limits.tau_sigma == pytest.approx(small_result.score_matrix.tau_sigma)


@pytest.mark.parametrize(
    ("object_id", "said"),
    [
        (1, "Same object, same place"),
        (3, "Same place, nothing changed there"),
        (4, "now stands 82 cm away (up to 10 cm counts as in place)"),
        (6, "Nothing on the earlier visit matches this object"),
        (7, "It stands where object #8 was."),
        (8, "Object #7 stands there now."),
        (10, "Nobody looked at this place on the later visit: it may still be there, or not."),
        (11, "Nobody looked at this place on the earlier visit: it may have been there already, or not."),
    ],
)
def test_why_in_plain_words(small_result: Result, object_id: int, said: str) -> None:
    assert said in wording.why(small_result.object(object_id), LIMITS)


def test_baseline_gets_no_reasons_that_are_not_its_own(small_result: Result) -> None:
    said = wording.why(small_result.object(1), replace(LIMITS, method="conceptgraphs"))
    assert said.startswith("The baseline conceptgraphs says so.")
    assert Limits.of(small_result).method == "oasis"


def test_why_unknown_names_what_is_missing(small_result: Result) -> None:
    item = replace(small_result.object(3), label=ChangeLabel.UNKNOWN, coverage=0.9, sigma=0.2, s_bar=0.9)
    assert "only 20% of its patches do; 30% are needed" in wording.why(item, LIMITS)
    seen_little = replace(item, coverage=0.31)
    assert "Only 31% of this place was looked at" in wording.why(seen_little, LIMITS)
    assert "50% are needed" in wording.why(seen_little, LIMITS)
    alike = replace(item, case=MatchCase.LOOKALIKE, sigma=0.6, s_bar=0.7)
    assert "quality of 0.70 is below 0.85" in wording.why(alike, LIMITS)


def test_every_sentence_is_finished(small_result: Result) -> None:
    for item in small_result.objects:
        for label in ChangeLabel:
            for case in MatchCase:
                text = wording.why(replace(item, label=label, case=case), LIMITS)
                assert text[0].isupper() and text.endswith(".") and "None" not in text


def test_queue_facts(small_result: Result) -> None:
    facts = {item.object_id: wording.queue_fact(item, item.label) for item in small_result.objects}
    assert facts[4] == "moved 82 cm" and facts[8] == "replaced by #7" and facts[7] == "replaces #8"
    assert facts[10] == "not decided" and facts[1] == "in place"
    assert wording.queue_fact(small_result.object(8), ChangeLabel.STATIC) == "in place"


@pytest.mark.parametrize(
    ("sigma", "s_bar", "partner", "said"),
    [
        (0.06, 0.9, None, "only 6% of the patches land here (30% needed)"),
        (0.4, 0.61, None, "match poorly (0.61, at least 0.85 needed)"),
        (0.4, 0.9, 20, "but #20 fits better"),
        (0.4, 0.9, None, "belongs to another object or place"),
    ],
)
def test_rejections_name_the_limit(sigma: float, s_bar: float, partner: int | None, said: str) -> None:
    assert said in wording.rejection(sigma, s_bar, LIMITS, partner_id=partner)


def test_numbers_for_people() -> None:
    assert wording.length(0.034) == "3 cm" and wording.length(3.2) == "3.20 m"
    assert wording.duration(59.4) == "59 s" and wording.duration(61) == "1 min 01 s"
    assert wording.size((0.1, 0.5, 0.3)) == "50 x 30 x 10 cm"
    assert wording.size((0.1, 1.5, 0.3)) == "1.50 x 0.30 x 0.10 m"
