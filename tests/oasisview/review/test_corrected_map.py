"""What follows from corrections, against numbers worked out by hand from the boxes of the small result."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from oasisview.review import CorrectedMap, Event, Fragment, Group, Kind, MachineMap, corrections
from oasisview.review.corrected_map import corrected_map
from oasisview.review.corrections import Correction
from oasisview.review.fragments import decode, encode
from pipeline.errors import InputError
from pipeline.result import ChangeLabel, Result

STATIC, APPEARED, GONE, MOVED = (
    ChangeLabel.STATIC, ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED, ChangeLabel.MOVED,
)  # fmt: skip
L = ChangeLabel


@pytest.fixture
def machine(small_result: Result) -> MachineMap:
    return MachineMap.of(small_result)


def event(number: int, correction: Correction, who: str = "ann") -> Event:
    return Event(
        number, "2026-03-10T08:00:00.000+00:00", who, correction.kind, correction.object_id,
        L.UNKNOWN, L.UNKNOWN, "because", None, correction.groups,
    )  # fmt: skip


def label(number: int, object_id: int, value: ChangeLabel, *groups: Group, who: str = "ann") -> Event:
    at = "2026-03-10T08:00:00.000+00:00"
    return Event(number, at, who, Kind.LABEL, object_id, L.UNKNOWN, value, "", None, groups)


def state_of(machine: MachineMap, *steps) -> CorrectedMap:
    """Apply corrections, each made on the state that the ones before it gave."""
    events: list[Event] = []
    for step in steps:
        correction = step(corrected_map(machine, events))
        events.append(event(len(events) + 1, correction))
    return corrected_map(machine, events)


def members(*names: str) -> frozenset[Fragment]:
    return frozenset(Fragment(*map(int, name.split("."))) for name in names)


def test_without_corrections_everything_is_the_machines(machine: MachineMap, small_result: Result) -> None:
    state = corrected_map(machine, [])
    assert tuple(entry.item for entry in state.objects.values()) == small_result.objects
    assert state.replaced == small_result.replaced and not state.is_corrected
    for session in small_result.sessions:
        assert (state.table(session.index)[session.object_ids] == session.object_ids).all()


def test_the_same_object_in_place_is_static_and_no_longer_replaced(machine: MachineMap) -> None:
    state = state_of(machine, lambda s: corrections.same(s, 8, 7))
    entry = state.objects[7]
    assert entry.members == members("8.0", "7.1") and 8 not in state.objects
    assert entry.item.label is STATIC  # centroids 5 cm apart, tau_d is 10 cm
    assert entry.item.displacement_m == pytest.approx(0.05)
    assert [s.session for s in entry.item.sightings] == [0, 1]
    assert entry.item.replaced_by is None and entry.item.replaces is None and state.replaced == ()
    assert (entry.final.decided_by, entry.final.why, entry.final.overridden) == ("ann", "because", True)
    assert len(state.objects) == 11 and state.table(0)[8] == 7 and state.table(1)[7] == 7
    row, column = entry.item.sightings[0].instance, entry.item.sightings[1].instance
    assert entry.item.sigma == pytest.approx(float(machine.score_matrix.sigma[row, column]), abs=1e-6)


def test_the_same_object_elsewhere_has_moved_by_the_distance_of_its_centroids(machine: MachineMap) -> None:
    state = state_of(machine, lambda s: corrections.same(s, 12, 9))
    entry = state.objects[9]
    assert (entry.item.label, entry.machine_ids) == (MOVED, (9, 12))
    # (3.7, 1.3, 0.25) to (6.4, 1.0, 0.2)
    assert entry.item.displacement_m == pytest.approx((2.7**2 + 0.3**2 + 0.05**2) ** 0.5, abs=1e-5)
    assert entry.item.rotation_rad is None and entry.item.T_world_motion is None


def test_a_person_may_say_moved_where_the_distance_says_static(machine: MachineMap) -> None:
    state = state_of(machine, lambda s: corrections.same(s, 8, 7, MOVED))
    assert state.objects[7].item.label is STATIC
    assert state.objects[7].final.label is MOVED


def test_these_are_two_makes_one_gone_and_one_new(machine: MachineMap) -> None:
    state = state_of(machine, lambda s: corrections.split_visits(s, 4))
    # Fragments of the later visit have the numbers behind the last object: 1 -> 13, ... 4 -> 16.
    old, new = state.objects[4], state.objects[16]
    assert (old.members, new.members) == (members("4.0"), members("4.1"))
    assert (old.final.label, new.final.label) == (GONE, APPEARED)
    assert old.item.displacement_m is None and new.item.T_world_motion is None
    assert old.item.sightings[0].centroid_world_m == (2.3, 0.9, 0.2)
    assert new.item.sightings[0].centroid_world_m == (3.1, 0.7, 0.2)
    assert old.item.counterpart_instance == machine.objects[4].sightings[1].instance
    assert state.present_id(16) == 16 and corrected_map(machine, []).present_id(16) == 4


def test_a_wrong_match_is_put_right_in_one_step(machine: MachineMap) -> None:
    # The machine said 5 moved here from elsewhere; in truth it is 9 that stands here now.
    state = state_of(machine, lambda s: corrections.same(s, 9, 5))
    assert state.objects[9].members == members("9.0", "5.1") and state.objects[9].item.label is MOVED
    assert state.objects[5].members == members("5.0")
    assert state.objects[5].final.label is GONE and state.objects[5].final.decided_by == "ann"


def test_merged_pieces_are_weighed_by_their_points_and_take_over_a_replaced_event(
    machine: MachineMap,
) -> None:
    state = state_of(machine, lambda s: corrections.merge(s, (6, 7)))
    item = state.objects[6].item
    assert item.label is APPEARED and state.objects[6].machine_ids == (6, 7)
    (sighting,) = item.sightings
    assert sighting.point_count == 980 + 1321
    expected = (980 * np.array([2.4, 2.2, 0.6]) + 1321 * np.array([4.5, 2.3, 0.45])) / 2301
    np.testing.assert_allclose(sighting.centroid_world_m, expected, atol=1e-5)
    np.testing.assert_allclose(sighting.box_min_world_m, (2.2, 2.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(sighting.box_max_world_m, (4.75, 2.55, 1.2), atol=1e-9)
    # 8 stands in 4.2..4.8 x 2.05..2.55 x 0..0.8: all but 5 cm of its length is inside.
    (replaced,) = state.replaced
    assert (replaced.disappeared_id, replaced.appeared_id) == (8, 6)
    assert replaced.overlap == pytest.approx(0.55 / 0.6, abs=1e-5)
    assert state.objects[8].item.replaced_by == 6 and item.replaces == 8


def test_the_largest_matched_pair_leads_when_a_fragment_is_added(machine: MachineMap) -> None:
    state = state_of(machine, lambda s: corrections.merge(s, (2, 6)))
    item = state.objects[2].item
    assert (item.label, item.displacement_m) == (STATIC, 0.0)  # the fragment bends its centroid by 40 cm
    moved = state_of(machine, lambda s: corrections.merge(s, (4, 12))).objects[4].item
    assert (moved.label, moved.displacement_m) == (MOVED, machine.objects[4].displacement_m)


def test_what_is_no_object_is_background_and_ends_its_replaced_event(machine: MachineMap) -> None:
    state = state_of(machine, lambda s: corrections.drop(s, 7))
    assert 7 not in state.objects and [d.object_id for d in state.dropped] == [7]
    assert state.dropped[0].event.who == "ann" and state.table(1)[7] == 0 and state.present_id(7) is None
    assert state.replaced == () and state.objects[8].item.replaced_by is None
    assert state.objects[8].final.decided_by is None  # nobody decided anything about 8
    back = state_of(machine, lambda s: corrections.drop(s, 7), lambda s: corrections.keep(s, 7))
    assert back.objects == corrected_map(machine, []).objects and back.replaced == machine.replaced


def test_a_merged_object_can_be_taken_apart_or_parted_by_visit(machine: MachineMap) -> None:
    pieces = state_of(
        machine, lambda s: corrections.merge(s, (8, 9, 12)), lambda s: corrections.take_apart(s, 8)
    )
    assert pieces.objects == corrected_map(machine, []).objects
    parted = state_of(
        machine, lambda s: corrections.merge(s, (8, 9, 12)), lambda s: corrections.split_visits(s, 8)
    )
    assert parted.objects[8].members == members("8.0", "9.0") and parted.objects[8].final.label is GONE
    assert parted.objects[12].members == members("12.1") and parted.objects[12].final.label is APPEARED


def test_labels_belong_to_exactly_what_they_were_given_to(machine: MachineMap) -> None:
    merged = corrections.merge(corrected_map(machine, []), (6, 12))
    both = Group(members("6.1", "12.1"))
    events = [label(1, 6, STATIC), event(2, merged, "ben"), label(3, 6, MOVED, both, who="cem")]
    assert corrected_map(machine, events).objects[6].final.label is MOVED
    assert (
        corrected_map(machine, events[:2]).objects[6].final.label is APPEARED
    )  # the pair was never labelled
    kept = corrected_map(machine, [events[0], events[2]])  # Ben took his merge back; Cem's label needs it
    assert kept.objects[6].members == both.members and kept.objects[6].final.label is MOVED
    assert kept.objects[6].cause == events[2] and 12 not in kept.objects
    alone = corrected_map(machine, [events[1], label(3, 12, STATIC)])  # as if Ben's merge was redone below it
    assert alone.objects[12].final.label is STATIC and alone.objects[6].members == members("6.1")


def test_an_overridden_label_pairs_and_unpairs_replaced_events(machine: MachineMap) -> None:
    away = corrected_map(machine, [label(1, 7, STATIC)])
    assert away.replaced == () and away.objects[8].item.replaced_by is None
    assert corrected_map(machine, [label(1, 6, GONE)]).replaced == machine.replaced


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda s: corrections.merge(s, (6, 6)), "alone cannot be merged"),
        (lambda s: corrections.merge(s, (6, 99)), "no object 99"),
        (lambda s: corrections.same(s, 6, 6), "this object itself"),
        (lambda s: corrections.same(s, 6, 7), "seen on the same visits"),
        (lambda s: corrections.same(s, 4, 5), "seen on the same visits"),
        (lambda s: corrections.split_visits(s, 6), "one visit only"),
        (lambda s: corrections.take_apart(s, 4), "was not merged"),
        (lambda s: corrections.drop(s, 0), "no object 0"),
        (lambda s: corrections.keep(s, 4), "nobody said"),
    ],
)
def test_what_makes_no_sense_is_refused(machine: MachineMap, wrong, message: str) -> None:
    with pytest.raises(InputError, match=message):
        wrong(corrected_map(machine, []))


def test_groups_survive_the_journals_text() -> None:
    groups = (Group(members("4.0", "12.1"), MOVED), Group(members("7.1"), is_object=False))
    assert decode(encode(groups)) == groups and decode(encode(())) == ()
    for broken in ("{", "[1]", '[{"of":["x"]}]', '[{"of":[]}]', '[{"of":["1.0"],"label":9}]', '{"of":1}'):
        with pytest.raises(ValueError):
            decode(broken)


def test_parts_that_a_new_result_lacks_are_ignored(machine: MachineMap) -> None:
    ghost = Correction(Kind.MERGE, 6, (Group(members("6.1", "500.0")),), (6, 500))
    state = corrected_map(machine, [event(1, ghost)])
    assert state.objects[6].members == members("6.1") and len(state.objects) == 12
    assert sum(len(e.members) for e in state.objects.values()) == len(machine.number_of)


def test_numbers_of_fragments_are_unique_and_stable(machine: MachineMap) -> None:
    numbers = list(machine.number_of.values())
    assert len(numbers) == len(set(numbers)) == 17 and max(numbers) == 17
    assert all(machine.number_of[machine.fragment_of[n]] == n for n in numbers)
    for one, two in itertools.combinations(machine.members.values(), 2):
        assert not one & two
