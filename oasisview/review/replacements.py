"""Replaced events after corrections: the machine's where they still hold, found anew where they do not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from oasisview.review.machine_map import MachineMap
from pipeline.change.replaced import find_replaced
from pipeline.result import ChangeLabel, MapObject, ReplacedEvent

if TYPE_CHECKING:
    from oasisview.review.corrected_map import CorrectedObject


def final_replaced(machine: MachineMap, objects: Mapping[int, CorrectedObject]) -> tuple[ReplacedEvent, ...]:
    """Events between final labels, in the order of the disappeared objects.

    The machine's events stay where both objects are as it found them and still count as disappeared and
    appeared. Objects that people changed, and those whose partner was lost, are paired anew by the machine's
    own rule; two objects that nobody touched are never paired against it.
    """

    def counts_as(object_id: int, label: ChangeLabel) -> bool:
        entry = objects.get(object_id)
        return entry is not None and entry.final.label is label and entry.cause is None

    kept = [
        event
        for event in machine.replaced
        if counts_as(event.disappeared_id, ChangeLabel.DISAPPEARED)
        and counts_as(event.appeared_id, ChangeLabel.APPEARED)
    ]
    settled = {i for event in kept for i in (event.disappeared_id, event.appeared_id)}
    lost = {i for event in machine.replaced for i in (event.disappeared_id, event.appeared_id)} - settled
    touched = lost | {i for i, entry in objects.items() if entry.cause is not None or entry.final.overridden}
    gone = [e.item for i, e in objects.items() if _free(i, e, settled, ChangeLabel.DISAPPEARED)]
    new = [e.item for i, e in objects.items() if _free(i, e, settled, ChangeLabel.APPEARED)]
    gone = [item for item in gone if item.sightings]
    new = [item for item in new if item.sightings]
    if not touched & {item.object_id for item in (*gone, *new)}:
        return tuple(kept)
    low0, high0, low1, high1 = (
        np.array([getattr(sighting, name) for sighting in _places(group, at)], np.float64).reshape(-1, 3)
        for group, at in ((gone, 0), (new, -1))
        for name in ("box_min_world_m", "box_max_world_m")
    )
    found = [
        ReplacedEvent(gone[e.disappeared].object_id, new[e.appeared].object_id, round(e.overlap, 6))
        for e in find_replaced(low0, high0, low1, high1, machine.replaced_overlap)
    ]
    fresh = [e for e in found if {e.disappeared_id, e.appeared_id} & touched]
    return tuple(sorted((*kept, *fresh), key=lambda event: event.disappeared_id)) if fresh else tuple(kept)


def _free(object_id: int, entry: CorrectedObject, settled: set[int], label: ChangeLabel) -> bool:
    return object_id not in settled and entry.final.label is label


def _places(items: list[MapObject], at: int) -> list:
    return [item.sightings[at] for item in items]
