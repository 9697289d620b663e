"""Identity numbers, belief after every submap, and what settled a label."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline import assemble as module
from pipeline.change.decision import NOT_MET, Decision, Identity
from pipeline.result import ChangeLabel as L


def decision(labels0: list[int], labels1: list[int], identities: list[tuple[int, int]] = ()) -> Decision:
    """Labels of the instances (background is added in front)."""
    full0, full1 = np.array([L.STATIC, *labels0]), np.array([L.STATIC, *labels1])
    tied = tuple(Identity(previous, current, 1.0) for previous, current in identities)
    return Decision(tied, full0, full1, np.ones(len(full0)), np.ones(len(full1)))


def test_previous_objects_keep_their_number_and_new_ones_follow() -> None:
    # Current 2 is previous 1; current 1 and 3 are new.
    ids0, ids1 = module._number(decision([L.STATIC, L.DISAPPEARED], [0, 0, 0], [(1, 2)]), 2, 3)

    assert ids0.tolist() == [0, 1, 2]
    assert ids1.tolist() == [0, 3, 1, 4]


@pytest.mark.parametrize(("count0", "count1"), [(0, 0), (0, 2), (2, 0)])
def test_numbers_where_a_visit_has_no_objects(count0: int, count1: int) -> None:
    ids0, ids1 = module._number(decision([0] * count0, [0] * count1), count0, count1)

    assert [*ids0[1:], *ids1[1:]] == list(range(1, count0 + count1 + 1))
    assert ids0[0] == ids1[0] == 0


IDS0, IDS1 = np.array([0, 1, 2], np.int32), np.array([0, 3, 1], np.int32)


def test_belief_has_a_row_per_submap_and_255_for_what_was_not_met() -> None:
    conclusion = SimpleNamespace(
        decisions=(
            decision([L.UNKNOWN, L.UNKNOWN], [NOT_MET, NOT_MET]),
            decision([L.STATIC, L.UNKNOWN], [L.UNKNOWN, L.STATIC]),
            decision([L.STATIC, L.DISAPPEARED], [L.APPEARED, L.STATIC], [(1, 2)]),
        )
    )

    belief = module._belief(conclusion, IDS0, IDS1, 3)

    assert belief.tolist() == [
        [L.UNKNOWN, L.UNKNOWN, NOT_MET],
        [L.STATIC, L.UNKNOWN, L.UNKNOWN],
        [L.STATIC, L.DISAPPEARED, L.APPEARED],
    ]
    assert belief.dtype == np.uint8


def test_label_is_settled_by_the_submap_from_which_on_it_held() -> None:
    # Object 1 wavers; object 2 stays unknown; object 3 is right from when it is met.
    rows = [
        ([L.STATIC, L.UNKNOWN], [NOT_MET, L.STATIC]),
        ([L.MOVED, L.UNKNOWN], [L.APPEARED, L.MOVED]),
        ([L.STATIC, L.UNKNOWN], [L.APPEARED, L.STATIC]),
        ([L.STATIC, L.UNKNOWN], [L.APPEARED, L.STATIC]),
    ]
    conclusion = SimpleNamespace(decisions=tuple(decision(*row) for row in rows))

    assert module._settled(conclusion, (IDS0, IDS1)) == {1: 2, 3: 1}


def test_label_that_never_changed_was_settled_in_the_first_submap() -> None:
    conclusion = SimpleNamespace(decisions=(decision([L.STATIC, L.DISAPPEARED], [L.APPEARED, L.STATIC]),) * 3)

    assert module._settled(conclusion, (IDS0, IDS1)) == {1: 0, 2: 0, 3: 0}
