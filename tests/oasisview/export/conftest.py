from __future__ import annotations

from pathlib import Path

import pytest

from oasisview.review import Journal
from pipeline.result import ChangeLabel
from pipeline.store import open_result


@pytest.fixture
def reviewed_path(small_result_path: Path) -> Path:
    """Ann overrode 6 and 10, accepted 9, noted on 1, and took back what she did to 4."""
    with Journal.of(open_result(small_result_path)) as journal:
        journal.decide(6, ChangeLabel.MOVED, who="=Ann", why='it, "stood" there; see photo')
        journal.decide(10, ChangeLabel.STATIC, who="Ann")
        journal.accept(9, who="Ann", why="Gewiß ✓")
        journal.note(1, "look again", who="Ann")
        journal.decide(4, ChangeLabel.UNKNOWN, who="Ann")
        journal.undo("Ann")
    return small_result_path
