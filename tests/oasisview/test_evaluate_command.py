from __future__ import annotations

import pytest

from oasisview.cli import main
from oasisview.commands import evaluate
from pipeline.evaluation import PRESETS


def test_the_command_knows_every_preset() -> None:
    assert tuple(PRESETS) == evaluate.PRESETS


def test_an_unknown_preset_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", "r.oasis", "gt.ply", "--preset", "coco"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "invalid choice: 'coco'" in said
