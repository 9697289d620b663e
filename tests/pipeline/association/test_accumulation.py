"""Association within submaps, then globally; case 2 waits for later evidence."""

from __future__ import annotations

import numpy as np

from pipeline.association.accumulation import AccumulatedAssociation
from pipeline.association.aggregation import MatchEvidence
from pipeline.result import MatchCase
from pipeline.settings import AssociationSettings

GATES = AssociationSettings(tau_sigma=0.3, tau_s=0.85)


def submap(links: dict[tuple[int, int], tuple[int, float]], leaving: list[int], m: int) -> MatchEvidence:
    """Evidence of a submap: links (l, k) -> (count, mean score), matches that leave each previous object."""
    evidence = MatchEvidence.empty(len(leaving), m)
    evidence.leaving_count[:] = leaving
    for (row, column), (count, score) in links.items():
        evidence.link_count[row, column] = count
        evidence.link_score[row, column] = count * score
        evidence.arriving_count[column] += count
    return evidence


def test_confident_pair_of_the_first_submap_is_associated_at_once() -> None:
    association = AccumulatedAssociation(1, 1, GATES)
    association.add_submap(submap({(0, 0): (6, 0.9)}, [10], 1))

    assert association.pairs() == [(0, 0)]
    assert association.case(0, 0) is MatchCase.CONFIDENT


def test_case_2_is_deferred_until_later_evidence_resolves_it() -> None:
    association = AccumulatedAssociation(1, 1, GATES)
    association.add_submap(submap({(0, 0): (4, 0.95)}, [40], 1))

    assert association.pairs() == []
    assert association.case(0, 0) is MatchCase.PARTIAL
    assert association.is_deferred(0, 0, set())
    assert association.is_deferred(1, 0, set())

    association.add_submap(submap({(0, 0): (40, 0.95)}, [60], 1))  # 44 of 100 by now

    assert association.pairs() == [(0, 0)]
    assert association.case(0, 0) is MatchCase.CONFIDENT
    assert not association.is_deferred(0, 0, set())


def test_case_2_whose_counterpart_belongs_to_somebody_else_waits_for_nothing() -> None:
    association = AccumulatedAssociation(2, 1, GATES)
    association.add_submap(submap({(0, 0): (30, 0.95), (1, 0): (4, 0.95)}, [40, 40], 1))

    assert association.pairs() == [(0, 0)]
    assert association.is_deferred(0, 1, taken=set())
    assert not association.is_deferred(0, 1, taken={0})


def test_lookalikes_and_strangers_are_rejected_not_deferred() -> None:
    association = AccumulatedAssociation(2, 2, GATES)
    association.add_submap(submap({(0, 0): (20, 0.6), (1, 1): (3, 0.6)}, [30, 30], 2))

    assert association.case(0, 0) is MatchCase.LOOKALIKE
    assert association.case(1, 1) is MatchCase.NONE
    assert association.pairs() == []
    assert not any(association.is_deferred(axis, i, set()) for axis in (0, 1) for i in (0, 1))


def test_one_or_two_stray_links_defer_nothing() -> None:
    association = AccumulatedAssociation(1, 1, GATES)
    association.add_submap(submap({(0, 0): (2, 0.99)}, [40], 1))

    assert not association.is_deferred(0, 0, set())


def test_pair_that_was_confident_in_its_own_submap_survives_later_dilution() -> None:
    # Locally 8 of 10; a later submap sees the object only half hidden, 0 of 90: 8 % overall.
    association = AccumulatedAssociation(1, 1, GATES)
    association.add_submap(submap({(0, 0): (8, 0.9)}, [10], 1))
    association.add_submap(submap({}, [90], 1))

    assert association.evidence.sigma[0, 0] < GATES.tau_sigma
    assert association.pairs() == [(0, 0)]


def test_better_partner_of_a_later_submap_takes_over_globally() -> None:
    # Submap 0 ties previous 0 to current 0; then current 1 comes into view and matches far better.
    association = AccumulatedAssociation(1, 2, GATES)
    association.add_submap(submap({(0, 0): (4, 0.9)}, [10], 2))
    assert association.pairs() == [(0, 0)]

    association.add_submap(submap({(0, 1): (50, 0.95)}, [60], 2))

    assert association.pairs() == [(0, 1)]


def test_global_association_stays_one_to_one() -> None:
    # Each submap alone would tie its previous object to the same current one.
    association = AccumulatedAssociation(2, 1, GATES)
    association.add_submap(submap({(0, 0): (5, 0.9)}, [10, 0], 1))
    association.add_submap(submap({(1, 0): (9, 0.9)}, [0, 10], 1))

    assert association.pairs() == [(1, 0)]


def test_pair_whose_mean_confidence_falls_below_the_gate_is_given_up() -> None:
    association = AccumulatedAssociation(1, 1, GATES)
    association.add_submap(submap({(0, 0): (5, 0.9)}, [10], 1))
    association.add_submap(submap({(0, 0): (45, 0.6)}, [50], 1))

    assert association.pairs() == []
    assert association.case(0, 0) is MatchCase.LOOKALIKE


def test_best_counterpart_is_seen_from_the_objects_own_side() -> None:
    # Previous 0 is large: 30 of its 100 matches reach current 1, which gets 30 of its 60 from it.
    association = AccumulatedAssociation(2, 2, GATES)
    association.add_submap(submap({(0, 1): (30, 0.9), (1, 1): (30, 0.9), (0, 0): (20, 0.9)}, [100, 40], 2))

    assert association.best_counterparts(0).tolist() == [1, 1]
    assert association.best_counterparts(1).tolist() == [0, 0]


def test_objects_without_links_have_no_counterpart() -> None:
    association = AccumulatedAssociation(2, 1, GATES)
    association.add_submap(submap({(0, 0): (3, 0.9)}, [5, 5], 1))

    assert association.best_counterparts(0).tolist() == [0, -1]
    assert not association.is_deferred(0, 1, set())
    for sizes in ((0, 2), (2, 0)):
        nothing = AccumulatedAssociation(*sizes, GATES)
        assert nothing.best_counterparts(0).tolist() == [-1] * sizes[0]
        assert nothing.best_counterparts(1).tolist() == [-1] * sizes[1]
        assert nothing.pairs() == []


def test_two_submaps_give_the_same_evidence_as_one() -> None:
    first = submap({(0, 0): (3, 0.9), (1, 0): (2, 0.7)}, [10, 5], 1)
    second = submap({(0, 0): (5, 0.8)}, [7, 1], 1)
    apart, together = AccumulatedAssociation(2, 1, GATES), AccumulatedAssociation(2, 1, GATES)
    apart.add_submap(first)
    apart.add_submap(second)
    first.merge(second)
    together.add_submap(first)

    for name in ("link_count", "link_score", "leaving_count", "arriving_count"):
        assert np.allclose(getattr(apart.evidence, name), getattr(together.evidence, name))
