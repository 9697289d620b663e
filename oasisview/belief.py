"""What was believed about objects while the later visit went on: one row of labels per submap."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

from oasisview.catalogue import Catalogue
from oasisview.scene.map_view import VisitLabels
from pipeline.result import ChangeLabel

NOT_MET = 255


@dataclass(frozen=True)
class BeliefMoment:
    """The end of a submap.

    Attributes:
        row: of the belief table; keyframe: the last one of the submap, position in the later visit.
    """

    row: int
    keyframe: int


def moments(catalogue: Catalogue) -> tuple[BeliefMoment, ...]:
    """When the belief was brought up to date, in order; none without keyframes."""
    last: dict[int, int] = {}
    for position, keyframe in enumerate(catalogue.session(1).keyframes):
        last[keyframe.submap] = position
    rows = catalogue.result.belief.shape[0]
    return tuple(BeliefMoment(row, last[row]) for row in range(rows) if row in last)


def row_at(known: tuple[BeliefMoment, ...], keyframe: int) -> int:
    """Index into ``known`` of the latest moment at a keyframe of the later visit; -1 before the first."""
    return bisect_right([moment.keyframe for moment in known], keyframe) - 1


def believed(catalogue: Catalogue, object_id: int) -> tuple[ChangeLabel | None, ...]:
    """Label of an object after each submap; None before it was met."""
    column = list(catalogue.objects).index(object_id)
    return tuple(None if code == NOT_MET else ChangeLabel(code) for code in _column(catalogue, column))


def _column(catalogue: Catalogue, column: int) -> list[int]:
    table = catalogue.result.belief
    return [int(code) for code in table[:, column]] if column < table.shape[1] else []


def labels_after(catalogue: Catalogue, row: int | None) -> VisitLabels:
    """Labels as believed after a row of the table; nothing is believed where ``row`` is None."""
    known: dict[int, ChangeLabel] = {}
    if row is not None:
        codes = catalogue.result.belief[row].tolist()
        known = {
            object_id: ChangeLabel(code)
            for object_id, code in zip(catalogue.objects, codes, strict=False)
            if code != NOT_MET
        }
    look: Callable[[int], ChangeLabel | None] = known.get
    return look, look
