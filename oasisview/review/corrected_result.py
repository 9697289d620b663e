"""A result as it is after corrections, behind the same interface: exports and panels need not know of them.

Points and masks get the corrected object ids (0 for what is no object), the objects and replaced events are
the corrected ones; images, heatmaps and patch links are those of the result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oasisview.review.corrected_map import CorrectedMap
from pipeline.result import (
    KeyframeRecord,
    MapObject,
    PatchLinks,
    ReplacedEvent,
    Result,
    ScoreMatrix,
    SessionResult,
)


def corrected_result(result: Result, corrected: CorrectedMap) -> Result:
    """The result with corrections applied; the result itself where there are none."""
    if not corrected.is_corrected and corrected.replaced == result.replaced:
        return result
    return CorrectedResult(result, corrected)


class CorrectedResult:
    """See ``pipeline.result.Result``; ``machine`` is the result as the engine wrote it."""

    def __init__(self, machine: Result, corrected: CorrectedMap) -> None:
        self.machine = machine
        self._corrected = corrected
        self.path: Path = machine.path
        self.schema_version: int = machine.schema_version
        self.manifest: Mapping[str, Any] = machine.manifest
        self.objects: tuple[MapObject, ...] = tuple(entry.item for entry in corrected.objects.values())
        self.replaced: tuple[ReplacedEvent, ...] = corrected.replaced
        self.sessions: tuple[SessionResult, ...] = (
            tuple(CorrectedSession(visit, corrected.table(visit.index)) for visit in machine.sessions)
            if corrected.is_corrected
            else machine.sessions
        )
        matrix = machine.score_matrix
        # The machine's numbers; rows and columns carry the corrected ids, 0 = no object.
        self.score_matrix: ScoreMatrix = replace(
            matrix,
            row_object_ids=_looked_up(corrected.table(0), matrix.row_object_ids),
            column_object_ids=_looked_up(corrected.table(1), matrix.column_object_ids),
        )

    @cached_property
    def belief(self) -> NDArray[np.uint8]:
        """Of every object what was believed of its largest fragment; the last row is the objects' labels."""
        believed = self.machine.belief
        column = {item.object_id: i for i, item in enumerate(self.machine.objects)}
        machine = self._corrected.machine
        leading = [
            column[max(sorted(entry.members), key=machine.points).object_id]
            for entry in self._corrected.objects.values()
        ]
        chosen = np.array(believed[:, leading])
        if len(chosen):
            chosen[-1] = [int(item.label) for item in self.objects]
        return chosen

    def object(self, object_id: int) -> MapObject:
        """The object with that id; ``KeyError`` if there is none."""
        return self._corrected.objects[object_id].item

    def links(self, previous_keyframe: int, current_keyframe: int) -> PatchLinks | None:
        """Patch matches of a co-visible pair; None if not compared."""
        return self.machine.links(previous_keyframe, current_keyframe)


class CorrectedSession:
    """See ``pipeline.result.SessionResult``; ``table`` holds the object id of every machine object."""

    def __init__(self, visit: SessionResult, table: NDArray[np.int32]) -> None:
        self._visit = visit
        self._table = table
        self.index: int = visit.index
        self.name: str = visit.name
        self.captured_at: str | None = visit.captured_at
        self.archive: str = visit.archive
        self.up_world: NDArray[np.float64] = visit.up_world
        self.keyframes: tuple[KeyframeRecord, ...] = visit.keyframes

    @property
    def points_world(self) -> NDArray[np.float32]:
        """(N, 3) metres, memory-mapped."""
        return self._visit.points_world

    @property
    def colours(self) -> NDArray[np.uint8]:
        """(N, 3) RGB of the points."""
        return self._visit.colours

    @cached_property
    def object_ids(self) -> NDArray[np.int32]:
        """(N,) corrected object of each point, 0 = background."""
        return _looked_up(self._table, self._visit.object_ids)

    def image_path(self, k: int) -> Path:
        """JPEG of the keyframe's colour image."""
        return self._visit.image_path(k)

    def object_mask(self, k: int) -> NDArray[np.uint16]:
        """(h, w) corrected object id of every second pixel, 0 = background."""
        return _looked_up(self._table, self._visit.object_mask(k)).astype(np.uint16)

    def semantic_heatmap(self, k: int) -> NDArray[np.float32]:
        """(H_f, W_f) in [0, 1], 1 = changed, NaN = not co-visible."""
        return self._visit.semantic_heatmap(k)

    def geometric_heatmap(self, k: int) -> NDArray[np.float32]:
        """(h, w) signed metres, + = newly appeared foreground, NaN = not co-visible."""
        return self._visit.geometric_heatmap(k)


def _looked_up(table: NDArray[np.int32], object_ids: NDArray[np.integer]) -> NDArray[np.int32]:
    return table[np.asarray(object_ids)]
