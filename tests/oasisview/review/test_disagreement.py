from __future__ import annotations

import pytest

from oasisview.correction_words import disagreement_words
from oasisview.review import Journal, corrections
from oasisview.review.disagreement import Opinion
from pipeline.result import ChangeLabel, Result


@pytest.fixture
def journal(small_result: Result) -> Journal:
    return Journal.of(small_result)


def write(journal: Journal, correction, who: str) -> None:
    journal.correct(correction.kind, correction.object_id, correction.groups, who=who)


def said(journal: Journal, object_id: int) -> str:
    snapshot = journal.snapshot()
    return disagreement_words(snapshot.disagreements.get(object_id, ()), snapshot.corrected.machine)


def test_one_person_or_the_same_label_is_no_disagreement(journal: Journal) -> None:
    journal.decide(6, ChangeLabel.STATIC, who="ann")
    journal.decide(6, ChangeLabel.MOVED, who="ann")
    journal.decide(6, ChangeLabel.MOVED, who="ben")
    journal.note(6, "odd", who="cem")
    assert journal.snapshot().disagreements == {}


def test_different_labels_are_one_until_somebody_takes_theirs_back(journal: Journal) -> None:
    journal.accept(6, who="ann")
    journal.decide(6, ChangeLabel.MOVED, who="ben")
    assert set(journal.snapshot().disagreements) == {6}
    assert said(journal, 6) == (
        "Inspectors disagree: ann says appeared, ben says moved. The latest decision counts."
    )
    journal.undo("ben")
    assert said(journal, 6) == ""


def test_who_joins_what_another_labelled_alone_disagrees(journal: Journal) -> None:
    journal.decide(12, ChangeLabel.STATIC, who="ann")
    write(journal, corrections.merge(journal.corrected(), (6, 12)), "ben")
    assert set(journal.snapshot().disagreements) == {6}
    assert "ann says #12 is one object, static, ben says #6 and #12 are one object" in said(journal, 6)
    write(journal, corrections.drop(journal.corrected(), 6), "ann")
    (number,) = journal.snapshot().disagreements
    assert number == 6 and "ann says it is not an object" in said(journal, 6)


def test_a_merge_says_nothing_about_the_label(journal: Journal) -> None:
    write(journal, corrections.merge(journal.corrected(), (6, 12)), "ann")
    journal.decide(6, ChangeLabel.MOVED, who="ben")
    assert journal.snapshot().disagreements == {}
    write(journal, corrections.merge(journal.corrected(), (8, 9), ChangeLabel.STATIC), "ann")
    journal.decide(8, ChangeLabel.MOVED, who="ben")
    assert set(journal.snapshot().disagreements) == {8}


def test_opinions_contradict_each_other_both_ways(journal: Journal) -> None:
    members = journal.corrected().objects[6].members
    label = Opinion("ann", members, ChangeLabel.STATIC, True, 1)
    none = Opinion("ben", members, None, True, 2)
    dropped = Opinion("cem", members, None, False, 3)
    assert not label.contradicts(none) and not none.contradicts(label)
    assert label.contradicts(dropped) and dropped.contradicts(none) and not dropped.contradicts(dropped)


def test_a_restored_state_silences_what_it_takes_away(journal: Journal) -> None:
    journal.decide(6, ChangeLabel.STATIC, who="ann")
    journal.decide(6, ChangeLabel.MOVED, who="ben")
    journal.restore(1, who="cem")
    assert journal.snapshot().disagreements == {}
    assert journal.snapshot().undone == {2}
    journal.undo("cem")
    assert set(journal.snapshot().disagreements) == {6}
