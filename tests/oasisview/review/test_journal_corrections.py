"""Corrections in the file: kept across reopening and processes, checked for conflicts, old files read."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from oasisview.review import ConflictError, Journal, Kind, corrections
from oasisview.review.corrections import Correction
from pipeline.errors import InputError, ResultError
from pipeline.result import ChangeLabel, Result

VERSION_1 = (
    """CREATE TABLE events (
        id INTEGER PRIMARY KEY AUTOINCREMENT, at TEXT NOT NULL, who TEXT NOT NULL,
        kind TEXT NOT NULL CHECK (kind IN ('label', 'accept', 'note', 'undo', 'redo')),
        object_id INTEGER NOT NULL,
        old_label INTEGER NOT NULL CHECK (old_label BETWEEN 0 AND 4),
        new_label INTEGER NOT NULL CHECK (new_label BETWEEN 0 AND 4),
        why TEXT NOT NULL, target_id INTEGER REFERENCES events (id)
    )""",
    """CREATE TRIGGER events_are_never_changed BEFORE UPDATE ON events
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END""",
    """CREATE TRIGGER events_are_never_removed BEFORE DELETE ON events
        BEGIN SELECT RAISE(ABORT, 'the journal is append-only'); END""",
    "PRAGMA application_id = 1329681225",
    "PRAGMA user_version = 1",
    "INSERT INTO events VALUES (1, '2026-03-01T08:00Z', 'ann', 'label', 6, 2, 1, 'was there', NULL)",
    "INSERT INTO events VALUES (2, '2026-03-01T08:01Z', 'ann', 'label', 9, 3, 4, 'found it', NULL)",
    "INSERT INTO events VALUES (3, '2026-03-01T08:02Z', 'ann', 'undo', 9, 4, 3, '', 2)",
)


@pytest.fixture
def journal(small_result: Result) -> Journal:
    return Journal.of(small_result)


def write(journal: Journal, correction: Correction, who: str = "ann", **options):
    return journal.correct(correction.kind, correction.object_id, correction.groups, who=who, **options)


def old_journal(result: Result) -> Path:
    path = result.path / "review.sqlite"
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        for statement in VERSION_1:
            connection.execute(statement)
    return path


def test_a_correction_is_durable_and_undoable_across_reopening(
    journal: Journal, small_result: Result
) -> None:
    made = write(journal, corrections.same(journal.corrected(), 8, 7), why="same chair")
    assert (made.kind, made.object_id, made.who, made.why) == (Kind.SAME, 8, "ann", "same chair")
    assert (made.old_label, made.new_label) == (ChangeLabel.DISAPPEARED, ChangeLabel.STATIC)
    journal.close()
    with Journal.of(small_result) as again:
        assert again.final_labels()[7].label is ChangeLabel.STATIC and 8 not in again.final_labels()
        assert again.changes_since(0)[0].groups == made.groups
        undone = again.undo("ann")
        assert undone.undone and again.final_labels()[8].label is ChangeLabel.DISAPPEARED
        assert again.corrected().replaced == small_result.replaced
    with Journal.of(small_result) as again:
        again.redo("ann")
        assert 8 not in again.final_labels() and not again.can_redo("ann")
        kinds = [event.kind for event in again.changes_since(0)]
        assert kinds == [Kind.SAME, Kind.UNDO, Kind.REDO]
        back = again.changes_since(1)[0]
        assert (back.old_label, back.new_label) == (ChangeLabel.STATIC, ChangeLabel.DISAPPEARED)


def test_a_label_of_a_corrected_object_names_its_parts(journal: Journal) -> None:
    write(journal, corrections.merge(journal.corrected(), (6, 12)))
    journal.decide(6, ChangeLabel.MOVED, who="ann")
    event = journal.changes_since(1)[0]
    assert sorted(map(str, event.groups[0].members)) == ["12.1", "6.1"]
    assert journal.final_labels()[6].label is ChangeLabel.MOVED
    with pytest.raises(InputError, match="no object 12"):
        journal.decide(12, ChangeLabel.STATIC, who="ann")
    journal.undo("ann")
    journal.undo("ann")
    assert journal.decide(12, ChangeLabel.STATIC, who="ann").groups == ()


def test_taking_a_correction_back_does_not_silence_what_others_decided_on_it(journal: Journal) -> None:
    write(journal, corrections.merge(journal.corrected(), (6, 12)))
    journal.decide(6, ChangeLabel.MOVED, who="ben")
    before = journal.corrected().objects[6]
    journal.undo("ann")
    after = journal.corrected().objects[6]
    assert (after.members, after.final) == (before.members, before.final)
    journal.undo("ben")
    assert not journal.corrected().is_corrected
    journal.redo("ann")
    write(journal, corrections.split_visits(journal.corrected(), 4), who="ben")
    journal.undo("ben")
    journal.decide(4, ChangeLabel.STATIC, who="ann")
    journal.redo("ben")  # back below Ann's label, which is about the whole of 4
    assert journal.final_labels()[4].label is ChangeLabel.STATIC and 16 not in journal.final_labels()


def test_every_object_concerned_is_checked_for_conflicts(journal: Journal) -> None:
    seen = journal.last_event_id
    merged = corrections.merge(journal.corrected(), (6, 12))
    journal.decide(12, ChangeLabel.STATIC, who="ben")
    with pytest.raises(ConflictError, match="ben set object 12 to static"):
        write(journal, merged, expected_event_id=seen)
    seen = journal.last_event_id
    write(journal, merged, who="ben", expected_event_id=seen)
    with pytest.raises(ConflictError, match="ben merged object 6 with others"):
        journal.decide(6, ChangeLabel.STATIC, who="ann", expected_event_id=seen)
    dropped = corrections.drop(journal.corrected(), 6)
    with pytest.raises(ConflictError, match="ben merged"):
        write(journal, dropped, expected_event_id=seen)
    write(journal, dropped, expected_event_id=journal.last_event_id)
    seen = journal.last_event_id
    journal.undo("ann")
    with pytest.raises(ConflictError, match="ann"):
        write(journal, corrections.merge(journal.corrected(), (6, 9)), who="ben", expected_event_id=seen)
    journal.decide(1, ChangeLabel.MOVED, who="ben", expected_event_id=seen)  # another object: fine


def test_an_earlier_state_can_be_restored_and_that_undone(journal: Journal) -> None:
    journal.decide(6, ChangeLabel.STATIC, who="ann")
    write(journal, corrections.drop(journal.corrected(), 12), who="ben")
    journal.decide(9, ChangeLabel.STATIC, who="ann")
    before = journal.corrected()
    change = journal.restoring(1)
    assert (change.brought, change.taken) == (frozenset(), frozenset({2, 3}))
    made = journal.restore(1, who="cem", why="start again")
    assert (made.kind, made.why) == (Kind.RESTORE, "start again")
    assert journal.changes_since(3)[0].target_id == 1
    assert journal.final_labels()[6].decided_by == "ann" and journal.final_labels()[9].decided_by is None
    assert 12 in journal.final_labels() and [d.undone for d in journal.decisions()] == [
        False,
        True,
        True,
        False,
    ]
    assert not journal.can_undo("ben")  # his decision does not count at present
    assert journal.restore(4, who="cem") is None  # that is the present state
    journal.undo("cem")
    assert journal.corrected() == before
    journal.restore(0, who="ann")
    assert not any(final.decided_by for final in journal.final_labels().values())
    assert journal.last_event_id == 6  # nothing was erased
    journal.undo("ann")
    assert journal.corrected() == before


def test_a_restored_state_does_not_run_over_what_others_did_meanwhile(journal: Journal) -> None:
    journal.decide(6, ChangeLabel.STATIC, who="ann")
    seen = journal.last_event_id
    journal.decide(9, ChangeLabel.STATIC, who="ben")
    with pytest.raises(ConflictError, match="ben set object 9"):
        journal.restore(0, who="ann", expected_event_id=seen)
    with pytest.raises(InputError, match="no entry 7"):
        journal.restore(7, who="ann")
    assert journal.restore(0, who="ann", expected_event_id=journal.last_event_id) is not None
    seen = journal.last_event_id - 1
    with pytest.raises(ConflictError, match="ann went back to an earlier state"):
        journal.decide(9, ChangeLabel.STATIC, who="ben", expected_event_id=seen)
    journal.decide(12, ChangeLabel.STATIC, who="ben", expected_event_id=seen)  # untouched by it: fine


@pytest.mark.parametrize("kind", [Kind.LABEL, Kind.RESTORE, Kind.UNDO])
def test_only_corrections_correct(journal: Journal, kind: Kind) -> None:
    groups = corrections.drop(journal.corrected(), 6).groups
    with pytest.raises(InputError, match="no correction"):
        journal.correct(kind, 6, groups, who="ann")
    with pytest.raises(InputError, match="no correction"):
        journal.correct(Kind.MERGE, 6, (*groups, *groups), who="ann")
    with pytest.raises(InputError, match="needs the name"):
        journal.correct(Kind.DROP, 6, groups, who="")
    assert journal.last_event_id == 0


def test_two_processes_see_each_others_corrections(journal: Journal, small_result: Result) -> None:
    with Journal.of(small_result) as other:
        write(journal, corrections.split_visits(journal.corrected(), 4))
        assert other.final_labels()[16].label is ChangeLabel.APPEARED
        write(other, corrections.drop(other.corrected(), 16), who="ben")
        assert 16 not in journal.final_labels()


def test_a_journal_of_the_first_schema_opens_unchanged_and_is_brought_along_by_the_first_decision(
    small_result: Result,
) -> None:
    path = old_journal(small_result)
    content = path.read_bytes()
    with Journal.of(small_result) as reader:
        assert reader.final_labels()[6].label is ChangeLabel.STATIC
        assert reader.final_labels()[6].why == "was there" and reader.can_redo("ann")
        assert path.read_bytes() == content  # only looked at
        with Journal.of(small_result) as writer:
            write(writer, corrections.drop(writer.corrected(), 9), who="ben")
            assert [e.id for e in writer.changes_since(0)] == [1, 2, 3, 4]
        assert 9 not in reader.final_labels() and reader.can_redo("ann")  # open since before
        reader.undo("ann")
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (2,)
        assert connection.execute("PRAGMA quick_check").fetchone() == ("ok",)
        with pytest.raises(sqlite3.IntegrityError, match="append-only"):
            connection.execute("DELETE FROM events")
    with Journal.of(small_result) as again:
        assert [e.kind for e in again.changes_since(0)][3:] == [Kind.DROP, Kind.UNDO]
        assert again.final_labels()[6].decided_by is None


def test_an_old_journal_stays_whole_when_the_first_new_decision_fails(small_result: Result) -> None:
    path = old_journal(small_result)
    with Journal.of(small_result) as journal:
        with pytest.raises(InputError, match="no object 99"):
            journal.decide(99, ChangeLabel.STATIC, who="ann")
        assert len(journal.changes_since(0)) == 3
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA user_version").fetchone() == (1,)
        assert connection.execute("SELECT count(*) FROM events").fetchone() == (3,)


def test_groups_that_no_correction_can_hold_are_damage(journal: Journal, small_result: Result) -> None:
    write(journal, corrections.drop(journal.corrected(), 9))
    journal.close()
    with closing(sqlite3.connect(small_result.path / "review.sqlite")) as connection:
        connection.execute("DROP TRIGGER events_are_never_changed")
        connection.execute('UPDATE events SET details = \'[{"of":["nine"]}]\'')
        connection.commit()
    with pytest.raises(ResultError, match="damaged"):
        Journal.of(small_result)
