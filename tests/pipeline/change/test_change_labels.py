"""Equation 8 and the decisions built on it, on objects whose evidence is written down by hand."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from pipeline.association.accumulation import AccumulatedAssociation
from pipeline.association.aggregation import MatchEvidence
from pipeline.association.cloud_agreement import ObjectRegistration
from pipeline.association.moves import FEATURES, ScoredMove
from pipeline.change.confidence import NO_MOVE_LOG_ODDS, confidence_features, label_confidence
from pipeline.change.decision import (
    NOT_MET,
    Decision,
    VisitEvidence,
    decide_by_association,
    decide_by_evidence,
)
from pipeline.change.evidence import ObjectEvidence
from pipeline.change.labels import labels_from_association
from pipeline.change.move_choice import MoveChoice
from pipeline.change.replaced import bounds_overlap, find_replaced
from pipeline.result import ChangeLabel as L
from pipeline.settings import AssociationSettings, ChangeSettings, Settings

GATES = AssociationSettings(tau_sigma=0.3, tau_s=0.85)
CHANGE = ChangeSettings(tau_d_m=0.1, nu_min=0.5, same_place_overlap=0.1)
SETTINGS = Settings(change=CHANGE)


def eq8(pairs, x0, x1, nu0, nu1) -> tuple[list[int], list[int]]:
    at0, at1 = (np.array([[x, 0, 0] for x in xs], float).reshape(-1, 3) for xs in (x0, x1))
    labels = labels_from_association(pairs, at0, at1, np.array(nu0, float), np.array(nu1, float), 0.1, 0.5)
    return labels[0].tolist(), labels[1].tolist()


def test_eq8_every_branch_by_hand() -> None:
    # Previous: 0 stays, 1 moves by 0.5 m, 2 is gone, 3 was never looked at again. Current likewise.
    labels = eq8([(0, 1), (1, 0)], [0, 1, 2, 3], [1.5, 0.05, 5, 6], [1, 1, 0.8, 0.4], [1, 1, 0.8, 0.4])

    assert labels[0] == [L.STATIC, L.MOVED, L.DISAPPEARED, L.UNKNOWN]
    assert labels[1] == [L.MOVED, L.STATIC, L.APPEARED, L.UNKNOWN]


@pytest.mark.parametrize(("x", "label"), [(0.1, L.STATIC), (0.1001, L.MOVED)])
def test_eq8_displacement_threshold_belongs_to_static(x: float, label: L) -> None:
    assert eq8([(0, 0)], [0.0], [x], [1], [1]) == ([label], [label])


@pytest.mark.parametrize(("nu", "label"), [(0.5, L.DISAPPEARED), (0.4999, L.UNKNOWN)])
def test_eq8_coverage_threshold_belongs_to_the_decision(nu: float, label: L) -> None:
    assert eq8([], [0.0], [], [nu], []) == ([label], [])


def test_eq8_matched_objects_need_no_coverage() -> None:
    assert eq8([(0, 0)], [0.0], [0.0], [0.1], [0.1]) == ([L.STATIC], [L.STATIC])


def visit(
    x: list[float],
    coverage: list[float] | float = 1.0,
    seen_through: list[float] | float = 0.0,
    changed: list[bool] | bool = False,
    is_met: list[bool] | bool = True,
    background: tuple[float, bool] = (-5.0, True),
    log_odds: list[float] | None = None,
) -> VisitEvidence:
    """Objects at the given places along x; ``background`` = its log odds and whether it was met.

    ``log_odds`` of a change, where 5 for the changed and -5 for the others will not do.
    """
    n = len(x)

    def column(values: object, first: float) -> np.ndarray:
        return np.concatenate([[first], np.broadcast_to(np.asarray(values, float), n)])

    given = {
        "voxel_count": np.full(n + 1, 100),
        "coverage": column(coverage, 1.0),
        "seen_through": column(seen_through, 0.9 if background[0] > 0 else 0.0),
        "compared_count": np.full(n + 1, 50),
        "texture_correlation": np.ones(n + 1),
        "centroid_world": np.array([[-9.0, 0, 0], *([place, 0, 0] for place in x)]),
    }
    fields = {f.name: given.get(f.name, np.zeros(n + 1)) for f in dataclasses.fields(ObjectEvidence)}
    odds = np.where(column(changed, 0) > 0, 5.0, -5.0) if log_odds is None else column(log_odds, 0)
    odds[0] = background[0]
    return VisitEvidence(ObjectEvidence(**fields), odds, column(is_met, background[1]) > 0)


def association(n: int, m: int, links: dict[tuple[int, int], tuple[int, float]], leaving: int = 10):
    evidence = MatchEvidence.empty(n, m)
    evidence.leaving_count[:] = leaving
    for (row, column), (count, score) in links.items():
        evidence.link_count[row, column], evidence.link_score[row, column] = count, count * score
        evidence.arriving_count[column] += count
    accumulated = AccumulatedAssociation(n, m, GATES)
    accumulated.add_submap(evidence)
    return accumulated


def test_paper_rule_defers_case_2_until_the_last_submap() -> None:
    before, now = visit([0.0]), visit([0.0])
    partial = association(1, 1, {(0, 0): (4, 0.95)}, leaving=40)

    early = decide_by_association(before, now, partial, CHANGE, is_final=False)
    final = decide_by_association(before, now, partial, CHANGE, is_final=True)

    assert (early.labels0[1], early.labels1[1]) == (L.UNKNOWN, L.UNKNOWN)
    assert (final.labels0[1], final.labels1[1]) == (L.DISAPPEARED, L.APPEARED)


def test_paper_rule_labels_lookalikes_changed_at_once() -> None:
    alike = association(1, 1, {(0, 0): (9, 0.6)})

    decision = decide_by_association(visit([0.0]), visit([0.0]), alike, CHANGE, is_final=False)

    assert (decision.labels0[1], decision.labels1[1]) == (L.DISAPPEARED, L.APPEARED)
    assert decision.identities == ()


def test_paper_rule_ties_identities_by_association() -> None:
    decision = decide_by_association(
        visit([0.0, 3.0]), visit([3.4]), association(2, 1, {(1, 0): (9, 0.9)}), CHANGE, is_final=True
    )

    assert decision.labels0.tolist() == [L.STATIC, L.DISAPPEARED, L.MOVED]
    assert decision.labels1.tolist() == [L.STATIC, L.MOVED]
    assert [(i.previous, i.current) for i in decision.identities] == [(2, 1)]
    assert decision.confidence1[1] == pytest.approx(0.9)


def move(previous: int, current: int, log_odds: float = 2.0, x_m: float = 2.0) -> ScoredMove:
    """A move along x."""
    T = np.eye(4)
    T[0, 3] = x_m
    registration = ObjectRegistration(T, 0.9, 0.9, 0.9, 0.5, 0.1, 0.1, 0.9, 0.2, 0.0)
    return ScoredMove(previous, current, registration, np.zeros(len(FEATURES)), log_odds)


def no_moves(before, now) -> tuple[np.ndarray, np.ndarray]:
    return np.full(before.count + 1, NO_MOVE_LOG_ODDS), np.full(now.count + 1, NO_MOVE_LOG_ODDS)


def by_evidence(before, now, overlap=None, moves=()) -> Decision:
    overlap = np.zeros((before.count, now.count)) if overlap is None else np.array(overlap, float)
    return decide_by_evidence(
        before,
        now,
        overlap,
        lambda left, taken, stayed: [
            m
            for m in moves
            if m.previous in left and m.current in taken and (m.previous, m.current) not in stayed
        ],
        no_moves(before, now),
        SETTINGS,
    )


def test_evidence_rule_by_hand() -> None:
    # Previous: 1 stays, 2 is gone, 3 out of sight, 4 leaves. Current: 1 stays, 2 is new, 3 is where 4 went.
    before = visit(
        [0, 1, 2, 3],
        coverage=[1, 1, 0.2, 1],
        seen_through=[0, 0.9, 0, 0.9],
        changed=[False, True, False, True],
    )
    now = visit([0, 5, 7], seen_through=[0, 0.1, 0.9], changed=[False, True, True])
    overlap = np.zeros((4, 3))
    overlap[0, 0] = 0.7

    decision = by_evidence(before, now, overlap, moves=[move(4, 3)])

    assert decision.labels0.tolist() == [L.STATIC, L.STATIC, L.DISAPPEARED, L.UNKNOWN, L.MOVED]
    assert decision.labels1.tolist() == [L.STATIC, L.STATIC, L.APPEARED, L.MOVED]
    assert {(i.previous, i.current) for i in decision.identities} == {(1, 1), (4, 3)}
    for confidence in (decision.confidence0, decision.confidence1):
        assert ((confidence >= 0) & (confidence <= 1)).all()


def test_move_gives_identity_and_motion() -> None:
    before = visit([0.0], seen_through=0.9, changed=True)
    now = visit([2.0], seen_through=0.9, changed=True)

    decision = by_evidence(before, now, moves=[move(1, 1, log_odds=1.5)])

    (identity,) = decision.identities
    assert (identity.previous, identity.current) == (1, 1)
    assert identity.T_world_motion[:3, 3].tolist() == [2.0, 0, 0]
    features = confidence_features(np.array([5.0]), np.ones(1), np.array([100]), np.array([1.5]))
    (expected,) = label_confidence(np.array([L.MOVED]), features, SETTINGS.confidence)
    assert decision.confidence0[1] == decision.confidence1[1] == pytest.approx(expected)
    assert decision.move_log_odds[0][1] == decision.move_log_odds[1][1] == 1.5


def test_what_two_visits_say_of_one_place_is_averaged() -> None:
    # 5 and -5 of objects of one size: neither side is believed alone, and 0 is no change.
    before, now = visit([0.0], changed=True), visit([0.0])

    apart = by_evidence(before, now, [[0.4]])
    together = by_evidence(before, now, [[0.6]])

    assert (apart.labels0[1], apart.labels1[1]) == (L.DISAPPEARED, L.STATIC)
    assert together.log_odds[0][1] == together.log_odds[1][1] == pytest.approx(0.0)
    assert (together.labels0[1], together.labels1[1]) == (L.STATIC, L.STATIC)


def moved_if_possible(before: VisitEvidence, now: VisitEvidence) -> bool:
    decision = by_evidence(before, now, moves=[move(1, 1)])
    moved = [labels[1] == L.MOVED for labels in (decision.labels0, decision.labels1)]
    assert moved[0] == moved[1] == (len(decision.identities) == 1)
    return moved[0]


def test_doubtful_change_may_move_and_a_sure_stay_may_not() -> None:
    least = SETTINGS.moves.least_change_log_odds
    gone = visit([0.0], changed=True)

    assert moved_if_possible(gone, visit([2.0], log_odds=[least + 0.01]))
    assert moved_if_possible(visit([0.0], log_odds=[least + 0.01]), visit([2.0], changed=True))
    assert not moved_if_possible(gone, visit([2.0], log_odds=[least]))
    assert not moved_if_possible(visit([0.0], log_odds=[least]), visit([2.0], changed=True))


@pytest.mark.parametrize(("log_odds", "overlap", "label"), [(-0.5, 0.2, L.STATIC), (-0.5, 0.05, L.MOVED)])
def test_what_hardly_looks_changed_at_its_own_place_has_not_moved_a_little(log_odds, overlap, label) -> None:
    nudged = [move(1, 1, x_m=0.15)]

    doubtful = by_evidence(
        visit([0.0], log_odds=[log_odds]), visit([0.0], log_odds=[log_odds]), [[overlap]], nudged
    )
    clear = by_evidence(visit([0.0], log_odds=[0.5]), visit([0.0], log_odds=[0.5]), [[overlap]], nudged)

    assert (doubtful.labels0[1], doubtful.labels1[1]) == (label, label)
    assert (clear.labels0[1], clear.labels1[1]) == (L.MOVED, L.MOVED)


def test_pair_that_stayed_is_not_chosen() -> None:
    visits, found = (visit([0.0]), visit([0.0])), move(1, 1)

    assert MoveChoice([found], visits, SETTINGS)({1}, {1}, {(1, 1)}) == []


def test_what_was_not_met_did_not_move() -> None:
    assert not moved_if_possible(visit([0.0], changed=True), visit([2.0], changed=True, is_met=False))


@pytest.mark.parametrize(("left", "taken", "seen"), [(0.49, 0.49, False), (0.5, 0, True), (0, 1, True)])
def test_one_of_the_two_places_of_a_move_was_observed(left: float, taken: float, seen: bool) -> None:
    visits = visit([0.0], coverage=[left]), visit([0.0], coverage=[taken])
    found = move(1, 1)

    assert MoveChoice([found], visits, SETTINGS)({1}, {1}, set()) == ([found] if seen else [])


def test_object_that_moved_is_not_tied_to_what_stands_at_its_place() -> None:
    # Both were doubtful; before moves were looked for, the two first objects shared a place.
    before, now = visit([0.0], log_odds=[-0.5]), visit([0.0, 2.0], log_odds=[-5.0, -0.5])

    decision = by_evidence(before, now, [[0.4, 0.0]], moves=[move(1, 2)])

    assert [(i.previous, i.current) for i in decision.identities] == [(1, 2)]
    assert decision.labels1.tolist() == [L.STATIC, L.STATIC, L.MOVED]


def test_objects_of_one_place_are_one_and_nothing_says_how_they_moved() -> None:
    (identity,) = by_evidence(visit([0.0]), visit([0.0]), [[0.8]]).identities

    assert (identity.previous, identity.current, identity.T_world_motion) == (1, 1, None)
    assert identity.confidence == pytest.approx(0.8)


def test_same_place_identities_are_one_to_one() -> None:
    decision = by_evidence(visit([0, 0.1]), visit([0.0]), [[0.6], [0.5]])

    assert [(i.previous, i.current) for i in decision.identities] == [(1, 1)]


def test_objects_not_met_yet_have_no_label_and_no_identity() -> None:
    decision = by_evidence(visit([0.0]), visit([0.0], is_met=False), [[0.9]])

    assert decision.labels1.tolist() == [L.STATIC, NOT_MET]
    assert decision.identities == ()


@pytest.mark.parametrize("background", [(5.0, True), (-5.0, False), (5.0, False)])
def test_background_is_no_object_whatever_its_evidence(background: tuple[float, bool]) -> None:
    # A background that changed, or that nobody met yet, once cost the first object its identity.
    before = visit([0.0, 4.0], background=background)
    now = visit([0.0, 4.0], background=background)
    asked: list[tuple[set[int], set[int]]] = []

    decision = decide_by_evidence(
        before,
        now,
        np.diag([0.8, 0.8]),
        lambda left, taken, _: asked.append((left, taken)) or [],
        no_moves(before, now),
        SETTINGS,
    )

    assert {(i.previous, i.current) for i in decision.identities} == {(1, 1), (2, 2)}
    assert asked == [(set(), set())]
    assert decision.labels0[0] == decision.labels1[0] == L.STATIC


def box(x: float, size: float = 1.0) -> tuple[list[float], list[float]]:
    return [x, 0, 0], [x + size, size, size]


def corners(*boxes: tuple[list[float], list[float]]) -> tuple[np.ndarray, np.ndarray]:
    return np.array([low for low, _ in boxes], float), np.array([high for _, high in boxes], float)


def test_overlap_of_bounds_is_a_share_of_the_smaller() -> None:
    overlap = bounds_overlap(*corners(box(0), box(5)), *corners(box(0.75), box(0, 0.5)))

    assert overlap == pytest.approx(np.array([[0.25, 1.0], [0.0, 0.0]]))


def test_replaced_events_are_one_to_one_largest_overlap_first() -> None:
    gone, new = corners(box(0), box(0.5)), corners(box(0.1), box(0.9))

    events = find_replaced(*gone, *new, 0.25)

    # 0-0 share 0.9; then 1-1 share 0.6 (1-0 also 0.6, but 0 is taken).
    assert [(e.disappeared, e.appeared) for e in events] == [(0, 0), (1, 1)]
    assert [e.overlap for e in events] == pytest.approx([0.9, 0.6])


def test_places_that_hardly_touch_replace_nothing() -> None:
    assert find_replaced(*corners(box(0)), *corners(box(0.8)), 0.25) == []
    nobody = (np.zeros((0, 3)), np.zeros((0, 3)))
    assert find_replaced(*nobody, *corners(box(0)), 0.25) == []
    assert find_replaced(*corners(box(0)), *nobody, 0.25) == []
