"""The journal against the simplest model that could be right: lists that are searched anew each time."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from oasisview.review import Journal
from pipeline.result import ChangeLabel

MACHINE = {1: ChangeLabel.STATIC, 2: ChangeLabel.APPEARED}
PEOPLE = st.sampled_from(["ann", "ben"])
OBJECTS = st.sampled_from(sorted(MACHINE))
LABELS = st.sampled_from(list(ChangeLabel))


class JournalMachine(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        self.journal = Journal(self.folder / "review.sqlite", MACHINE)
        self.other = Journal(self.folder / "review.sqlite", MACHINE)  # a second process
        self.model: list[dict] = []  # decisions in order
        self.undone_by: dict[str, list[int]] = {"ann": [], "ben": []}  # what redo restores, last first
        self.events = 0

    def teardown(self) -> None:
        self.journal.close()
        self.other.close()
        shutil.rmtree(self.folder)

    def _made(self, who: str, object_id: int, label: ChangeLabel | None) -> None:
        self.model.append({"who": who, "object": object_id, "label": label, "undone": False})
        self.undone_by[who] = []
        self.events += 1

    @rule(who=PEOPLE, object_id=OBJECTS, label=LABELS, elsewhere=st.booleans())
    def decide(self, who: str, object_id: int, label: ChangeLabel, elsewhere: bool) -> None:
        (self.other if elsewhere else self.journal).decide(object_id, label, who=who)
        self._made(who, object_id, label)

    @rule(who=PEOPLE, object_id=OBJECTS)
    def accept(self, who: str, object_id: int) -> None:
        self.journal.accept(object_id, who=who)
        self._made(who, object_id, MACHINE[object_id])

    @rule(who=PEOPLE, object_id=OBJECTS)
    def note(self, who: str, object_id: int) -> None:
        self.journal.note(object_id, "a note", who=who)
        self._made(who, object_id, None)

    @rule(who=PEOPLE, elsewhere=st.booleans())
    def undo(self, who: str, elsewhere: bool) -> None:
        returned = (self.other if elsewhere else self.journal).undo(who)
        mine = [i for i, made in enumerate(self.model) if made["who"] == who and not made["undone"]]
        assert (returned is None) == (not mine)
        if mine:
            self.model[mine[-1]]["undone"] = True
            self.undone_by[who].append(mine[-1])
            self.events += 1
            assert returned.undone
            assert returned.object_id == self.model[mine[-1]]["object"]

    @rule(who=PEOPLE)
    def redo(self, who: str) -> None:
        returned = self.journal.redo(who)
        assert (returned is None) == (not self.undone_by[who])
        if returned is not None:
            restored = self.undone_by[who].pop()
            self.model[restored]["undone"] = False
            self.events += 1
            assert not returned.undone

    @rule()
    def reopen(self) -> None:
        self.journal.close()
        self.journal = Journal(self.folder / "review.sqlite", MACHINE)

    @invariant()
    def agrees_with_the_model(self) -> None:
        for journal in (self.journal, self.other):
            assert journal.last_event_id == self.events
            assert [d.undone for d in journal.decisions()] == [made["undone"] for made in self.model]
            finals = journal.final_labels()
            for object_id, machine_label in MACHINE.items():
                standing = [
                    made
                    for made in self.model
                    if made["object"] == object_id and not made["undone"] and made["label"] is not None
                ]
                final = finals[object_id]
                assert final.label == (standing[-1]["label"] if standing else machine_label)
                assert final.decided_by == (standing[-1]["who"] if standing else None)
                assert final.overridden == (final.label != machine_label)


JournalMachine.TestCase.settings = settings(max_examples=25, stateful_step_count=25, deadline=None)
TestJournalAgainstModel = JournalMachine.TestCase
