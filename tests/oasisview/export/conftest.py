from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
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


@pytest.fixture
def objectless_path(small_result_path: Path) -> Path:
    """A result of a place in which nothing was made out as an object."""
    record = json.loads((small_result_path / "objects.json").read_text())
    record["objects"], record["replaced"] = [], []
    (small_result_path / "objects.json").write_text(json.dumps(record))
    np.save(small_result_path / "belief.npy", np.zeros((2, 0), np.uint8))
    for array in (small_result_path / "score_matrix").glob("*.npy"):
        ids = array.stem.endswith("object_ids")
        np.save(array, np.zeros(0 if ids else (0, 0), np.load(array).dtype))
    for ids_path in small_result_path.glob("sessions/*/**/object_ids.npy"):
        np.save(ids_path, np.zeros_like(np.load(ids_path)))
    for mask in small_result_path.glob("sessions/*/masks/*.png"):
        cv2.imwrite(str(mask), np.zeros_like(cv2.imread(str(mask), cv2.IMREAD_UNCHANGED)))
    return small_result_path
