"""What every export format has in common: a result together with what inspectors made of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from oasisview.review import Decision, FinalLabel, Journal, Kind
from pipeline.result import ChangeLabel, Result


@dataclass(frozen=True)
class ReviewedResult:
    """A result and the decisions about it, as of one moment.

    Attributes:
        final: final label of every object, by object id.
        notes: notes that were not taken back, in the order they were written.
    """

    result: Result
    final: Mapping[int, FinalLabel]
    notes: tuple[Decision, ...] = ()

    @classmethod
    def of(cls, result: Result) -> ReviewedResult:
        """The result with the decisions in its journal; without a journal the machine's labels stand."""
        with Journal.of(result) as journal:
            notes = tuple(d for d in journal.decisions() if d.kind is Kind.NOTE and not d.undone)
            return cls(result, journal.final_labels(), notes)

    def label_of_object(self) -> NDArray[np.uint8]:
        """Final label code indexed by object id; background (0) is static."""
        table = np.full(self._size, int(ChangeLabel.STATIC), dtype=np.uint8)
        for object_id, final in self.final.items():
            table[object_id] = int(final.label)
        return table

    def confidence_of_object(self) -> NDArray[np.float32]:
        """Confidence indexed by object id: 1 for background and for labels that a person set or accepted."""
        table = np.ones(self._size, dtype=np.float32)
        for item in self.result.objects:
            if self.final[item.object_id].decided_by is None:
                table[item.object_id] = item.confidence
        return table

    @property
    def _size(self) -> int:
        return max((item.object_id for item in self.result.objects), default=0) + 1


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

    def write(self, reviewed: ReviewedResult, out_path: Path) -> None:
        """Write atomically.

        Raises:
            StorageError: writing failed; what stood at ``out_path`` is as it was.
            InputError: what stands at ``out_path`` must not be replaced.
        """
