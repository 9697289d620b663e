"""What every export format has in common: a result together with what inspectors made of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from oasisview.review import CorrectedMap, Decision, Event, FinalLabel, Journal, Kind, corrected_result
from pipeline.progress import ProgressEvent, Report, silent
from pipeline.result import ChangeLabel, MapObject, ReplacedEvent, Result, SessionResult

STAGE = "export"  # of the progress that exporters report
CHUNK_POINTS = 1_000_000


@dataclass(frozen=True)
class ReviewedResult:
    """A result and the decisions about it, as of one moment.

    Exporters read objects, their points and their pixels here and nowhere else, so that whatever people
    corrected reaches every format.

    Attributes:
        result: with corrections applied: its objects, replaced events, points and masks are what people
            made of those that the machine found; ``corrected.machine`` holds the machine's.
        final: final label of every object of ``result``, by object id.
        notes: notes that were not taken back, in the order they were written.
        events: the whole journal, oldest first.
        corrected: what every object is made of, and what is no object.
    """

    result: Result
    final: Mapping[int, FinalLabel]
    notes: tuple[Decision, ...]
    events: tuple[Event, ...]
    corrected: CorrectedMap

    @classmethod
    def of(cls, result: Result) -> ReviewedResult:
        """The result with the decisions in its journal; without a journal the machine's labels stand."""
        with Journal.of(result) as journal:
            notes = tuple(d for d in journal.decisions() if d.kind is Kind.NOTE and not d.undone)
            corrected, events = journal.corrected(), journal.changes_since(0)
        final = {number: entry.final for number, entry in corrected.objects.items()}
        return cls(corrected_result(result, corrected), final, notes, events, corrected)

    def machine_label(self, object_id: int) -> ChangeLabel:
        """The machine's label of an object; of a corrected one that of its largest fragment."""
        machine = self.corrected.machine
        largest = max(sorted(self.corrected.objects[object_id].members), key=machine.points)
        return machine.objects[largest.object_id].label

    def notes_of(self, object_id: int) -> tuple[Decision, ...]:
        """The notes about an object, those included that were about what it is made of."""
        return tuple(n for n in self.notes if self.corrected.present_id(n.object_id) == object_id)

    @property
    def objects(self) -> tuple[MapObject, ...]:
        """All objects, ascending by id."""
        return self.result.objects

    @property
    def replaced(self) -> tuple[ReplacedEvent, ...]:
        """Pairs of objects of which one took the place of the other."""
        return self.result.replaced

    def object_ids(self, session: SessionResult, chosen: slice = slice(None)) -> NDArray[np.int32]:
        """Object of each map point of a visit, 0 = background; only ``chosen`` points are read."""
        return np.asarray(session.object_ids[chosen])

    def object_mask(self, session: SessionResult, k: int) -> NDArray[np.uint16]:
        """Object of every second pixel of a keyframe; see ``SessionResult.object_mask``."""
        return session.object_mask(k)

    def label_of_object(self) -> NDArray[np.uint8]:
        """Final label code indexed by object id; background (0) is static."""
        table = np.full(self._size, int(ChangeLabel.STATIC), dtype=np.uint8)
        for object_id, final in self.final.items():
            table[object_id] = int(final.label)
        return table

    def confidence_of_object(self) -> NDArray[np.float32]:
        """Confidence indexed by object id: 1 for background and for labels that a person set or accepted."""
        table = np.ones(self._size, dtype=np.float32)
        for item in self.objects:
            if self.final[item.object_id].decided_by is None:
                table[item.object_id] = item.confidence
        return table

    @property
    def _size(self) -> int:
        return max((item.object_id for item in self.objects), default=0) + 1


def point_chunks(reviewed: ReviewedResult) -> Iterator[tuple[SessionResult, slice]]:
    """All map points of all visits, a part at a time, so that a map of any size fits in memory."""
    for session in reviewed.result.sessions:
        for start in range(0, len(session.points_world), CHUNK_POINTS):
            yield session, slice(start, start + CHUNK_POINTS)


def chunk_count(reviewed: ReviewedResult) -> int:
    """How many parts ``point_chunks`` gives."""
    return sum(-(-len(session.points_world) // CHUNK_POINTS) for session in reviewed.result.sessions)


class Steps:
    """Progress of one export: ``step`` after each of ``total`` parts."""

    def __init__(self, report: Report, total: int) -> None:
        self._report, self._total, self._done = report, max(total, 1), 0
        report(ProgressEvent(STAGE, 0, self._total))

    def step(self) -> None:
        """One part is written."""
        self._done += 1
        self._report(ProgressEvent(STAGE, min(self._done, self._total), self._total))


class Exporter(Protocol):
    """One export format.

    Attributes:
        name: what the command and the page call it.
        suffix: of the file it writes; empty when it writes a folder.
        summary: what is written, for people.
    """

    name: str
    suffix: str
    summary: str

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write atomically; ``report`` hears of the stage ``STAGE``.

        Raises:
            StorageError: writing failed; what stood at ``out_path`` is as it was.
            InputError: what stands at ``out_path`` must not be replaced.
        """
