"""Association locally within submaps, then globally over everything seen so far (paper, Sec. III-C.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.association.aggregation import MatchEvidence
from pipeline.association.assignment import assign, associate
from pipeline.association.cases import match_case
from pipeline.result import MatchCase
from pipeline.settings import AssociationSettings

MIN_DEFERRED_LINKS = 3


@dataclass(frozen=True)
class Proposals:
    """Pairs that some submap, alone or with all before it, assigned to each other; the gates come later.

    Attributes:
        pairs: (P, 2) previous and current instance, counted from 0.
        sigma, s_bar: (P,) scores of the pair then.
    """

    pairs: NDArray[np.int64]
    sigma: NDArray[np.float64]
    s_bar: NDArray[np.float64]

    @classmethod
    def empty(cls) -> Proposals:
        """None yet."""
        return cls(np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(0))

    def joined(self, evidence: MatchEvidence) -> Proposals:
        """With what ``evidence`` assigns added."""
        sigma, s_bar = evidence.sigma, evidence.s_bar
        rows, columns = assign(sigma)
        return Proposals(
            np.concatenate([self.pairs, np.stack([rows, columns], axis=1).astype(np.int64)]),
            np.concatenate([self.sigma, sigma[rows, columns]]),
            np.concatenate([self.s_bar, s_bar[rows, columns]]),
        )


class AccumulatedAssociation:
    """The association of two visits while submaps of the current one come in.

    A pair becomes a candidate when it is confident (case 1) within a submap or over everything so far; the
    association is the best one-to-one choice among candidates by the accumulated score matrix.
    """

    def __init__(self, previous_objects: int, current_objects: int, settings: AssociationSettings) -> None:
        self._settings = settings
        self.evidence = MatchEvidence.empty(previous_objects, current_objects)
        self.proposals = Proposals.empty()

    @classmethod
    def restored(
        cls, evidence: MatchEvidence, proposals: Proposals, settings: AssociationSettings
    ) -> AccumulatedAssociation:
        """As it was when all submaps had come in, under gates that may be other ones."""
        previous_objects, current_objects = evidence.link_count.shape
        association = cls(previous_objects, current_objects, settings)
        association.evidence, association.proposals = evidence, proposals
        return association

    def add_submap(self, local: MatchEvidence) -> None:
        """Take in the evidence of one submap."""
        self.evidence.merge(local)
        for evidence in (local, self.evidence):
            self.proposals = self.proposals.joined(evidence)

    def pairs(self) -> list[tuple[int, int]]:
        """A: (previous, current) instances, counted from 0, ascending."""
        settings, proposals = self._settings, self.proposals
        passes = (proposals.sigma >= settings.tau_sigma) & (proposals.s_bar >= settings.tau_s)
        is_candidate = np.zeros(self.evidence.link_count.shape, bool)
        is_candidate[tuple(proposals.pairs[passes].T)] = True
        sigma = np.where(is_candidate, self.evidence.sigma, 0.0)
        return associate(sigma, np.where(is_candidate, self.evidence.s_bar, 0.0), 0.0, settings.tau_s)

    def best_counterparts(self, axis: int) -> NDArray[np.int64]:
        """For each previous (axis 0) or current (axis 1) object, its best counterpart, -1 without links.

        Best by match proportion as seen from that object's own side.
        """
        score = self.evidence.sigma if axis == 0 else self.evidence.sigma_backward.T
        if not score.size:
            return np.full(self.evidence.link_count.shape[axis], -1, np.int64)
        best = score.argmax(axis=1)
        return np.where(score.max(axis=1) > 0, best, -1)

    def case(self, previous: int, current: int) -> MatchCase:
        """Case of a pair over everything seen so far."""
        return match_case(
            float(self.evidence.sigma[previous, current]),
            float(self.evidence.s_bar[previous, current]),
            self._settings.tau_sigma,
            self._settings.tau_s,
        )

    def is_deferred(self, axis: int, instance: int, taken: set[int]) -> bool:
        """Whether an unmatched object waits for more evidence: its best free counterpart is case 2.

        Args:
            axis: 0 = a previous object, 1 = a current one.
            taken: counterparts that belong to somebody else already.
        """
        best = int(self.best_counterparts(axis)[instance])
        if best < 0 or best in taken:
            return False
        pair = (instance, best) if axis == 0 else (best, instance)
        enough = self.evidence.link_count[pair] >= MIN_DEFERRED_LINKS
        return bool(enough and self.case(*pair) is MatchCase.PARTIAL)
