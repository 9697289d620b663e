from __future__ import annotations

import pytest

from oasisview.correction_words import event_words, parts, restore_words, will_happen
from oasisview.review import CorrectedMap, Fragment, Journal, Kind, corrections
from oasisview.review.corrections import Correction
from pipeline.result import ChangeLabel, Result


@pytest.fixture
def journal(small_result: Result) -> Journal:
    return Journal.of(small_result)


def words(journal: Journal) -> list[str]:
    events = journal.changes_since(0)
    machine = journal.corrected().machine
    return [event_words(e, machine, events[e.target_id - 1] if e.target_id else None) for e in events]


def write(journal: Journal, correction: Correction) -> None:
    journal.correct(correction.kind, correction.object_id, correction.groups, who="ann")


def preview(journal: Journal, make) -> str:
    before: CorrectedMap = journal.corrected()
    made = make(before)
    return will_happen(made, before, journal.preview(made.kind, made.object_id, made.groups))


def test_every_kind_of_entry_is_said_in_words(journal: Journal) -> None:
    write(journal, corrections.same(journal.corrected(), 8, 7))
    journal.undo("ann")
    journal.redo("ann")
    write(journal, corrections.split_visits(journal.corrected(), 4))
    write(journal, corrections.drop(journal.corrected(), 16))
    write(journal, corrections.keep(journal.corrected(), 16))
    write(journal, corrections.merge(journal.corrected(), (6, 12)))
    journal.decide(6, ChangeLabel.MOVED, who="ann")
    journal.undo("ann")
    journal.accept(9, who="ann")
    journal.note(9, "look", who="ann")
    journal.restore(1, who="ann")
    journal.restore(0, who="ann")
    assert words(journal) == [
        "#7 now and #8 before are the same object: static",
        "undone: #7 now and #8 before are the same object: static",
        "redone: #7 now and #8 before are the same object: static",
        "not one object but 2: #4 before (disappeared) and #4 now (appeared)",
        "not an object: #4 now",
        "an object after all: #4 now (appeared)",
        "#6 and #12 are pieces of one object: appeared",
        "appeared \u2192 moved",
        "undone, appeared again",
        "accepted as disappeared",
        "note",
        "back to how it was after entry 1",
        "back to what the machine found",
    ]
    kinds = {event.kind for event in journal.changes_since(0)}
    assert kinds == set(Kind) - {Kind.WHAT_IF}


def test_the_sentence_before_a_correction_says_dependents_too(journal: Journal) -> None:
    same = preview(journal, lambda s: corrections.same(s, 9, 5))
    assert same == (
        "#5 now and #9 before become one object, #9: moved, 1.77 m away (up to 10 cm counts as in place). "
        "What else was taken for it becomes #5: disappeared."
    )
    dropped = preview(journal, lambda s: corrections.drop(s, 7))
    assert dropped.endswith(" #8 no longer counts as replaced by #7.")
    merged = preview(journal, lambda s: corrections.merge(s, (6, 7)))
    assert "Objects #6 and #7 become one object, #6: appeared." in merged
    assert "#8 now counts as replaced by #6." in merged
    assert journal.last_event_id == 0


def test_parts_say_the_visit_only_where_it_matters(journal: Journal) -> None:
    machine = journal.corrected().machine
    both = frozenset({Fragment(4, 0), Fragment(4, 1)})
    assert parts(machine, both) == "#4"
    assert parts(machine, frozenset({Fragment(4, 1)})) == "#4 now"
    assert parts(machine, frozenset({Fragment(6, 1), Fragment(7, 1), Fragment(12, 1)})) == "#6, #7 and #12"
    assert parts(machine, frozenset({Fragment(8, 0), Fragment(7, 1)})) == "#7 now and #8 before"


def test_going_back_names_whose_decisions_it_changes(journal: Journal) -> None:
    journal.decide(6, ChangeLabel.STATIC, who="ann")
    journal.decide(9, ChangeLabel.STATIC, who="ben")
    journal.decide(12, ChangeLabel.STATIC, who="ben")
    journal.undo("ben")
    events = journal.changes_since(0)
    said = restore_words(3, [events[0], events[1]], [events[2]])
    assert "as it did after entry 3. 2 decisions will no longer count (1 of ann, 1 of ben)." in said
    assert "1 decision taken back since will count again (1 of ben)." in said
    assert "as the machine found it" in restore_words(0, [], [])
