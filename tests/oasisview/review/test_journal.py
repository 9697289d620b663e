from __future__ import annotations

import itertools
import subprocess
import sys
import threading
from datetime import UTC, datetime
from pathlib import Path

import pytest

from oasisview.review import ConflictError, FinalLabel, Journal, Kind
from pipeline.errors import InputError
from pipeline.result import ChangeLabel

MACHINE = {
    1: ChangeLabel.STATIC,
    2: ChangeLabel.APPEARED,
    3: ChangeLabel.DISAPPEARED,
    7: ChangeLabel.UNKNOWN,
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "odd #name? 100%" / "review.sqlite"


@pytest.fixture
def journal(path: Path) -> Journal:
    path.parent.mkdir()
    return Journal(path, MACHINE)


def labels(journal: Journal) -> dict[int, ChangeLabel]:
    return {object_id: final.label for object_id, final in journal.final_labels().items()}


def test_without_decisions_the_machine_stands_and_no_file_is_made(journal: Journal, path: Path) -> None:
    assert journal.final_labels() == {i: FinalLabel(label, False) for i, label in MACHINE.items()}
    assert journal.decisions() == ()
    assert journal.undo("ann") is None
    assert journal.redo("ann") is None
    assert journal.last_event_id == 0
    assert not path.exists()


def test_a_decision_tells_who_when_old_new_and_why(journal: Journal) -> None:
    before = datetime.now(UTC).isoformat(timespec="milliseconds")
    decision = journal.decide(2, ChangeLabel.MOVED, who="ann", why="it stood by the door")
    after = datetime.now(UTC).isoformat(timespec="milliseconds")
    assert (decision.event_id, decision.object_id, decision.who) == (1, 2, "ann")
    assert (decision.old_label, decision.new_label) == (ChangeLabel.APPEARED, ChangeLabel.MOVED)
    assert (decision.why, decision.kind, decision.undone) == ("it stood by the door", Kind.LABEL, False)
    assert before <= decision.at <= after
    assert decision.at.endswith("+00:00")
    final = journal.final_labels()[2]
    assert final == FinalLabel(ChangeLabel.MOVED, True, "ann", decision.at, "it stood by the door", 1)


def test_accepting_confirms_without_overriding(journal: Journal) -> None:
    decision = journal.accept(3, who="ann")
    assert decision.kind is Kind.ACCEPT
    final = journal.final_labels()[3]
    assert (final.label, final.overridden, final.decided_by) == (ChangeLabel.DISAPPEARED, False, "ann")


def test_a_note_changes_no_label_and_can_be_undone(journal: Journal) -> None:
    journal.note(1, "check next week", who="ann")
    assert labels(journal) == MACHINE
    assert journal.final_labels()[1].decided_by is None
    undone = journal.undo("ann")
    assert undone is not None
    assert (undone.kind, undone.undone) == (Kind.NOTE, True)


def test_undo_and_redo_walk_back_and_forth_across_reopening(journal: Journal, path: Path) -> None:
    for label in (ChangeLabel.STATIC, ChangeLabel.MOVED, ChangeLabel.UNKNOWN):
        journal.decide(2, label, who="ann")
    journal.close()
    with Journal(path, MACHINE) as reopened:
        seen = []
        while reopened.undo("ann"):
            seen.append(labels(reopened)[2])
        assert seen == [ChangeLabel.MOVED, ChangeLabel.STATIC, ChangeLabel.APPEARED]
    with Journal(path, MACHINE) as reopened:
        seen = []
        while reopened.redo("ann"):
            seen.append(labels(reopened)[2])
        assert seen == [ChangeLabel.STATIC, ChangeLabel.MOVED, ChangeLabel.UNKNOWN]
        assert reopened.last_event_id == 9
        changes = reopened.changes_since(3)
        assert [event.kind for event in changes] == [Kind.UNDO] * 3 + [Kind.REDO] * 3
        assert [event.target_id for event in changes] == [3, 2, 1, 1, 2, 3]
        assert (changes[0].old_label, changes[0].new_label) == (ChangeLabel.UNKNOWN, ChangeLabel.MOVED)


def test_a_new_decision_ends_what_could_be_redone(journal: Journal) -> None:
    journal.decide(1, ChangeLabel.MOVED, who="ann")
    journal.undo("ann")
    assert journal.can_redo("ann")
    journal.decide(2, ChangeLabel.STATIC, who="ann")
    assert not journal.can_redo("ann")
    assert journal.redo("ann") is None
    assert labels(journal)[1] is ChangeLabel.STATIC


def test_people_undo_only_their_own_and_never_disturb_a_newer_decision(journal: Journal) -> None:
    journal.decide(1, ChangeLabel.MOVED, who="ann")
    journal.decide(1, ChangeLabel.UNKNOWN, who="ben")
    journal.undo("ann")
    assert labels(journal)[1] is ChangeLabel.UNKNOWN
    journal.redo("ann")
    assert labels(journal)[1] is ChangeLabel.UNKNOWN  # back under Ben's, not over it
    journal.undo("ben")
    assert labels(journal)[1] is ChangeLabel.MOVED
    assert journal.undo("cem") is None


def test_conflict_only_when_somebody_else_touched_the_object_since(journal: Journal) -> None:
    seen = journal.decide(1, ChangeLabel.MOVED, who="ann").event_id
    journal.decide(2, ChangeLabel.STATIC, who="ben", expected_event_id=seen)  # another object: fine
    journal.note(1, "looks odd", who="ben")  # no label: fine
    journal.decide(1, ChangeLabel.STATIC, who="ann", expected_event_id=seen)
    with pytest.raises(
        ConflictError, match=r"^ann set object 1 to static at \d\d:\d\d UTC, after you"
    ) as error:
        journal.decide(1, ChangeLabel.UNKNOWN, who="ben", expected_event_id=seen)
    assert error.value.event.who == "ann"
    assert labels(journal)[1] is ChangeLabel.STATIC
    journal.accept(1, who="ben", expected_event_id=journal.last_event_id)
    with pytest.raises(ConflictError):
        journal.accept(1, who="ann", expected_event_id=seen)


def test_conflict_also_when_the_other_undid(journal: Journal) -> None:
    seen = journal.decide(1, ChangeLabel.MOVED, who="ann").event_id
    journal.undo("ann")
    with pytest.raises(ConflictError, match="static"):
        journal.decide(1, ChangeLabel.UNKNOWN, who="ben", expected_event_id=seen)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda j: j.decide(4, ChangeLabel.STATIC, who="ann"), "no object 4"),
        (lambda j: j.accept(99, who="ann"), "no object 99"),
        (lambda j: j.decide(1, 5, who="ann"), "no label 5"),
        (lambda j: j.decide(1, 255, who="ann"), "no label 255"),
        (lambda j: j.decide(1, ChangeLabel.STATIC, who=" \x00\n"), "needs the name"),
        (lambda j: j.decide(1, ChangeLabel.STATIC, who="a" * 81), "81 characters"),
        (lambda j: j.decide(1, ChangeLabel.STATIC, who="ann", why="w" * 501), "501 characters"),
        (lambda j: j.note(1, "\x1b ", who="ann"), "note is empty"),
        (lambda j: j.undo(""), "needs the name"),
    ],
)
def test_what_cannot_be_decided_is_refused_and_leaves_nothing(journal: Journal, call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call(journal)
    assert journal.last_event_id == 0


def test_longest_texts_pass_and_control_characters_go(journal: Journal) -> None:
    journal.decide(1, ChangeLabel.MOVED, who="a" * 80, why="w" * 500)
    decision = journal.decide(
        1, 4, who="\u202eZoë\x00\x07 '); DROP", why="line 1\r\nline 2\t\x1b[31m\ud800 ✓ 🚗"
    )
    assert decision.who == "Zoë '); DROP"
    assert decision.why == "line 1 line 2 [31m ✓ 🚗"
    assert journal.last_event_id == 2


def test_threads_share_one_journal(journal: Journal) -> None:
    def work(name: str) -> None:
        for turn in range(10):
            journal.decide(1 + turn % 3, turn % 5, who=name)
            journal.undo(name)
            journal.redo(name)

    threads = [threading.Thread(target=work, args=(f"person {n}",)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert journal.last_event_id == 4 * 10 * 3
    assert len(journal.decisions()) == 40
    assert not any(decision.undone for decision in journal.decisions())


WRITER = """
import sys
from oasisview.review import Journal
from pipeline.result import ChangeLabel
machine = {1: ChangeLabel.STATIC, 2: ChangeLabel.APPEARED, 3: ChangeLabel.DISAPPEARED, 7: ChangeLabel.UNKNOWN}
journal = Journal(sys.argv[1], machine)
for turn in range(25):
    journal.decide(7, turn % 5, who=sys.argv[2], why=str(turn))
"""


def test_two_processes_write_at_once_and_both_see_all(journal: Journal, path: Path) -> None:
    root = Path(__file__).parents[3]
    writers = [
        subprocess.Popen([sys.executable, "-c", WRITER, str(path), name], cwd=root) for name in ("ann", "ben")
    ]
    for turn in range(25):
        journal.decide(7, turn % 5, who="cem", why=str(turn))
    assert [writer.wait(timeout=60) for writer in writers] == [0, 0]
    events = journal.changes_since(0)
    assert [event.id for event in events] == list(range(1, 76))
    for name in ("ann", "ben", "cem"):
        assert [event.why for event in events if event.who == name] == [str(turn) for turn in range(25)]
    for earlier, later in itertools.pairwise(events):
        assert later.old_label == earlier.new_label  # every writer had seen the one before


def test_the_other_process_is_followed(journal: Journal, path: Path) -> None:
    with Journal(path, MACHINE) as other:  # opened before the file exists
        journal.decide(2, ChangeLabel.STATIC, who="ann")
        assert [event.object_id for event in other.changes_since(0)] == [2]
        journal.undo("ann")
        assert [event.kind for event in other.changes_since(1)] == [Kind.UNDO]
        assert other.changes_since(2) == ()


def test_killed_process_keeps_what_it_had_returned(path: Path) -> None:
    path.parent.mkdir()
    script = WRITER + "print('saved', flush=True)\nimport os, signal\nos.kill(os.getpid(), signal.SIGKILL)"
    done = subprocess.run(
        [sys.executable, "-c", script, str(path), "ann"],
        cwd=Path(__file__).parents[3],
        stdout=subprocess.PIPE,
        check=False,
    )
    assert (done.returncode, done.stdout) == (-9, b"saved\n")
    with Journal(path, MACHINE) as journal:
        assert journal.last_event_id == 25
