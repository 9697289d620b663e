"""What is recorded when a what-if is applied is what was shown."""

from __future__ import annotations

import pytest

from oasisview.review import Fragment, Group, Journal, Kind
from oasisview.what_if_groups import what_if_groups
from pipeline.change.relabel import Flip, Relabelled, what_if
from pipeline.result import ChangeLabel as L
from pipeline.result import Result
from pipeline.settings import Settings

SETTINGS = Settings()
TRIALS = [
    {"change.rule": "paper"},
    {"change.rule": "paper", "association.tau_sigma": 1.01},
    {"moves.min_log_odds": 9.0},
    {"change.min_log_odds": 7.0},
    {"change.nu_min": 0.99},
]


def trial(result: Result, changes: dict) -> Relabelled:
    settings = SETTINGS
    for name, value in changes.items():
        settings = settings.override(name, value)
    return what_if(result).under(settings)


@pytest.mark.parametrize("changes", TRIALS, ids=lambda changes: " ".join(map(str, changes.values())))
def test_after_applying_everything_counts_as_the_trial_showed(small_result: Result, changes: dict) -> None:
    relabelled = trial(small_result, changes)
    groups = what_if_groups(relabelled, ())
    assert groups
    with Journal.of(small_result) as journal:
        before = journal.final_labels()
        journal.correct(Kind.WHAT_IF, min(groups[0].members).object_id, groups, who="ann", why="tried")

        state = journal.corrected()
        for session, labels in enumerate(relabelled.by_visit):
            for object_id, label in labels.items():
                present = state.object_of[Fragment(object_id, session)]
                assert state.objects[present].final.label is label, (session, object_id)
        for row, column in relabelled.pairs:
            assert state.object_of[Fragment(row, 0)] == state.object_of[Fragment(column, 1)]

        assert len(journal.changes_since(0)) == 1
        journal.undo("ann")
        assert journal.final_labels() == before


def test_what_people_decided_stays_with_all_that_would_change_with_it(small_result: Result) -> None:
    relabelled = trial(small_result, {"moves.min_log_odds": 9.0})

    groups = what_if_groups(relabelled, {Fragment(4, 0)})

    assert {f.object_id for group in groups for f in group.members} == {5}


def test_a_chain_of_changed_identities_is_kept_as_a_whole() -> None:
    # 1 would fall into two, and its later half be one with 2; 3 has nothing to do with it.
    by_visit = {1: L.MOVED, 3: L.UNKNOWN}, {1: L.MOVED, 2: L.APPEARED}
    flips = (
        Flip(1, L.STATIC, (L.DISAPPEARED, L.MOVED), 2, parts=True),
        Flip(2, L.APPEARED, (L.MOVED,), 1, parts=False),
        Flip(3, L.DISAPPEARED, (L.UNKNOWN,), None, parts=False),
    )
    relabelled = Relabelled(by_visit, flips, frozenset({(3, 1)}))

    whole = what_if_groups(relabelled, ())
    assert Group(frozenset({Fragment(3, 0), Fragment(1, 1)}), L.UNKNOWN) in whole
    assert {f for group in whole for f in group.members} == {
        Fragment(1, 0), Fragment(1, 1), Fragment(2, 1), Fragment(3, 0)
    }  # fmt: skip
    left = what_if_groups(relabelled, {Fragment(3, 0)})
    assert [sorted(group.members) for group in left] == [[Fragment(2, 1)]]
