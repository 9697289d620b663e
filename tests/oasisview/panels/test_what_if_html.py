from __future__ import annotations

import re
from dataclasses import replace

import pytest

from oasisview.assets import AssetTable
from oasisview.catalogue import Catalogue
from oasisview.panels.what_if import controls_html, outcome_html, unavailable_html
from oasisview.what_if_limits import Trial
from pipeline.change.relabel import Relabelled, what_if
from pipeline.result import Result
from pipeline.settings import Settings

OWN = Settings()


@pytest.fixture
def catalogue(small_result: Result) -> Catalogue:
    return Catalogue(small_result, AssetTable())


def outcome(catalogue: Catalogue, result: Result, trial: Trial, decided=(), applicable: int = 2) -> str:
    return outcome_html(catalogue, trial, what_if(result).under(trial.settings), decided, applicable, 0)


def sliders(html: str) -> list[str]:
    return re.findall(r'data-send="what_if_(\w+)" aria-label', html)


def test_each_rule_has_its_sliders_and_says_what_it_leaves_out() -> None:
    evidence = controls_html(Trial.of(OWN), can_change_rule=True)
    assert sliders(evidence) == ["change", "move", "nu_min", "tau_d", "tau_sigma", "tau_s"]
    assert "Decides no label under this rule" in evidence

    paper = controls_html(Trial.of(OWN).with_rule("paper"), can_change_rule=True)
    assert sliders(paper) == ["nu_min", "tau_d", "tau_sigma", "tau_s"]
    assert "Not used by this rule: place changed and moved here" in paper


def test_a_result_that_knows_one_rule_offers_no_other() -> None:
    own = OWN.override("change.rule", "paper")
    html = controls_html(Trial.of(own), can_change_rule=False)
    assert re.search(r"disabled>each place", html) and not re.search(r"disabled>matches alone", html)


def test_nothing_tried_says_so(catalogue: Catalogue) -> None:
    html = outcome_html(catalogue, Trial.of(OWN), Relabelled(({}, {}), ()), (), 0, 0)
    assert "These are the limits of this result." in html and "Apply" not in html


def test_what_would_change_is_counted_and_listed(catalogue: Catalogue, small_result: Result) -> None:
    html = outcome(catalogue, small_result, Trial.of(OWN).with_step("move", 95))

    assert "2 of 12 would change" in html and html.count('class="oa-flip"') == 2
    assert "moved \u2192 gone and new" in html and "2 objects would fall into two" in html
    assert "Apply to 2 objects" in html and 'data-object="4"' in html


def test_what_people_decided_is_marked_and_cannot_be_applied(
    catalogue: Catalogue, small_result: Result
) -> None:
    html = outcome(catalogue, small_result, Trial.of(OWN).with_step("move", 95), {4, 5}, applicable=0)

    assert html.count("(decided: kept)") == 4  # in the row and in its tip
    assert "2 objects of these were decided by people: kept." in html and "oa-apply" not in html


def test_limits_that_only_name_matches_change_no_label(catalogue: Catalogue, small_result: Result) -> None:
    trial = Trial.of(OWN).with_step("tau_s", 100)
    html = outcome_html(catalogue, trial, what_if(small_result).under(trial.settings), (), 0, 7)

    assert "No label would change" in html
    assert "7 objects would have their best match named otherwise." in html


def test_long_lists_end_and_strange_reasons_are_escaped(catalogue: Catalogue, small_result: Result) -> None:
    (flip, *_) = what_if(small_result).under(Trial.of(OWN).with_step("move", 95).settings).flips
    many = Relabelled(({}, {}), tuple(replace(flip, joins=9) for _ in range(230)))
    html = outcome_html(catalogue, Trial.of(OWN).with_step("move", 95), many, (), 0, 0)
    assert "30 more are not listed." in html and "one with #9" in html
    assert "<b>" not in unavailable_html("<b>damaged</b>")
