"""Inspectors' decisions as an append-only journal: undo, audit and conflicts are replays of it."""

from __future__ import annotations

from oasisview.review.corrected_map import CorrectedMap, CorrectedObject, DroppedObject
from oasisview.review.corrected_result import corrected_result
from oasisview.review.events import CORRECTIONS, ConflictError, Decision, Event, FinalLabel, Kind
from oasisview.review.fragments import Fragment, Group
from oasisview.review.journal import REVIEW_FILE, Journal
from oasisview.review.machine_map import MachineMap

__all__ = [
    "CORRECTIONS",
    "REVIEW_FILE",
    "ConflictError",
    "CorrectedMap",
    "CorrectedObject",
    "Decision",
    "DroppedObject",
    "Event",
    "FinalLabel",
    "Fragment",
    "Group",
    "Journal",
    "Kind",
    "MachineMap",
    "corrected_result",
]
