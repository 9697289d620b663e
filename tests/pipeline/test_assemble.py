"""Identity numbers, belief after every submap, and what settled a label."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline import assemble as module
from pipeline.association.accumulation import AccumulatedAssociation
from pipeline.association.object_registration import rotation_about
from pipeline.change.decide import Conclusion
from pipeline.change.decision import NOT_MET, Decision, Identity, VisitEvidence
from pipeline.change.evidence import ObjectEvidence
from pipeline.result import ChangeLabel as L
from pipeline.result import MapObject, Sighting
from pipeline.settings import Settings


def decision(labels0: list[int], labels1: list[int], identities: list[tuple[int, int]] = ()) -> Decision:
    """Labels of the instances (background is added in front)."""
    full0, full1 = np.array([L.STATIC, *labels0]), np.array([L.STATIC, *labels1])
    tied = tuple(Identity(previous, current, 1.0) for previous, current in identities)
    odds = (np.zeros(len(full0)), np.zeros(len(full1)))
    return Decision(tied, full0, full1, np.ones(len(full0)), np.ones(len(full1)), odds, odds)


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


def visit(count: int) -> VisitEvidence:
    """Objects of which nothing but the number is known."""
    columns = {f.name: np.zeros(count + 1) for f in dataclasses.fields(ObjectEvidence)}
    return VisitEvidence(ObjectEvidence(**columns), np.zeros(count + 1), np.ones(count + 1, bool))


def sighting(session: int, instance: int, centroid: tuple[float, float, float]) -> Sighting:
    return Sighting(session, instance - 1, centroid, centroid, centroid, 100, 1.0, (0,))


def one_object(
    before: tuple[float, float, float], after: tuple[float, float, float], T: np.ndarray | None
) -> MapObject:
    """The first object of a previous visit of one and a current visit of two, seen in both as instance 2."""
    final = Decision(
        (Identity(1, 2, 0.8, T),),
        np.array([1, L.MOVED]),
        np.array([1, 2, L.MOVED]),
        np.ones(2),
        np.ones(3),
        (np.zeros(2), np.zeros(3)),
        (np.zeros(2), np.zeros(3)),
    )
    settings = Settings()
    association = AccumulatedAssociation(1, 2, settings.association)
    conclusion = Conclusion((final,), visit(1), visit(2), association, (), 0.1)
    ids = module._number(final, 1, 2)
    seen = ([sighting(0, 1, before)], [sighting(1, 1, (9, 9, 9)), sighting(1, 2, after)])
    objects = module._objects(ids, seen, conclusion, settings)
    assert [o.object_id for o in objects] == [1, 2]
    assert objects[1].T_world_motion is objects[1].rotation_rad is objects[1].displacement_m is None
    return objects[0]


def test_motion_tells_displacement_and_rotation_whatever_part_of_the_object_was_seen() -> None:
    # A quarter turn about the vertical through (1, 0, 0), then 2 m along x. The current visit saw the far
    # end only: its centroid is another point's.
    R = rotation_about(np.array([0.0, 0, 1]), np.pi / 2)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, np.array([1.0, 0, 0]) - R @ [1.0, 0, 0] + [2.0, 0, 0]

    found = one_object((1.0, 0.0, 0.5), (3.0, 0.7, 0.5), T)

    assert found.displacement_m == pytest.approx(2.0)
    assert found.rotation_rad == pytest.approx(np.pi / 2, abs=1e-6)
    assert np.array(found.T_world_motion) == pytest.approx(T, abs=1e-6)
    assert found.label is L.MOVED
    assert found.counterpart_instance == 1


def test_without_a_motion_the_centroids_tell_the_displacement_and_nothing_the_rotation() -> None:
    found = one_object((1.0, 0.0, 0.5), (3.0, 0.0, 0.5), None)

    assert found.displacement_m == pytest.approx(2.0)
    assert found.rotation_rad is None
    assert found.T_world_motion is None


def test_turn_on_the_spot_is_no_displacement() -> None:
    R = rotation_about(np.array([0.0, 0, 1]), 1.0)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, np.array([1.0, 2, 0]) - R @ [1.0, 2, 0]

    found = one_object((1.0, 2.0, 0.5), (1.3, 2.0, 0.5), T)

    assert found.displacement_m == pytest.approx(0, abs=1e-6)
    assert found.rotation_rad == pytest.approx(1.0, abs=1e-6)
