"""What the labels of a result follow from, kept at full precision so that they can be decided anew.

Everything costly is done once in a run: surfaces, matches, evidence, registrations. What is left is a
choice under limits, and this is what it needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.association.accumulation import AccumulatedAssociation, Proposals
from pipeline.association.aggregation import MatchEvidence
from pipeline.association.moves import Move
from pipeline.change.decision import Decision, VisitEvidence, decide_by_association, decide_by_evidence
from pipeline.change.evidence import ObjectEvidence
from pipeline.change.move_choice import MoveChoice
from pipeline.settings import Settings

# Of an object's evidence, what the rules still look at once its log odds are known.
_DECIDING = ("voxel_count", "coverage", "centroid_world")


@dataclass(frozen=True)
class KnownMove:
    """A pair that was laid over each other; fields as of ``association.moves.ScoredMove``."""

    previous: int
    current: int
    log_odds: float
    T_world_motion: NDArray[np.float64]


@dataclass(frozen=True)
class DecisionBasis:
    """See the module's docstring.

    Attributes:
        visits: evidence of the previous and the current visit as a whole.
        matches: patch matches between all objects; proposals: pairs that a submap assigned.
        overlap: (n, m) of the objects' places, intersection over union; None where it was not measured.
        moves: pairs of objects that were laid over each other.
    """

    visits: tuple[VisitEvidence, VisitEvidence]
    matches: MatchEvidence
    proposals: Proposals
    overlap: NDArray[np.float64] | None
    moves: tuple[Move, ...]

    def decide(self, settings: Settings) -> Decision:
        """The final decision under these settings.

        Raises:
            ValueError: the settings ask for the rule "evidence", and the overlap is not known.
        """
        if settings.change.rule == "paper":
            association = AccumulatedAssociation.restored(self.matches, self.proposals, settings.association)
            return decide_by_association(*self.visits, association, settings.change, is_final=True)
        if self.overlap is None:
            raise ValueError("the overlap of places was not measured")
        choice = MoveChoice(self.moves, self.visits, settings)
        return decide_by_evidence(*self.visits, self.overlap, choice, choice.likeliest, settings)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """What decides, as named arrays to be stored."""
        pairs = np.argwhere(self.matches.link_count > 0)
        at = tuple(pairs.T)
        arrays: dict[str, NDArray[Any]] = {
            "link_pairs": pairs.astype(np.int32),
            "link_count": self.matches.link_count[at],
            "link_score": self.matches.link_score[at],
            "leaving_count": self.matches.leaving_count,
            "arriving_count": self.matches.arriving_count,
            "proposed_pairs": self.proposals.pairs.astype(np.int32),
            "proposed_sigma": self.proposals.sigma,
            "proposed_s_bar": self.proposals.s_bar,
            "move_pairs": np.array([(m.previous, m.current) for m in self.moves], np.int32).reshape(-1, 2),
            "move_log_odds": np.array([m.log_odds for m in self.moves], np.float64),
            "move_T_world_motion": np.array([m.T_world_motion for m in self.moves]).reshape(-1, 4, 4),
        }
        if self.overlap is not None:
            places = np.argwhere(self.overlap > 0)
            arrays["overlap_pairs"] = places.astype(np.int32)
            arrays["overlap"] = self.overlap[tuple(places.T)]
        for visit, evidence in enumerate(self.visits):
            for name in _DECIDING:
                arrays[f"{name}_{visit}"] = getattr(evidence.objects, name)
            arrays[f"log_odds_{visit}"] = evidence.log_odds
            arrays[f"is_met_{visit}"] = evidence.is_met
        return arrays

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> DecisionBasis:
        """Inverse of :meth:`arrays`; evidence that decides nothing any more is NaN.

        Raises:
            KeyError, ValueError, IndexError: the arrays are not what :meth:`arrays` gives.
        """
        visits = (_visit(arrays, 0), _visit(arrays, 1))
        shape = (visits[0].count, visits[1].count)
        matches = MatchEvidence(
            _dense(shape, arrays["link_pairs"], arrays["link_count"]),
            _dense(shape, arrays["link_pairs"], arrays["link_score"]),
            np.array(arrays["leaving_count"]),
            np.array(arrays["arriving_count"]),
        )
        proposals = Proposals(
            arrays["proposed_pairs"].astype(np.int64).reshape(-1, 2),
            arrays["proposed_sigma"],
            arrays["proposed_s_bar"],
        )
        moves = tuple(
            KnownMove(int(previous), int(current), float(log_odds), T)
            for (previous, current), log_odds, T in zip(
                arrays["move_pairs"], arrays["move_log_odds"], arrays["move_T_world_motion"], strict=True
            )
        )
        overlap = None
        if "overlap" in arrays:
            overlap = _dense(shape, arrays["overlap_pairs"], arrays["overlap"])
        return cls(visits, matches, proposals, overlap, moves)


def _visit(arrays: Mapping[str, NDArray[Any]], visit: int) -> VisitEvidence:
    log_odds = np.array(arrays[f"log_odds_{visit}"])
    unknown = np.full(len(log_odds), np.nan)
    columns = {field.name: unknown for field in fields(ObjectEvidence)}
    columns |= {name: np.array(arrays[f"{name}_{visit}"]) for name in _DECIDING}
    is_met = np.array(arrays[f"is_met_{visit}"])
    if {len(values) for values in (is_met, *columns.values())} != {len(log_odds)}:
        raise ValueError(f"the evidence of visit {visit} is not of the same objects throughout")
    return VisitEvidence(ObjectEvidence(**columns), log_odds, is_met)


def _dense(shape: tuple[int, int], pairs: NDArray[Any], values: NDArray[Any]) -> NDArray[Any]:
    full = np.zeros(shape, values.dtype)
    full[tuple(pairs.reshape(-1, 2).T)] = values
    return full
