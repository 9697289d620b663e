"""Every sentence that says why, as it reads."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from oasisview.why import Rivals, rivals_of, why
from oasisview.wording import Limits
from pipeline.result import ChangeLabel as L
from pipeline.result import MapObject, MatchCase, Result
from pipeline.store import open_result
from pipeline.store.files import write_array

LIMITS = Limits(tau_sigma=0.3, tau_s=0.85, tau_d_m=0.1, nu_min=0.5)
MOTION = tuple(map(tuple, np.eye(4).tolist()))
MATCHED = {"sigma": 0.7, "s_bar": 0.93}
UNMATCHED = {"sigma": 0.0, "s_bar": 0.0, "case": MatchCase.NONE}

# What it is based on, what differs, its rivals, and what is said.
CASES = {
    "static, sure match": (
        1, {**MATCHED, "case": MatchCase.CONFIDENT, "displacement_m": 0.034}, None,
        "Same object, same place: 70% of its patches match, with quality 0.93, within 3 cm of where it was.",
    ),
    "static by its place": (
        3, {"sigma": 0.18, "s_bar": 0.93, "displacement_m": 0.004, "seen_through": 0.0}, None,
        "Same place, nothing changed there, within 1 cm of where it was: none of its volume was seen to be "
        "empty on the other visit. The match alone would not be enough (18% of its patches match, with "
        "quality 0.93).",
    ),
    "static by its place, without any match": (
        3, {**UNMATCHED, "displacement_m": 0.02, "seen_through": 0.04}, None,
        "Same place, nothing changed there, within 2 cm of where it was: only 4% of its volume was "
        "seen to be "
        "empty on the other visit. The match alone would not be enough (no patch of it finds a match there).",
    ),
    "static, made out on one visit": (
        12, {"label": L.STATIC, "seen_through": 0.0}, None,
        "Made out as an object on the later visit only, but its place did not change: none of its volume was "
        "seen to be empty on the other visit.",
    ),
    "moved, found again": (
        4, {**MATCHED, "T_world_motion": MOTION, "displacement_m": 2.89, "confidence": 0.72}, None,
        "Found again 2.89 m away: laid over what stands there, its shape, colours and pattern fit "
        "(72% sure); "
        "70% of its patches match, with quality 0.93.",
    ),
    "moved, found again where no patch could match, with a rival": (
        4, {**UNMATCHED, "T_world_motion": MOTION, "displacement_m": 2.99, "confidence": 0.66},
        Rivals(4, 122, 0.22, 0.41),
        "Found again 2.99 m away: laid over what stands there, its shape, colours and pattern fit "
        "(66% sure); "
        "patch by patch nothing links the two. Next best: object #122 (22% against 41% for this one).",
    ),
    "moved, found again by the marks on it": (
        4, {**UNMATCHED, "T_world_motion": MOTION, "displacement_m": 2.99, "confidence": 0.95},
        Rivals(marks=17),
        "Found again 2.99 m away: laid over what stands there, its shape, colours and pattern fit "
        "(95% sure); marks on its surface agree in 17 places; patch by patch nothing links the two.",
    ),
    "moved by matches": (
        4, {**MATCHED, "case": MatchCase.CONFIDENT, "displacement_m": 0.82}, None,
        "Same object, new place: 70% of its patches match, with quality 0.93, but it now stands 82 cm away "
        "(up to 10 cm counts as in place).",
    ),
    "moved by few matches": (
        4, {"sigma": 0.1, "s_bar": 0.9, "case": MatchCase.PARTIAL, "displacement_m": 0.82}, None,
        "Probably the same object in a new place, 82 cm away, but look twice: its patches alone do not show "
        "it (10% of its patches match, with quality 0.90).",
    ),
    "appeared, nothing alike": (
        6, {**UNMATCHED, "coverage": 0.84, "seen_through": 0.9}, None,
        "84% of its place was in view on the earlier visit, 90% of that was empty then, and nothing matched "
        "it.",
    ),
    "appeared, with a weak candidate and a move rival": (
        6, {"sigma": 0.2, "s_bar": 0.41, "coverage": 0.84, "seen_through": 0.9}, Rivals(12, 9, 0.24),
        "84% of its place was in view on the earlier visit, 90% of that was empty then, and nothing matched "
        "it well enough; closest is object #12 (20% of its patches, quality 0.41). Laid over other objects, "
        "it fits object #9 best (24% likely the same; 31% needed).",
    ),
    "disappeared, with a likely rival that was not taken": (
        9, {**UNMATCHED, "coverage": 1.0, "seen_through": 0.9}, Rivals(None, 71, 0.61),
        "100% of its place was in view on the later visit, 90% of that was empty by then, and nothing "
        "matched it. Laid over other objects, it fits object #71 best (61% likely the same, but it "
        "would hardly have moved, or others fit better).",
    ),
    "appeared where something looked other, in the place of another": (
        7, {"sigma": 0.2, "s_bar": 0.9, "coverage": 1.0, "seen_through": 0.02, "appearance_change": 0.59},
        Rivals(8),
        "100% of its place was in view on the earlier visit, it looked 59% different then, and nothing "
        "matched it well enough; closest is object #8 (20% of its patches, quality 0.90). It stands where "
        "object #8 was.",
    ),
    "disappeared, a look-alike stands elsewhere": (
        9, {"sigma": 0.77, "s_bar": 0.96, "coverage": 0.79, "seen_through": 0.72}, Rivals(87, 5, 0.01),
        "79% of its place was in view on the later visit, 72% of that was empty by then, and object #87, "
        "which looks like it (77% of its patches, quality 0.96), is not it.",
    ),
    "disappeared, replaced": (
        8, {**UNMATCHED, "coverage": 0.96, "seen_through": 0.9}, None,
        "96% of its place was in view on the later visit, 90% of that was empty by then, and nothing matched "
        "it. Object #7 stands there now.",
    ),
    "disappeared by matches alone": (
        9, {**UNMATCHED, "coverage": 0.7, "seen_through": 0.0, "appearance_change": None}, None,
        "70% of its place was in view on the later visit, and nothing matched it.",
    ),
    "unknown, never looked at": (
        10, {}, None,
        "Nobody looked at this place on the later visit: it may still be there, or not.",
    ),
    "unknown, looked at too little": (
        11, {"coverage": 0.31}, None,
        "Only 31% of this place was looked at on the earlier visit; 50% are needed. It may have been there "
        "already.",
    ),
    "unknown, seen in part": (
        3, {"label": L.UNKNOWN, "coverage": 0.9, "sigma": 0.2, "s_bar": 0.9, "case": MatchCase.PARTIAL}, None,
        "Not enough to decide. What matches is convincing (quality 0.90), but only 20% of its "
        "patches do; 30% "
        "are needed. It was probably seen only in part.",
    ),
    "unknown, a look-alike": (
        3, {"label": L.UNKNOWN, "coverage": 0.9, "sigma": 0.6, "s_bar": 0.7, "case": MatchCase.LOOKALIKE},
        None,
        "Not enough to decide. Something alike is there (60% of the patches match), but the quality "
        "of 0.70 is "
        "below 0.85, and its place is not clearly changed either.",
    ),
    "unknown, no match": (
        3, {"label": L.UNKNOWN, "coverage": 0.9, "seen_through": 0.2, **UNMATCHED}, None,
        "Not enough to decide: no patch of it finds a match there, and only 20% of its volume was seen to be "
        "empty on the other visit.",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_every_case_reads_so(small_result: Result, name: str) -> None:
    object_id, changes, rivals, sentence = CASES[name]
    item: MapObject = replace(small_result.object(object_id), **changes)
    assert why(item, LIMITS, rivals) == sentence


def test_every_label_with_every_case_is_a_finished_sentence(small_result: Result) -> None:
    for item in small_result.objects:
        for label in L:
            for case in MatchCase:
                text = why(replace(item, label=label, case=case), LIMITS, rivals_of(small_result, item))
                assert (text[0].isupper() or text[0].isdigit()) and text.endswith(".") and "None" not in text


def test_baseline_gets_no_reasons_that_are_not_its_own(small_result: Result) -> None:
    said = why(small_result.object(1), replace(LIMITS, method="conceptgraphs"))
    assert said.startswith("The baseline conceptgraphs says so.")
    assert Limits.of(small_result).method == "oasis"


def test_rivals_are_what_the_result_stores(small_result_path: Path) -> None:
    names = ("previous_object_id", "current_object_id", "log_odds")
    rows = [(4, 4, 1.5), (4, 12, -1.0), (9, 12, -2.0), (9, 6, -0.9)]
    kinds = list(zip(names, ("<i4", "<i4", "<f4"), strict=True))
    write_array(small_result_path / "moves.npy", np.array(rows, kinds))
    result = open_result(small_result_path)

    moved = rivals_of(result, result.object(4))
    assert (moved.match, moved.moved_to) == (4, 12)
    assert moved.moved_chance == pytest.approx(1 / (1 + np.e)) and moved.chosen_chance == pytest.approx(
        0.8176, abs=1e-3
    )
    gone = rivals_of(result, result.object(9))
    assert gone.moved_to == 6 and gone.chosen_chance is None
    assert gone.moved_chance == pytest.approx(0.289, abs=1e-3)
    assert rivals_of(result, result.object(12)).moved_to == 4
    assert rivals_of(result, result.object(8)).match == 7
    assert rivals_of(result, result.object(1)).moved_to is None


def test_marks_that_agree_are_counted_from_the_move(small_result_path: Path) -> None:
    kinds = [
        ("previous_object_id", "<i4"),
        ("current_object_id", "<i4"),
        ("log_odds", "<f4"),
        ("print", "<f4"),
    ]
    rows = [(4, 4, 1.5, np.log1p(16.8)), (4, 12, -1.0, np.log1p(90.0))]
    write_array(small_result_path / "moves.npy", np.array(rows, kinds))

    result = open_result(small_result_path)
    assert rivals_of(result, result.object(4)).marks == 17
    assert rivals_of(result, result.object(12)).marks == 0  # not what became of it


def test_what_people_corrected_has_no_rivals_of_the_machine(small_result: Result) -> None:
    item = small_result.object(4)
    torn = replace(item, sightings=item.sightings[:1])
    assert rivals_of(small_result, torn) == Rivals()
    assert rivals_of(small_result, replace(item, object_id=999)) == Rivals()
