"""Files that are not what they should be, and disks that do not do what they should."""

from __future__ import annotations

import hashlib
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from oasisview.review import Journal
from pipeline.errors import ResultError, StorageError
from pipeline.result import ChangeLabel

MACHINE = {1: ChangeLabel.STATIC, 2: ChangeLabel.APPEARED}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "review.sqlite"
    with Journal(path, MACHINE) as journal:
        for turn in range(6):
            journal.decide(1 + turn % 2, turn % 5, who="ann", why=f"reason {turn}")
    return path


def edit(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        for statement in statements:
            connection.execute(statement)


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def refused(path: Path, message: str) -> None:
    before = digest(path)
    with pytest.raises(ResultError, match=message) as error:
        Journal(path, MACHINE)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value) or "journal" in str(error.value)
    assert digest(path) == before


def test_settings_of_the_file(path: Path) -> None:
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone() == ("wal",)
        assert connection.execute("PRAGMA user_version").fetchone() == (2,)
    with Journal(path, MACHINE) as journal:
        assert journal._connection is not None
        assert journal._connection.execute("PRAGMA synchronous").fetchone() == (2,)


@pytest.mark.parametrize("statement", ["UPDATE events SET why = 'x'", "DELETE FROM events WHERE id = 6"])
def test_rows_cannot_be_changed_or_removed(path: Path, statement: str) -> None:
    with pytest.raises(sqlite3.IntegrityError, match="append-only"):
        edit(path, statement)


def test_text_file_is_refused(path: Path) -> None:
    path.write_text("my notes\n" * 100)
    refused(path, "not a journal")


def test_database_of_another_program_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "review.sqlite"
    edit(path, "CREATE TABLE events (id INTEGER)", "PRAGMA user_version = 1")
    refused(path, "another program")


def test_newer_schema_is_refused(path: Path) -> None:
    edit(path, "PRAGMA user_version = 3")
    refused(path, "newer oasisview .schema 3")


def test_newer_schema_still_in_the_write_ahead_log_is_refused(path: Path) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as open_elsewhere:
        open_elsewhere.execute("PRAGMA user_version = 3")
        refused(path, "newer oasisview .schema 3")


def test_truncated_file_is_refused(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:5000])
    refused(path, "damaged")


def test_overwritten_pages_are_refused(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:] = b"\xa5" * (len(content) - 4096)
    path.write_bytes(bytes(content))
    refused(path, "damaged")


def test_removed_row_is_noticed(path: Path) -> None:
    edit(path, "DROP TRIGGER events_are_never_removed", "DELETE FROM events WHERE id = 3")
    refused(path, "event 3 is missing")


def test_forged_undo_is_noticed(path: Path) -> None:
    edit(path, "INSERT INTO events VALUES (7, '2026', 'ben', 'undo', 1, 0, 0, '', 6, '')")
    refused(path, "event 7 does not follow")


def test_impossible_label_is_noticed(path: Path) -> None:
    edit(
        path,
        "PRAGMA ignore_check_constraints = ON",
        "DROP TRIGGER events_are_never_changed",
        "UPDATE events SET new_label = 9 WHERE id = 2",
    )
    refused(path, "damaged")


def test_file_of_size_zero_is_a_new_journal(tmp_path: Path) -> None:
    path = tmp_path / "review.sqlite"
    path.touch()
    with Journal(path, MACHINE) as journal:
        assert journal.decisions() == ()
        journal.decide(1, ChangeLabel.MOVED, who="ann")
        assert len(journal.decisions()) == 1


def test_locked_by_another_program_is_one_line_and_changes_nothing(path: Path) -> None:
    with closing(sqlite3.connect(path, isolation_level=None)) as holder:
        holder.execute("BEGIN IMMEDIATE")
        journal = Journal(path, MACHINE, busy_timeout_s=0.1)
        with pytest.raises(StorageError, match="held by another program"):
            journal.decide(1, ChangeLabel.MOVED, who="ben")
        holder.execute("ROLLBACK")
        assert journal.last_event_id == 6
        assert journal.decide(1, ChangeLabel.MOVED, who="ben").event_id == 7


def test_full_disk_is_one_line_and_changes_nothing(path: Path) -> None:
    with Journal(path, MACHINE) as journal:
        assert journal._connection is not None
        pages = journal._connection.execute("PRAGMA page_count").fetchone()[0]
        journal._connection.execute(f"PRAGMA max_page_count = {pages}")
        finals = journal.final_labels()
        with pytest.raises(StorageError, match="disk is full"):
            for _ in range(200):
                journal.decide(1, ChangeLabel.MOVED, who="ann", why="w" * 500)
        saved = journal.last_event_id
        journal._connection.execute("PRAGMA max_page_count = 10000")
        assert journal.decide(2, ChangeLabel.MOVED, who="ann").event_id == saved + 1
        assert finals[2] != journal.final_labels()[2]


def test_missing_folder_is_one_line(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "gone" / "review.sqlite", MACHINE)
    with pytest.raises(StorageError, match="cannot write"):
        journal.decide(1, ChangeLabel.MOVED, who="ann")


def test_nothing_is_called_saved_in_a_file_that_was_removed(path: Path) -> None:
    with Journal(path, MACHINE) as journal:
        path.rename(path.with_name("elsewhere.sqlite"))
        with pytest.raises(ResultError, match="replaced or removed"):
            journal.decide(1, ChangeLabel.MOVED, who="ann")
