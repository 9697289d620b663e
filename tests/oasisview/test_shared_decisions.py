from __future__ import annotations

from collections.abc import Iterator

import pytest

from oasisview.decisions import SharedDecisions
from oasisview.review import ConflictError, Journal
from pipeline.result import ChangeLabel, Result


@pytest.fixture
def decisions(small_result: Result) -> Iterator[SharedDecisions]:
    shared = SharedDecisions(small_result)
    yield shared
    shared.close()


def test_listeners_hear_of_a_decision_after_it_is_on_disk(
    decisions: SharedDecisions, small_result: Result
) -> None:
    heard: list[tuple[frozenset[int], ChangeLabel]] = []

    def listen(changed: frozenset[int]) -> None:
        with Journal.of(small_result) as on_disk:
            heard.append((changed, on_disk.final_labels()[12].label))

    decisions.subscribe(listen)
    decisions.decide(12, ChangeLabel.STATIC, who="ann", reason="was there", seen_event_id=None)
    assert heard == [(frozenset({12}), ChangeLabel.STATIC)]
    verdict = decisions.verdicts[12]
    assert (verdict.label, verdict.accepted, verdict.who, verdict.reason) == (
        ChangeLabel.STATIC, False, "ann", "was there",
    )  # fmt: skip
    assert decisions.label_of(12) is ChangeLabel.STATIC and decisions.label_of(6) is ChangeLabel.APPEARED
    decisions.unsubscribe(listen)
    decisions.undo("ann")
    assert len(heard) == 1 and 12 not in decisions.verdicts
    assert decisions.can_redo("ann") and not decisions.can_undo("ann")
    decisions.redo("ann")
    assert decisions.verdicts[12].label is ChangeLabel.STATIC


def test_the_machines_label_counts_as_accepted(decisions: SharedDecisions) -> None:
    decisions.decide(12, ChangeLabel.APPEARED, who="ann", reason="", seen_event_id=None)
    assert decisions.verdicts[12].accepted
    assert decisions.history()[-1].kind.value == "accept"


def test_another_process_is_followed(decisions: SharedDecisions, small_result: Result) -> None:
    heard: list[frozenset[int]] = []
    decisions.subscribe(heard.append)
    with Journal.of(small_result) as elsewhere:
        elsewhere.decide(6, ChangeLabel.MOVED, who="bob")
    assert decisions.refresh() == frozenset({6}) or heard == [frozenset({6})]
    assert decisions.label_of(6) is ChangeLabel.MOVED
    assert decisions.refresh() == frozenset()


def test_a_decision_on_an_old_view_is_a_conflict_and_disagreement_is_told(decisions: SharedDecisions) -> None:
    seen = decisions.last_event_id
    decisions.decide(6, ChangeLabel.MOVED, who="bob", reason="", seen_event_id=seen)
    with pytest.raises(ConflictError, match="bob set object 6 to moved"):
        decisions.decide(6, ChangeLabel.STATIC, who="ann", reason="", seen_event_id=seen)
    assert decisions.label_of(6) is ChangeLabel.MOVED and decisions.disagreement(6) == ""
    decisions.decide(6, ChangeLabel.STATIC, who="ann", reason="", seen_event_id=decisions.last_event_id)
    assert decisions.disagreement(6) == (
        "Inspectors disagree: bob says moved, ann says static. The latest decision counts."
    )
    decisions.undo("ann")
    assert decisions.disagreement(6) == ""


def test_a_listener_that_fails_does_not_keep_others_from_hearing(decisions: SharedDecisions) -> None:
    heard: list[frozenset[int]] = []

    def fails(changed: frozenset[int]) -> None:
        raise RuntimeError("page is gone")

    decisions.subscribe(fails)
    decisions.subscribe(heard.append)
    decisions.note(6, "look at the lid", who="ann")
    assert heard == [frozenset({6})]
