"""Inspectors' decisions as an append-only journal: undo, audit and conflicts are replays of it."""

from __future__ import annotations

from oasisview.review.events import ConflictError, Decision, Event, FinalLabel, Kind
from oasisview.review.journal import REVIEW_FILE, Journal

__all__ = ["REVIEW_FILE", "ConflictError", "Decision", "Event", "FinalLabel", "Journal", "Kind"]
