"""The state that follows from a sequence of events: pure replay, no file and no clock.

Undo with several inspectors: a person takes back their own decisions only, latest first, whatever object they
were about; a new decision of theirs ends what they could redo. The final label of an object is the
latest decision about it that is not undone, whoever made it: undoing an older decision under somebody
else's newer one changes nothing until that one is undone too, and a redone decision returns to its old
place in the order instead of overruling what others decided meanwhile. Corrections obey the same rules, and a
label keeps the object that it was given to (``oasisview.review.corrected_map`` says what follows from the
decisions that stand).

Restoring an earlier state is a decision like any other: it makes exactly those decisions stand that stood
then, and undoing it brings back what it took away and takes away what it brought back.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from oasisview.review.corrected_map import CorrectedMap, corrected_map
from oasisview.review.events import DECISIONS, Decision, Event, Kind
from oasisview.review.fragments import Fragment, Members, all_members
from oasisview.review.machine_map import MachineMap
from pipeline.errors import ResultError


@dataclass(frozen=True)
class Change:
    """Decisions that begin to count (``brought``) and that end to (``taken``), by number."""

    brought: frozenset[int]
    taken: frozenset[int]


class Replay:
    """Grows event by event; every question is answered from memory.

    Args:
        machine: what the decisions are about.
    """

    def __init__(self, machine: MachineMap) -> None:
        self.machine = machine
        self.events: list[Event] = []
        self._standing: set[int] = set()
        self._redoable: dict[str, list[int]] = defaultdict(list)
        self._own: dict[str, list[int]] = defaultdict(list)  # a person's decisions, ascending
        self._restored: dict[int, Change] = {}  # what each restored state changed
        self._changes: list[Change] = []  # what each event changed, so that any earlier state can be found
        self._touched: dict[Fragment, list[int]] = defaultdict(list)  # events that concern a fragment
        self._state: CorrectedMap | None = None

    @property
    def last_event_id(self) -> int:
        """Number of the latest event; 0 without any."""
        return len(self.events)

    @property
    def standing(self) -> frozenset[int]:
        """Numbers of the decisions that count."""
        return frozenset(self._standing)

    def event(self, event_id: int) -> Event:
        """The event of that number."""
        return self.events[event_id - 1]

    def apply(self, event: Event) -> None:
        """Take in the next event.

        Raises:
            ResultError: the event cannot follow the ones before it, so rows were removed or altered.
        """
        if event.id != len(self.events) + 1:
            raise _damaged(f"event {len(self.events) + 1} is missing")
        if event.kind in DECISIONS:
            if event.kind is Kind.RESTORE:
                self._prepare_restore(event)
            self._own[event.who].append(event.id)
            self._redoable[event.who].clear()
            self._count(event, stands=True)
        else:
            undo = event.kind is Kind.UNDO
            expected = self.undoable(event.who) if undo else self.redoable(event.who)
            if expected is None or expected.id != event.target_id:
                raise _damaged(f"event {event.id} does not follow from the ones before it")
            if undo:
                self._redoable[event.who].append(expected.id)
            else:
                waiting = self._redoable[event.who]
                del waiting[waiting.index(expected.id) :]
            self._count(expected, stands=not undo, told_by=event)
        self.events.append(event)
        self._state = None

    # Undo, redo, restore

    def undoable(self, who: str) -> Event | None:
        """The decision that undo would take back."""
        found = next((i for i in reversed(self._own.get(who, ())) if i in self._standing), None)
        return None if found is None else self.event(found)

    def redoable(self, who: str) -> Event | None:
        """The decision that redo would restore."""
        found = next((i for i in reversed(self._redoable.get(who, ())) if i not in self._standing), None)
        return None if found is None else self.event(found)

    def standing_after(self, event_id: int) -> frozenset[int]:
        """The decisions that stood after an event; 0 = before the first one."""
        standing = self.standing
        for change in reversed(self._changes[event_id:]):
            standing = (standing - change.brought) | change.taken
        return standing

    def restoring(self, event_id: int) -> Change:
        """What going back to the state after an event would change."""
        wanted = self.standing_after(event_id)
        return Change(wanted - self.standing, self.standing - wanted)

    def _prepare_restore(self, event: Event) -> None:
        if (event.target_id or 0) >= event.id:
            raise _damaged(f"event {event.id} goes back to what comes after it")
        self._restored[event.id] = self.restoring(event.target_id or 0)

    def _count(self, decision: Event, *, stands: bool, told_by: Event | None = None) -> None:
        change = self._change_of(decision, stands=stands)
        if decision.kind is Kind.RESTORE:
            # What was really changed: others may have turned some of it meanwhile, and that is theirs.
            own = frozenset({decision.id})
            brought, taken = (change.brought, change.taken) if stands else (change.taken, change.brought)
            self._restored[decision.id] = Change(brought - own, taken)
        self._standing.difference_update(change.taken)
        self._standing.update(change.brought)
        self._changes.append(change)
        for fragment in self.fragments(decision):
            self._touched[fragment].append((told_by or decision).id)

    def _change_of(self, decision: Event, *, stands: bool) -> Change:
        """What it changes that a decision begins to count, or ends."""
        brought, taken = frozenset({decision.id}), frozenset[int]()
        if decision.kind is Kind.RESTORE:
            restored = self._restored[decision.id]
            brought, taken = brought | restored.brought, restored.taken
        if not stands:
            brought, taken = taken, brought
        return Change(brought - self._standing, taken & self._standing)

    # What follows

    def state(self) -> CorrectedMap:
        """The map with everything applied that stands."""
        if self._state is None:
            self._state = self.state_of(self._standing)
        return self._state

    def state_of(self, standing: Iterable[int]) -> CorrectedMap:
        """The map that a set of decisions gives."""
        return corrected_map(self.machine, [self.event(i) for i in sorted(standing)])

    def state_with(self, decision: Event) -> CorrectedMap:
        """The map that a further decision would give."""
        return corrected_map(self.machine, [*self.standing_events(), decision])

    def state_if_turned(self, decision: Event, *, stands: bool) -> CorrectedMap:
        """The map that undo (``stands`` False) or redo (True) of a decision would give."""
        change = self._change_of(decision, stands=stands)
        return self.state_of((self._standing - change.taken) | change.brought)

    def fragments(self, event: Event) -> Members:
        """The fragments that a decision is about; those of a restored state are all that it changes."""
        if event.kind is Kind.NOTE:
            return frozenset()
        if event.kind is Kind.RESTORE:
            change = self._restored[event.id]
            return frozenset().union(*(self.fragments(self.event(i)) for i in change.taken | change.brought))
        if event.groups:
            return all_members(event.groups)
        return self.machine.members.get(event.object_id, frozenset({Fragment(event.object_id, 0)}))

    def concerned_by(self, event: Event) -> Members:
        """The fragments that an event changes something about, undo and redo included."""
        if event.kind in (Kind.UNDO, Kind.REDO):
            return self.fragments(self.event(event.target_id or 0))
        return self.fragments(event)

    def latest_by_others(self, fragments: Iterable[Fragment], who: str) -> Event | None:
        """Somebody else's latest event that concerns any of the fragments."""
        latest = max(
            (
                next((i for i in reversed(self._touched.get(f, ())) if self.event(i).who != who), 0)
                for f in fragments
            ),
            default=0,
        )
        return self.event(latest) if latest else None

    def decision(self, event_id: int) -> Decision:
        """A decision with its present state."""
        event = self.event(event_id)
        return Decision(
            event_id=event.id,
            at=event.at,
            who=event.who,
            kind=event.kind,
            object_id=event.object_id,
            old_label=event.old_label,
            new_label=event.new_label,
            why=event.why,
            undone=event.id not in self._standing,
            groups=event.groups,
        )

    def decisions(self) -> tuple[Decision, ...]:
        """Everything but undo and redo, in the order in which it was done."""
        return tuple(self.decision(event.id) for event in self.events if event.kind in DECISIONS)

    def standing_events(self) -> Sequence[Event]:
        """The decisions that count, in the order in which they were made."""
        return [self.event(i) for i in sorted(self._standing)]


def _damaged(what: str) -> ResultError:
    return ResultError(
        f"the journal of decisions is damaged: {what}", "restore review.sqlite from a copy or move it away"
    )
