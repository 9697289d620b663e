"""The labels of a finished result under other limits, without running anything again.

The rules are those of ``change.decision``; this only translates between instances of the two visits and the
object ids of the result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.change.basis import DecisionBasis
from pipeline.change.decision import Decision
from pipeline.errors import ResultError
from pipeline.result import ChangeLabel, Result
from pipeline.settings import Settings


@dataclass(frozen=True)
class Flip:
    """An object of the result that would count as something else.

    Attributes:
        object_id: of the result.
        machine: its label in the result.
        labels: what it would be, one label per visit that saw it, in visit order; two different ones where
            it would fall into two objects.
        joins: the object of the other visit that it would be one with, though the result has them apart.
        parts: it would fall into two objects.
    """

    object_id: int
    machine: ChangeLabel
    labels: tuple[ChangeLabel, ...]
    joins: int | None
    parts: bool


@dataclass(frozen=True)
class Relabelled:
    """Labels of all objects of a result under some limits.

    Attributes:
        by_visit: for the previous and the current visit, label by object id.
        flips: objects whose label or identity would change, in ascending id.
        pairs: objects of the earlier and the later visit (ids of the result) that would be one.
    """

    by_visit: tuple[Mapping[int, ChangeLabel], Mapping[int, ChangeLabel]]
    flips: tuple[Flip, ...]
    pairs: frozenset[tuple[int, int]] = frozenset()

    def label_of(self, object_id: int) -> ChangeLabel:
        """The label by which the object as a whole counts; the earlier visit leads as it does in a result.

        Raises:
            KeyError: there is no such object.
        """
        before, after = self.by_visit
        return before[object_id] if object_id in before else after[object_id]


class WhatIf:
    """Decides a result anew, as often as asked.

    Args:
        result: labels and ids to compare with.
        basis: what the labels follow from.

    Raises:
        ResultError: the basis does not belong to the result.
    """

    def __init__(self, result: Result, basis: DecisionBasis) -> None:
        matrix = result.score_matrix
        self._basis = basis
        self._ids = (matrix.row_object_ids.tolist(), matrix.column_object_ids.tolist())
        self._machine = {item.object_id: item.label for item in result.objects}
        if tuple(map(len, self._ids)) != tuple(visit.count for visit in basis.visits):
            raise ResultError(
                f"{result.path}: basis.npz and the score matrix are of different objects", "run it again"
            )

    @property
    def can_decide_by_evidence(self) -> bool:
        """Whether the places' overlap is known; a run by the paper's rule does not measure it."""
        return self._basis.overlap is not None

    def under(self, settings: Settings) -> Relabelled:
        """The labels under these settings; raises as ``DecisionBasis.decide``."""
        decision = self._basis.decide(settings)
        labels = (
            {i: ChangeLabel(int(c)) for i, c in zip(self._ids[0], decision.labels0[1:], strict=True)},
            {i: ChangeLabel(int(c)) for i, c in zip(self._ids[1], decision.labels1[1:], strict=True)},
        )
        one = self._pairs(decision)
        return Relabelled(labels, self._flips(labels, one), one)

    def _pairs(self, decision: Decision) -> frozenset[tuple[int, int]]:
        return frozenset(
            (self._ids[0][identity.previous - 1], self._ids[1][identity.current - 1])
            for identity in decision.identities
        )

    def _flips(
        self,
        labels: tuple[dict[int, ChangeLabel], dict[int, ChangeLabel]],
        one: frozenset[tuple[int, int]],
    ) -> tuple[Flip, ...]:
        whole = {before for before, after in one if before == after}
        joins = {before: after for before, after in one if before != after}
        joins |= {after: before for before, after in joins.items()}
        flips = []
        for object_id, machine in sorted(self._machine.items()):
            would = tuple(of_visit[object_id] for of_visit in labels if object_id in of_visit)
            parts = len(would) == 2 and object_id not in whole
            if set(would) != {machine} or object_id in joins or parts:
                flips.append(Flip(object_id, machine, would, joins.get(object_id), parts))
        return tuple(flips)


def what_if(result: Result) -> WhatIf | None:
    """What can be decided anew about a result; None if it does not hold what its labels follow from.

    Raises:
        ResultError: what is stored is damaged.
    """
    arrays = getattr(result, "basis_arrays", None)
    if arrays is None:
        return None
    try:
        basis = DecisionBasis.from_arrays(arrays)
    except (KeyError, ValueError, IndexError) as error:
        raise ResultError(f"basis.npz of {result.path} is damaged ({error})", "run it again") from None
    return WhatIf(result, basis)
