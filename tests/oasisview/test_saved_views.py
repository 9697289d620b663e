from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

import pytest

from oasisview import saved_views
from oasisview.saved_views import VIEWS_FILE, SavedViews, ViewState
from pipeline.errors import ResultError, StorageError
from pipeline.store.swap import swap_in

STATE = ViewState((1.0, 2.0, 3.0), (0.5, 0.0, 0.25), "both", 7, ((0, 0, 0), (1, 2, 0.5)))


def test_views_come_back_whole_and_in_order(tmp_path: Path) -> None:
    views = SavedViews(tmp_path)
    assert views.all() == ()
    assert list(tmp_path.iterdir()) == []  # looking makes no file
    views.add("door", "ann", STATE)
    views.add("<b>shelf", "bob", ViewState((0, 0, 1), (0, 0, 0), "after"))
    found = SavedViews(tmp_path).all()
    assert [(v.view_id, v.name, v.who) for v in found] == [(1, "door", "ann"), (2, "<b>shelf", "bob")]
    assert found[0].state == STATE
    assert found[1].state.selected is None and found[1].state.cut is None
    views.remove(1)
    views.add("third", "ann", STATE)
    assert [v.view_id for v in views.all()] == [2, 3]  # numbers are never used again


def test_others_are_told(tmp_path: Path) -> None:
    views, heard = SavedViews(tmp_path), []
    listener = lambda: heard.append(len(views.all()))  # noqa: E731
    views.subscribe(listener)
    views.add("door", "ann", STATE)
    views.remove(1)
    views.unsubscribe(listener)
    views.add("door", "ann", STATE)
    assert heard == [1, 0]


def test_a_new_run_of_the_result_keeps_them(small_result_path: Path, tmp_path: Path) -> None:
    SavedViews(small_result_path).add("door", "ann", STATE)
    again = Path(
        shutil.copytree(small_result_path, tmp_path / "again", ignore=shutil.ignore_patterns("review*"))
    )
    swap_in(again, small_result_path, "another key")
    assert [v.name for v in SavedViews(small_result_path).all()] == ["door"]


def test_a_damaged_file_is_one_line(tmp_path: Path) -> None:
    (tmp_path / VIEWS_FILE).write_text("not a database, but long enough to look at " * 20)
    with pytest.raises(ResultError, match="holds no saved views"):
        SavedViews(tmp_path).all()
    with pytest.raises(ResultError):
        SavedViews(tmp_path).add("door", "ann", STATE)


def test_entries_that_make_no_sense_are_left_out(tmp_path: Path) -> None:
    views = SavedViews(tmp_path)
    views.add("door", "ann", STATE)
    with sqlite3.connect(tmp_path / VIEWS_FILE) as connection:
        for content in ("{}", "[]", "nothing", '{"position": [1], "target": [0, 0, 0], "mode": "after"}'):
            connection.execute(
                "INSERT INTO viewpoint (name, who, at, content) VALUES ('x', 'y', 'z', ?)", (content,)
            )
    connection.close()
    assert [v.name for v in views.all()] == ["door"]


def test_there_is_an_end_and_a_missing_folder_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(saved_views, "MAX_VIEWS", 2)
    views = SavedViews(tmp_path)
    views.add("1", "ann", STATE)
    views.add("2", "ann", STATE)
    with pytest.raises(StorageError, match="remove some first"):
        views.add("3", "ann", STATE)
    with pytest.raises(StorageError, match="folder is writable"):
        SavedViews(tmp_path / "gone").add("1", "ann", STATE)
