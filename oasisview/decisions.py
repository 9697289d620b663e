"""What has been decided about an open result, shared by all browsers that look at it.

Writes go to the journal first; only then does anybody see them. Other processes' decisions are followed
by asking the journal once a second.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from oasisview.correction_words import cause_words, disagreement_words
from oasisview.review import (
    CorrectedMap,
    CorrectedObject,
    Decision,
    Event,
    Fragment,
    Group,
    Journal,
    Kind,
    MachineMap,
)
from oasisview.review.corrections import Correction
from oasisview.review.disagreement import Opinion
from oasisview.review.replay import Change
from pipeline.errors import OasisError
from pipeline.result import ChangeLabel, Result

POLL_S = 1.0
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Verdict:
    """A person's standing decision about an object.

    ``accepted`` = the machine's label was confirmed; ``at`` is UTC in ISO 8601; ``correction`` = what was
    said about which pieces are one object, empty where the object is as the machine found it.
    """

    label: ChangeLabel
    accepted: bool
    who: str
    at: str
    reason: str
    correction: str = ""


Listener = Callable[[frozenset[int]], None]


class SharedDecisions:
    """The journal of a result, its present state, and who wants to hear of changes.

    Methods may be called from any thread and touch the disk: never call them on the event loop.
    """

    def __init__(self, result: Result) -> None:
        self._journal = Journal.of(result)
        self._listeners: list[Listener] = []
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._take(self._journal.last_event_id)
        self._poller = threading.Thread(target=self._poll, name="oasisview-decisions", daemon=True)
        self._poller.start()

    @property
    def verdicts(self) -> Mapping[int, Verdict]:
        """Standing decisions by object id; a snapshot that never changes under the reader."""
        return self._verdicts

    @property
    def corrected(self) -> CorrectedMap:
        """The map with all decisions applied; a snapshot."""
        return self._corrected

    @property
    def disagreements(self) -> Mapping[int, tuple[Opinion, ...]]:
        """Opinions that contradict each other, by object id; a snapshot."""
        return self._disagreements

    @property
    def undone(self) -> frozenset[int]:
        """Numbers of the decisions that do not count at present; a snapshot."""
        return self._undone

    @property
    def last_event_id(self) -> int:
        """The last event that :attr:`verdicts` includes."""
        return self._last_event_id

    def label_of(self, object_id: int) -> ChangeLabel:
        """Final label of an object: the inspector's, else the machine's."""
        verdict = self._verdicts.get(object_id)
        if verdict is not None:
            return verdict.label
        entry = self._corrected.objects.get(object_id)
        return entry.item.label if entry is not None else ChangeLabel.UNKNOWN

    def history(self) -> tuple[Event, ...]:
        """Every event of the journal, oldest first."""
        return self._journal.changes_since(0)

    def disagreement(self, object_id: int | None) -> str:
        """A sentence if people's standing decisions about an object differ, else empty."""
        opinions = self._disagreements.get(object_id, ()) if object_id is not None else ()
        return disagreement_words(opinions, self._corrected.machine)

    def subscribe(self, listener: Listener) -> None:
        """Call ``listener`` with the objects that changed, on whatever thread noticed."""
        with self._lock:
            self._listeners.append(listener)

    def unsubscribe(self, listener: Listener) -> None:
        """Stop calling it."""
        with self._lock:
            if listener in self._listeners:
                self._listeners.remove(listener)

    def decide(
        self, object_id: int, label: ChangeLabel, *, who: str, reason: str, seen_event_id: int | None
    ) -> Decision:
        """Store a label; raises as ``Journal.decide``. The decision is on the disk when this returns."""
        entry = self._corrected.objects.get(object_id)
        if entry is not None and label is entry.item.label:
            decision = self._journal.accept(object_id, who=who, why=reason, expected_event_id=seen_event_id)
        else:
            decision = self._journal.decide(
                object_id, label, who=who, why=reason, expected_event_id=seen_event_id
            )
        self.refresh()
        return decision

    def decided_fragments(self) -> frozenset[Fragment]:
        """Everything that a person's standing decision is about, what is no object included."""
        state = self._journal.corrected()
        decided = [entry.members for entry in state.objects.values() if entry.final.decided_by is not None]
        return frozenset().union(*decided, *(entry.members for entry in state.dropped))

    def apply_what_if(
        self, groups: Sequence[Group], *, who: str, reason: str, seen_event_id: int | None
    ) -> Decision:
        """Store what other limits say, as one decision; raises as ``Journal.correct``."""
        leading = min(groups[0].members).object_id
        decision = self._journal.correct(
            Kind.WHAT_IF, leading, groups, who=who, why=reason, expected_event_id=seen_event_id
        )
        self.refresh()
        return decision

    def preview(self, correction: Correction) -> CorrectedMap:
        """The map that a correction would give."""
        return self._journal.preview(correction.kind, correction.object_id, correction.groups)

    def correct(
        self, correction: Correction, *, who: str, reason: str, seen_event_id: int | None
    ) -> Decision:
        """Store a correction; raises as ``Journal.correct``."""
        decision = self._journal.correct(
            correction.kind,
            correction.object_id,
            correction.groups,
            who=who,
            why=reason,
            expected_event_id=seen_event_id,
        )
        self.refresh()
        return decision

    def restoring(self, event_id: int) -> Change:
        """What going back to the state after an event would change."""
        return self._journal.restoring(event_id)

    def restore(self, event_id: int, *, who: str, reason: str, seen_event_id: int | None) -> Decision | None:
        """Go back to the state after an event; raises as ``Journal.restore``."""
        decision = self._journal.restore(event_id, who=who, why=reason, expected_event_id=seen_event_id)
        self.refresh()
        return decision

    def note(self, object_id: int, text: str, *, who: str) -> Decision:
        """Store a remark without a label; raises as ``Journal.note``."""
        decision = self._journal.note(object_id, text, who=who)
        self.refresh()
        return decision

    def undo(self, who: str) -> Decision | None:
        """Take back the person's latest decision; None if there is none."""
        decision = self._journal.undo(who)
        self.refresh()
        return decision

    def redo(self, who: str) -> Decision | None:
        """Restore what the person undid last; None if there is nothing."""
        decision = self._journal.redo(who)
        self.refresh()
        return decision

    def can_undo(self, who: str) -> bool:
        """Whether undo would do something."""
        return self._journal.can_undo(who)

    def can_redo(self, who: str) -> bool:
        """Whether redo would do something."""
        return self._journal.can_redo(who)

    def refresh(self) -> frozenset[int]:
        """Follow the journal; tells the listeners which objects changed, and returns them."""
        with self._lock:
            events = self._journal.changes_since(self._last_event_id)
            if not events:
                return frozenset()
            before = self._corrected
            self._take(events[-1].id)
            fragments = frozenset[Fragment]().union(*(self._journal.fragments_of(e) for e in events))
            # What follows from a decision elsewhere (a replaced event that ends) is drawn anew as well.
            changed = before.concerned(fragments) | self._corrected.concerned(fragments)
            changed |= {event.object_id for event in events if event.object_id}
            listeners = tuple(self._listeners)
        for listener in listeners:
            try:
                listener(changed)
            except Exception:  # one broken page must not keep the others from hearing
                _log.exception("a page could not be refreshed")
        return changed

    def _take(self, last_event_id: int) -> None:
        """Build everything anew that is asked for often; done once per decision, not once per page."""
        state = self._journal.snapshot()
        self._corrected, self._disagreements, self._undone = (
            state.corrected,
            state.disagreements,
            state.undone,
        )
        self._verdicts = {
            number: _verdict(entry, state.corrected.machine)
            for number, entry in state.corrected.objects.items()
            if entry.final.decided_by is not None
        }
        self._last_event_id = last_event_id

    def close(self) -> None:
        """Stop following and let go of the file."""
        self._stop.set()
        self._poller.join(timeout=POLL_S + 5)
        self._journal.close()

    def _poll(self) -> None:
        failed = ""
        while not self._stop.wait(POLL_S):
            try:
                self.refresh()
                failed = ""
            except OasisError as error:
                if str(error) != failed:
                    failed = str(error)
                    _log.warning("%s", error)


def _verdict(entry: CorrectedObject, machine: MachineMap) -> Verdict:
    final = entry.final
    return Verdict(
        label=final.label,
        accepted=not final.overridden,
        who=final.decided_by or "",
        at=final.decided_at or "",
        reason=final.why or "",
        correction="" if entry.cause is None else cause_words(entry.cause, machine),
    )
