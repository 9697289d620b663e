"""Every baseline end to end on the painted hall, and the choice between methods."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import get_args, get_type_hints

import numpy as np
import pytest
from fixture_scene import OBJECTS

from oasisview.commands.options import METHODS as COMMAND_METHODS
from pipeline.baselines import findings
from pipeline.baselines.findings import NOT_MET
from pipeline.methods import METHODS, chosen_method
from pipeline.result import ChangeLabel, Result
from pipeline.settings import RunSettings, Settings
from pipeline.store import open_result
from pipeline.system import run, run_key

BASELINES = ("geometric", "conceptgraphs", "wheres-my-glasses")
OBJECT_METHODS = BASELINES[1:]


def seen_as(result: Result, visit: int, object_id: int) -> tuple[int, ChangeLabel] | None:
    """Which object of the result most points of a scene object belong to, and its label."""
    low, high = (np.array(corner) for corner in OBJECTS[object_id - 1].boxes[visit])
    session = result.sessions[visit]
    points, owners = np.asarray(session.points_world), np.asarray(session.object_ids)
    inside = ((points > low - 0.03) & (points < high + 0.03) & (points[:, [2]] > 0.08)).all(axis=1)
    numbers, counts = np.unique(owners[inside], return_counts=True)
    found = int(numbers[counts.argmax()])
    return (found, result.object(found).label) if found else None


def test_methods_are_named_alike_everywhere() -> None:
    assert tuple(METHODS) == COMMAND_METHODS == get_args(get_type_hints(RunSettings)["method"])
    assert Settings().run.method == "oasis"
    for name in METHODS:
        assert chosen_method(Settings().override("run.method", name)).name == name


def test_method_is_part_of_what_a_result_is_known_by() -> None:
    keys = {run_key(("a", "b"), Settings().override("run.method", name)) for name in METHODS}
    assert len(keys) == len(METHODS)


@pytest.mark.parametrize("method", BASELINES)
def test_result_is_as_complete_as_any_other(method: str, result_of: Callable[[str], Result]) -> None:
    result = open_result(result_of(method).path)
    assert result.manifest["settings"]["run"]["method"] == method
    ids = [o.object_id for o in result.objects]
    assert ids == list(range(1, len(ids) + 1))
    assert len(ids) >= 4
    belief = np.asarray(result.belief)
    assert belief.shape == (3, len(ids))
    assert set(np.unique(belief)) <= {*map(int, ChangeLabel), NOT_MET}
    assert belief[-1].tolist() == [int(o.label) for o in result.objects]
    rows, columns = result.score_matrix.row_object_ids, result.score_matrix.column_object_ids
    for found in result.objects:
        assert 0 <= found.confidence <= 1
        assert 0 <= found.coverage <= 1
        for axis, numbers in ((0, rows), (1, columns)):
            sighting = found.sighting(axis)
            assert (found.object_id in numbers) is (sighting is not None)
            if sighting is not None:
                assert numbers[sighting.instance] == found.object_id
        if found.decided_in_submap is not None:
            column = belief[:, found.object_id - 1]
            assert (column[found.decided_in_submap :] == found.label).all()
    for session in result.sessions:
        carried = set(np.unique(session.object_ids).tolist()) - {0}
        assert carried <= {o.object_id for o in result.objects if o.sighting(session.index) is not None}
        assert np.isfinite(session.semantic_heatmap(3)).any()
    assert result.moves is None  # no baseline lays objects over each other
    for event in result.replaced:
        assert result.object(event.disappeared_id).label is ChangeLabel.DISAPPEARED
        assert result.object(event.appeared_id).label is ChangeLabel.APPEARED


@pytest.mark.parametrize("method", BASELINES)
def test_result_can_be_evaluated_and_exported(
    method: str, result_of: Callable[[str], Result], tmp_path: Path
) -> None:
    from oasisview.cli import main

    path = result_of(method).path
    assert main(["export", str(path), "--format", "csv", "-o", str(tmp_path / "o.csv")]) == 0
    assert len((tmp_path / "o.csv").read_text().splitlines()) > len(result_of(method).objects)


@pytest.mark.parametrize("method", BASELINES)
def test_viewer_says_who_decided(method: str, result_of: Callable[[str], Result]) -> None:
    from oasisview.why import why
    from oasisview.wording import Limits

    result = result_of(method)
    assert f"The baseline {method} says so" in why(result.objects[0], Limits.of(result))


@pytest.mark.parametrize("method", ("geometric", "wheres-my-glasses"))
def test_interrupted_baseline_goes_on_from_its_checkpoints_to_the_same_bytes(
    method: str,
    result_of: Callable[[str], Result],
    hall_archives: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settings = Settings.from_dict(dict(result_of(method).manifest["settings"]))
    output, stages = tmp_path / "hall.oasis", set()

    def power_cut(*arguments: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(findings, "find_replaced", power_cut)
        with pytest.raises(KeyboardInterrupt):
            run(*hall_archives, settings=settings, output=output)
    resumed = run(*hall_archives, settings=settings, output=output, report=lambda e: stages.add(e.stage))
    assert stages == {"open", "decide", "write"}
    assert resumed.objects == result_of(method).objects
    for ours, theirs in zip(resumed.sessions, result_of(method).sessions, strict=True):
        assert (np.asarray(ours.object_ids) == np.asarray(theirs.object_ids)).all()


def test_geometric_finds_what_came_and_went_and_knows_no_identity(result_of: Callable[[str], Result]) -> None:
    result = result_of("geometric")
    assert all(len(o.sightings) == 1 for o in result.objects)
    assert {o.label for o in result.objects} <= {
        ChangeLabel.APPEARED,
        ChangeLabel.DISAPPEARED,
        ChangeLabel.UNKNOWN,
    }
    for visit, object_id, label in (
        (1, 6, ChangeLabel.APPEARED),
        (0, 9, ChangeLabel.DISAPPEARED),
        (0, 4, ChangeLabel.DISAPPEARED),  # moved: gone here,
        (1, 4, ChangeLabel.APPEARED),  # and new there
    ):
        found = seen_as(result, visit, object_id)
        assert found is not None, object_id
        assert found[1] is label, object_id
    assert seen_as(result, 0, 1) is None  # what stayed is background
    unseen = seen_as(result, 0, 10)
    assert unseen is None or unseen[1] is ChangeLabel.UNKNOWN


@pytest.mark.parametrize("method", OBJECT_METHODS)
def test_objects_that_stayed_keep_their_identity(method: str, result_of: Callable[[str], Result]) -> None:
    result = result_of(method)
    before, after = seen_as(result, 0, 1), seen_as(result, 1, 1)
    assert before is not None
    assert before == after
    assert before[1] is ChangeLabel.STATIC


@pytest.mark.parametrize("method", OBJECT_METHODS)
def test_crate_that_left_is_not_static(method: str, result_of: Callable[[str], Result]) -> None:
    found = seen_as(result_of(method), 0, 9)
    assert found is not None
    assert found[1] in (ChangeLabel.DISAPPEARED, ChangeLabel.MOVED)


def test_conceptgraphs_never_says_unknown_and_decides_at_the_end(result_of: Callable[[str], Result]) -> None:
    result = result_of("conceptgraphs")
    assert all(o.label is not ChangeLabel.UNKNOWN for o in result.objects)
    assert set(np.unique(result.belief[:-1])) <= {int(ChangeLabel.UNKNOWN), NOT_MET}
    # Nobody looked there again, and it is reported as gone all the same.
    unseen = seen_as(result, 0, 10)
    assert unseen is not None
    assert unseen[1] in (ChangeLabel.DISAPPEARED, ChangeLabel.MOVED)


def test_wheres_my_glasses_leaves_unknown_what_it_never_expected(result_of: Callable[[str], Result]) -> None:
    result = result_of("wheres-my-glasses")
    unseen = seen_as(result, 0, 10)
    assert unseen is not None
    assert unseen[1] is ChangeLabel.UNKNOWN
    assert (np.asarray(result.belief)[:-1] != NOT_MET).any()
