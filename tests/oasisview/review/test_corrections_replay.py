"""Any sequence of corrections, labels, undos, redos and restored states by several people."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from oasisview.review import CorrectedMap, Event, Kind, MachineMap, corrections
from oasisview.review.fragments import Group
from oasisview.review.machine_map import _bare_object
from oasisview.review.replay import Replay
from pipeline.errors import InputError
from pipeline.result import ChangeLabel, Sighting

PEOPLE = ("ann", "ben")


def sighting(session: int, at: float, points: int) -> Sighting:
    low, high = (at, 0.0, 0.0), (at + 0.5, 0.5, 0.5)
    return Sighting(session, 0, (at + 0.25, 0.25, 0.25), low, high, points, 1.0, (0,))


def make_machine() -> MachineMap:
    seen = {
        1: (ChangeLabel.STATIC, (sighting(0, 0.0, 10), sighting(1, 0.0, 12))),
        2: (ChangeLabel.MOVED, (sighting(0, 1.0, 10), sighting(1, 3.0, 12))),
        3: (ChangeLabel.DISAPPEARED, (sighting(0, 5.0, 7),)),
        4: (ChangeLabel.APPEARED, (sighting(1, 5.1, 9),)),
        5: (ChangeLabel.UNKNOWN, (sighting(1, 9.0, 3),)),
    }
    return MachineMap(
        {i: replace(_bare_object(i, label), sightings=places) for i, (label, places) in seen.items()}
    )


MACHINE = make_machine()
ACTS = ("merge", "same", "split", "apart", "drop", "keep", "label", "undo", "redo", "restore")
STEPS = st.lists(
    st.tuples(
        st.sampled_from(PEOPLE), st.sampled_from(ACTS), st.integers(0, 20), st.integers(0, 20)
    ),
    max_size=25,
)  # fmt: skip


def written(replay: Replay, who: str, act: str, one: int, two: int) -> Event | None:
    """The event that an act gives on the present state; None where it makes no sense."""
    state = replay.state()
    number = replay.last_event_id + 1
    unknown = ChangeLabel.UNKNOWN
    blank = Event(number, "2026", who, Kind.NOTE, 0, unknown, unknown, "", None)
    if act in ("undo", "redo"):
        target = replay.undoable(who) if act == "undo" else replay.redoable(who)
        return target and replace(blank, kind=Kind(act), object_id=target.object_id, target_id=target.id)
    if act == "restore":
        return replace(blank, kind=Kind.RESTORE, target_id=(one % number) or None)
    ids = list(state.objects) or [1]
    first, second = ids[one % len(ids)], ids[two % len(ids)]
    if act == "label":
        members = state.objects[first].members if first in state.objects else None
        label = ChangeLabel(two % 5)
        return members and replace(
            blank, kind=Kind.LABEL, object_id=first, new_label=label, groups=(Group(members),)
        )
    try:
        made = {
            "merge": lambda: corrections.merge(state, (first, second)),
            "same": lambda: corrections.same(state, first, second),
            "split": lambda: corrections.split_visits(state, first),
            "apart": lambda: corrections.take_apart(state, first),
            "drop": lambda: corrections.drop(state, first),
            "keep": lambda: corrections.keep(state, state.dropped[0].object_id if state.dropped else 0),
        }[act]()
    except InputError:
        return None
    return replace(blank, kind=made.kind, object_id=made.object_id, groups=made.groups)


def run(steps) -> tuple[Replay, list[CorrectedMap]]:
    replay = Replay(MACHINE)
    states = [replay.state()]
    for step in steps:
        event = written(replay, *step)
        if event is not None:
            replay.apply(event)
            states.append(replay.state())
    return replay, states


def whole(state: CorrectedMap) -> dict:
    return {number: (entry.members, entry.final.label) for number, entry in state.objects.items()}


@settings(max_examples=120, deadline=None)
@given(STEPS)
def test_nothing_gets_lost_and_replaying_again_gives_the_same(steps) -> None:
    replay, states = run(steps)
    for state in states:
        parts = [f for entry in state.objects.values() for f in entry.members]
        parts += [f for entry in state.dropped for f in entry.members]
        assert sorted(parts) == sorted(MACHINE.number_of)
        assert set(state.object_of) == set(MACHINE.number_of)
        for number, entry in state.objects.items():
            assert entry.item.object_id == number
            assert number == min(MACHINE.number_of[f] for f in entry.members)
            assert {s.session for s in entry.item.sightings} == {f.session for f in entry.members}
        for event in state.replaced:
            assert state.objects[event.disappeared_id].final.label is ChangeLabel.DISAPPEARED
            assert state.objects[event.appeared_id].final.label is ChangeLabel.APPEARED
    again = Replay(MACHINE)
    for event, state in zip(replay.events, states[1:], strict=True):
        again.apply(event)
        assert again.state() == state


@settings(max_examples=120, deadline=None)
@given(STEPS)
def test_undoing_everything_gives_the_machines_result(steps) -> None:
    replay, states = run(steps)
    for _ in range(4 * len(steps) + 4):
        act = next((who for who in PEOPLE if replay.undoable(who)), None)
        if act is None:
            break
        replay.apply(written(replay, act, "undo", 0, 0))
    assert replay.standing == frozenset()
    assert replay.state() == states[0] and not replay.state().is_corrected


@settings(max_examples=120, deadline=None)
@given(STEPS, st.integers(0, 25))
def test_a_restored_state_is_that_state_and_can_be_undone(steps, back: int) -> None:
    replay, states = run(steps)
    back %= len(states)
    assert replay.state_of(replay.standing_after(back)) == states[back]
    replay.apply(written(replay, "cem", "restore", back, 0))
    assert replay.state() == states[back]
    replay.apply(written(replay, "cem", "undo", 0, 0))
    assert replay.state() == states[-1]
    replay.apply(written(replay, "cem", "redo", 0, 0))
    assert replay.state() == states[back]


@settings(max_examples=80, deadline=None)
@given(STEPS)
def test_undo_then_redo_changes_nothing(steps) -> None:
    replay, states = run(steps)
    if replay.undoable("ann") is not None:
        replay.apply(written(replay, "ann", "undo", 0, 0))
        replay.apply(written(replay, "ann", "redo", 0, 0))
    assert whole(replay.state()) == whole(states[-1])
