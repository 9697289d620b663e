"""Fixtures that tests of every package share; puts ``tests/`` on ``sys.path`` for its helper modules."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from pipeline.result import Result
from pipeline.store import open_result

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def _small_result_template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from fixture_result import write_small_result

    return write_small_result(tmp_path_factory.mktemp("small-result"))


@pytest.fixture
def small_result_path(_small_result_template: Path, tmp_path: Path) -> Path:
    """A fresh copy of the small result, free to be written into."""
    return Path(shutil.copytree(_small_result_template, tmp_path / _small_result_template.name))


@pytest.fixture
def small_result(small_result_path: Path) -> Result:
    return open_result(small_result_path)
