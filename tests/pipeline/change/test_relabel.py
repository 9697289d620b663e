"""A finished result decided anew under other limits."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from pipeline.change.basis import DecisionBasis
from pipeline.change.relabel import WhatIf, what_if
from pipeline.errors import ResultError
from pipeline.result import ChangeLabel as L
from pipeline.result import Result
from pipeline.settings import Settings
from pipeline.store import open_result

SETTINGS = Settings()


@pytest.fixture
def again(small_result: Result) -> WhatIf:
    found = what_if(small_result)
    assert found is not None
    return found


def test_own_limits_give_the_labels_of_the_result(again: WhatIf, small_result: Result) -> None:
    relabelled = again.under(SETTINGS)

    assert relabelled.flips == ()
    assert {i.object_id: relabelled.label_of(i.object_id) for i in small_result.objects} == {
        i.object_id: i.label for i in small_result.objects
    }


def test_limit_of_coverage_makes_unknown_what_was_seen_too_little(
    again: WhatIf, small_result: Result
) -> None:
    flips = again.under(SETTINGS.override("change.nu_min", 1.01)).flips

    assert flips
    for flip in flips:
        assert flip.labels == (L.UNKNOWN,) * len(flip.labels)
        assert flip.machine is not L.STATIC  # kept by the place that both visits share
    changed = {i.object_id for i in small_result.objects if i.label in (L.APPEARED, L.DISAPPEARED)}
    assert changed <= {flip.object_id for flip in flips}


def test_moves_that_are_not_sure_enough_fall_into_two(again: WhatIf) -> None:
    flips = {flip.object_id: flip for flip in again.under(SETTINGS.override("moves.min_log_odds", 9.0)).flips}

    assert set(flips) == {4, 5}
    for flip in flips.values():
        assert flip.parts and flip.joins is None
        assert flip.labels == (L.DISAPPEARED, L.APPEARED)


def test_places_that_must_change_more_keep_their_objects(again: WhatIf) -> None:
    flips = {
        flip.object_id: flip for flip in again.under(SETTINGS.override("change.min_log_odds", 7.0)).flips
    }

    assert {6, 9, 12} <= set(flips)
    assert flips[9].labels == flips[6].labels == (L.STATIC,)


def test_paper_rule_can_be_asked_of_a_result_of_the_other_rule(again: WhatIf) -> None:
    paper = SETTINGS.override("change.rule", "paper")
    strict = paper.override("association.tau_sigma", 1.01)

    assert again.can_decide_by_evidence
    by_matches = again.under(paper)
    assert by_matches.label_of(1) is L.STATIC
    assert by_matches.label_of(4) is L.MOVED
    assert again.under(strict).by_visit[0][1] is L.DISAPPEARED  # nothing matches any more


def test_pair_that_becomes_one_is_named(small_result: Result, small_result_path: Path) -> None:
    arrays = dict(open_result(small_result_path).basis_arrays)  # type: ignore[attr-defined]
    # Object 9 went; let it be laid over 12, which came, with little success.
    row = small_result.score_matrix.row_object_ids.tolist().index(9) + 1
    column = small_result.score_matrix.column_object_ids.tolist().index(12) + 1
    motion = np.eye(4)
    motion[0, 3] = 1.5
    arrays["move_pairs"] = np.concatenate([arrays["move_pairs"], [[row, column]]]).astype(np.int32)
    arrays["move_log_odds"] = np.append(arrays["move_log_odds"], -3.0)
    arrays["move_T_world_motion"] = np.concatenate([arrays["move_T_world_motion"], motion[None]])
    again = WhatIf(small_result, DecisionBasis.from_arrays(arrays))

    assert again.under(SETTINGS).flips == ()
    flips = {
        flip.object_id: flip for flip in again.under(SETTINGS.override("moves.min_log_odds", -4.0)).flips
    }
    assert (flips[9].joins, flips[12].joins) == (12, 9)
    assert flips[9].labels == flips[12].labels == (L.MOVED,)


def test_result_without_a_basis_says_so_and_a_damaged_one_is_named(small_result_path: Path, tmp_path) -> None:
    older = Path(shutil.copytree(small_result_path, tmp_path / "older.oasis"))
    (older / "basis.npz").unlink()
    assert what_if(open_result(older)) is None

    (small_result_path / "basis.npz").write_bytes(b"no archive")
    with pytest.raises(ResultError, match="damaged"):
        what_if(open_result(small_result_path))

    np.savez(small_result_path / "basis.npz", link_pairs=np.zeros((0, 2), np.int32))
    with pytest.raises(ResultError, match="damaged"):
        what_if(open_result(small_result_path))


def test_what_is_stored_is_what_was_given(small_result: Result) -> None:
    arrays = small_result.basis_arrays  # type: ignore[attr-defined]
    basis = DecisionBasis.from_arrays(arrays)

    again = basis.arrays()

    assert again.keys() == arrays.keys()
    for name, values in arrays.items():
        assert again[name].dtype == values.dtype, name
        assert np.array_equal(again[name], values), name
