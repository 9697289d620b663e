"""What corrections, conflicts and the journal say about identities, in an inspector's words: plain text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from oasisview import wording
from oasisview.review import CorrectedMap, Event, Kind, MachineMap
from oasisview.review.corrections import Correction
from oasisview.review.disagreement import Opinion
from oasisview.review.fragments import Members
from oasisview.wording import LABEL_NAMES
from pipeline.result import ChangeLabel

PICK_WORDS = {
    Kind.SAME: "Click the other object in the map, a picture or the queue: which one is the same as {name}?",
    Kind.MERGE: "Click the other object in the map, a picture or the queue: which one is a piece of {name}?",
}


def parts(machine: MachineMap, members: Members) -> str:
    """Fragments by the machine's numbers: "#6 and #12", "#4 before and #9 now"."""
    names = []
    for object_id in sorted({fragment.object_id for fragment in members}):
        own = machine.members.get(object_id, frozenset())
        if own <= members and not _is_mixed(members):
            names.append(f"#{object_id}")
        else:
            visits = sorted(f.session for f in members if f.object_id == object_id)
            names += [f"#{object_id} {_when(visit)}" for visit in visits]
    return _listed(names)


def event_words(event: Event, machine: MachineMap, target: Event | None = None) -> str:
    """What an event of the journal did, without who and when; ``target`` is what undo and redo are about."""
    new, old = LABEL_NAMES[event.new_label], LABEL_NAMES[event.old_label]
    match event.kind:
        case Kind.ACCEPT:
            return f"accepted as {new}"
        case Kind.LABEL:
            return f"{old} \u2192 {new}"
        case Kind.NOTE:
            return "note"
        case Kind.UNDO | Kind.REDO:
            word = "undone" if event.kind is Kind.UNDO else "redone"
            if target is None or target.kind in (Kind.LABEL, Kind.ACCEPT):
                return f"{word}, {new} again"
            return f"{word}: {event_words(target, machine)}"
        case Kind.RESTORE:
            return (
                f"back to how it was after entry {event.target_id}"
                if event.target_id
                else "back to what the machine found"
            )
        case Kind.WHAT_IF:
            many = len(event.groups)
            return f"other limits applied to {many} object{'' if many == 1 else 's'}"
        case Kind.DROP:
            return f"not an object: {_parts_of(event, machine)}"
        case Kind.KEEP:
            return f"an object after all: {_parts_of(event, machine)} ({new})"
        case Kind.SPLIT:
            return f"not one object but {len(event.groups)}: {_groups(event, machine)}"
        case Kind.SAME:
            return f"{parts(machine, event.groups[0].members)} are the same object: {new}"
        case _:
            return f"{parts(machine, event.groups[0].members)} are pieces of one object: {new}"


def cause_words(event: Event, machine: MachineMap) -> str:
    """What made an object other than the machine found it."""
    if event.kind in (Kind.LABEL, Kind.ACCEPT):
        # The correction that it was based on was taken back; the label still says what is one object.
        named = parts(machine, event.groups[0].members) if event.groups else f"#{event.object_id}"
        return f"{named} decided upon as one object"
    return event_words(event, machine)


def opinion_words(opinion: Opinion, machine: MachineMap, *, alone: bool) -> str:
    """What one person says; ``alone`` = all voices mean the same object, so its label is enough."""
    if not opinion.is_object:
        return f"{opinion.who} says it is not an object"
    label = LABEL_NAMES[opinion.label] if opinion.label is not None else ""
    if alone and label:
        return f"{opinion.who} says {label}"
    named = parts(machine, opinion.members)
    one = "is one object" if " and " not in named else "are one object"
    return f"{opinion.who} says {named} {one}{f', {label}' if label else ''}"


def disagreement_words(opinions: Sequence[Opinion], machine: MachineMap) -> str:
    """A sentence for opinions that contradict each other; empty without any."""
    if not opinions:
        return ""
    alone = len({opinion.members for opinion in opinions}) == 1
    voices = ", ".join(opinion_words(opinion, machine, alone=alone) for opinion in opinions)
    return f"Inspectors disagree: {voices}. The latest decision counts."


def will_happen(correction: Correction, before: CorrectedMap, after: CorrectedMap) -> str:
    """The sentence above the button that makes a correction: what it will change, dependents included."""
    machine = before.machine
    fragments = [fragment for group in correction.groups for fragment in group.members]
    numbers = sorted(after.concerned(fragments))
    first = correction.groups[0].members
    number = next(iter(after.concerned(first)), 0)
    match correction.kind:
        case Kind.DROP:
            said = (
                f"{_object(before, correction.object_id)} is dropped: its points become background, and it "
                "leaves the queue and the lists of the exports."
            )
        case Kind.KEEP:
            said = f"#{number} is an object again: {_became(after, number)}."
        case Kind.SPLIT:
            named = [f"#{n}, {_became(after, n)}" for n in numbers]
            said = f"Object #{correction.object_id} becomes {len(numbers)} objects: {_listed(named)}."
        case Kind.SAME:
            said = (
                f"{parts(machine, first)} become one object, #{number}: {_became(after, number)}"
                f"{_distance(after, number)}."
            )
            for left in numbers:
                if left != number:
                    said += f" What else was taken for it becomes #{left}: {_became(after, left)}."
        case _:
            said = (
                f"Objects {_listed([f'#{n}' for n in correction.concerned])} become one object, #{number}: "
                f"{_became(after, number)}."
            )
    return said + _replaced_changes(before, after)


def restore_words(event_id: int, taken: Iterable[Event], brought: Iterable[Event]) -> str:
    """What going back to an earlier state will do."""
    taken, brought = list(taken), list(brought)
    where = f"after entry {event_id}" if event_id else "before the first entry, as the machine found it"
    said = f"Everything will count as it did {where}."
    if taken:
        said += f" {_counted(len(taken))} will no longer count ({_by_person(taken)})."
    if brought:
        said += f" {_counted(len(brought))} taken back since will count again ({_by_person(brought)})."
    return said + " Nothing is erased: this becomes an entry of its own, and undo brings everything back."


def _counted(number: int) -> str:
    return "1 decision" if number == 1 else f"{number} decisions"


def _by_person(events: Iterable[Event]) -> str:
    return ", ".join(f"{count} of {who}" for who, count in Counter(event.who for event in events).items())


def _replaced_changes(before: CorrectedMap, after: CorrectedMap) -> str:
    was = {(e.disappeared_id, e.appeared_id) for e in before.replaced}
    now = {(e.disappeared_id, e.appeared_id) for e in after.replaced}
    gone = [f" #{a} no longer counts as replaced by #{b}." for a, b in sorted(was - now)]
    new = [f" #{a} now counts as replaced by #{b}." for a, b in sorted(now - was)]
    return "".join(gone + new)


def _distance(state: CorrectedMap, number: int) -> str:
    entry = state.objects.get(number)
    distance = entry.item.displacement_m if entry is not None else None
    if entry is None or distance is None:
        return ""
    limit = wording.length(state.machine.tau_d_m)
    apart = wording.length(distance)
    if entry.item.label is ChangeLabel.MOVED:
        return f", {apart} away (up to {limit} counts as in place)"
    return f", {apart} from where it was (up to {limit} counts as in place)"


def _became(state: CorrectedMap, number: int) -> str:
    return LABEL_NAMES[state.objects[number].final.label] if number in state.objects else "no object"


def _object(state: CorrectedMap, number: int) -> str:
    label = f" ({_became(state, number)})" if number in state.objects else ""
    return f"Object #{number}{label}"


def _parts_of(event: Event, machine: MachineMap) -> str:
    return parts(machine, event.groups[0].members) if event.groups else f"#{event.object_id}"


def _groups(event: Event, machine: MachineMap) -> str:
    return _listed(
        [
            parts(machine, group.members)
            + (f" ({LABEL_NAMES[group.label]})" if group.label is not None else "")
            for group in event.groups
        ]
    )


def _is_mixed(members: Members) -> bool:
    """Whether objects of single visits are joined over the visits, so that saying when helps."""
    by_object: dict[int, set[int]] = {}
    for fragment in members:
        by_object.setdefault(fragment.object_id, set()).add(fragment.session)
    return len(by_object) > 1 and len({frozenset(v) for v in by_object.values()}) > 1


def _when(session: int) -> str:
    return ("before", "now")[session] if session < 2 else f"on visit {session + 1}"


def _listed(names: Sequence[str]) -> str:
    if len(names) < 2:
        return "".join(names)
    return f"{', '.join(names[:-1])} and {names[-1]}"
