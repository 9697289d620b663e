"""The state that follows from a sequence of events: pure replay, no file and no clock.

Undo with several inspectors: a person takes back their own decisions only, latest first, whatever object they
were about; a new decision of theirs ends what they could redo. The final label of an object is the
latest decision about it that is not undone, whoever made it: undoing an older decision under somebody
else's newer one changes nothing until that one is undone too, and a redone decision returns to its old
place in the order instead of overruling what others decided meanwhile.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping

from oasisview.review.events import Decision, Event, FinalLabel, Kind
from pipeline.errors import ResultError
from pipeline.result import ChangeLabel

_DECISIONS = (Kind.LABEL, Kind.ACCEPT, Kind.NOTE)


class Replay:
    """Grows event by event; every question is answered from memory."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self._undone: set[int] = set()
        self._done: dict[str, list[int]] = defaultdict(list)  # per person, what undo takes back next is last
        self._redoable: dict[str, list[int]] = defaultdict(list)
        self._labels: dict[int, list[int]] = defaultdict(list)  # per object, decisions that carry a label
        self._touched: dict[int, list[int]] = defaultdict(list)  # per object, events that concern its label

    @property
    def last_event_id(self) -> int:
        """Number of the latest event; 0 without any."""
        return len(self.events)

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
        if event.kind in _DECISIONS:
            self._done[event.who].append(event.id)
            self._redoable[event.who].clear()
            if event.kind is not Kind.NOTE:
                self._labels[event.object_id].append(event.id)
                self._touched[event.object_id].append(event.id)
        else:
            undo = event.kind is Kind.UNDO
            expected = self.undoable(event.who) if undo else self.redoable(event.who)
            if expected is None or expected.id != event.target_id:
                raise _damaged(f"event {event.id} does not follow from the ones before it")
            source, target = (self._done, self._redoable) if undo else (self._redoable, self._done)
            target[event.who].append(source[event.who].pop())
            (self._undone.add if undo else self._undone.discard)(expected.id)
            if expected.kind is not Kind.NOTE:
                self._touched[event.object_id].append(event.id)
        self.events.append(event)

    def undoable(self, who: str) -> Event | None:
        """The decision that undo would take back."""
        return self.event(self._done[who][-1]) if self._done.get(who) else None

    def redoable(self, who: str) -> Event | None:
        """The decision that redo would restore."""
        return self.event(self._redoable[who][-1]) if self._redoable.get(who) else None

    def standing(self, object_id: int, *, without: int = 0, restored: int = 0) -> Event | None:
        """The decision that gives the object its label; None = the machine's stands.

        Args:
            without: a decision to think away (what undo would leave).
            restored: an undone decision to think back (what redo would give).
        """
        for event_id in reversed(self._labels.get(object_id, ())):
            if event_id != without and (event_id not in self._undone or event_id == restored):
                return self.event(event_id)
        return None

    def latest_by_others(self, object_id: int, who: str) -> Event | None:
        """Somebody else's latest event about the object's label."""
        touched = reversed(self._touched.get(object_id, ()))
        return next((self.event(i) for i in touched if self.event(i).who != who), None)

    def decision(self, event_id: int) -> Decision:
        """A label, acceptance or note with its present state."""
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
            undone=event.id in self._undone,
        )

    def decisions(self) -> tuple[Decision, ...]:
        """All labels, acceptances and notes in the order in which they were made."""
        return tuple(self.decision(event.id) for event in self.events if event.kind in _DECISIONS)

    def final_labels(self, machine: Mapping[int, ChangeLabel]) -> dict[int, FinalLabel]:
        """Final label of every object in ``machine`` (the machine's labels by object id)."""
        final = {}
        for object_id, label in machine.items():
            event = self.standing(object_id)
            if event is None:
                final[object_id] = FinalLabel(label, overridden=False)
            else:
                final[object_id] = FinalLabel(
                    event.new_label, event.new_label != label, event.who, event.at, event.why, event.id
                )
        return final


def _damaged(what: str) -> ResultError:
    return ResultError(
        f"the journal of decisions is damaged: {what}", "restore review.sqlite from a copy or move it away"
    )
