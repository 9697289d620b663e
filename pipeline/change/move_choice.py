"""Which of the scored moves took place, given which objects of either visit may have moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.association.moves import Move, choose_moves
from pipeline.camera import rotation_angle_rad
from pipeline.change.confidence import NO_MOVE_LOG_ODDS
from pipeline.change.decision import VisitEvidence
from pipeline.settings import Settings


class MoveChoice:
    """Chooses among moves that were scored once; may be asked again as evidence or limits change.

    Args:
        scored: pairs of objects that were laid over each other.
        final: evidence of the previous and the current visit as a whole.
        settings: of the run.

    Attributes:
        likeliest: for either visit, (K + 1,) log odds of the likeliest move of each object.
    """

    def __init__(
        self, scored: Sequence[Move], final: tuple[VisitEvidence, VisitEvidence], settings: Settings
    ) -> None:
        self._scored = scored
        self._settings = settings
        self._coverage = (final[0].objects.coverage, final[1].objects.coverage)
        self._centroids = final[0].objects.centroid_world
        self.likeliest = (
            np.full(len(final[0].log_odds), NO_MOVE_LOG_ODDS),
            np.full(len(final[1].log_odds), NO_MOVE_LOG_ODDS),
        )
        for move in scored:
            for of_visit, instance in zip(self.likeliest, (move.previous, move.current), strict=True):
                of_visit[instance] = max(of_visit[instance], move.log_odds)

    def __call__(self, previous: set[int], current: set[int], stayed: set[tuple[int, int]]) -> list[Move]:
        """One-to-one moves between instances (counted from 1) that may have moved; ``stayed`` did not."""
        return choose_moves(
            self._scored,
            lambda move: (
                move.previous in previous
                and move.current in current
                and (move.previous, move.current) not in stayed
                and self._is_observed(move)
                and self._has_moved(move)
            ),
            self._settings.moves,
        )

    def _is_observed(self, move: Move) -> bool:
        """One place was seen without the object; where it stands now need not have been looked at before."""
        coverage = (self._coverage[0][move.previous], self._coverage[1][move.current])
        return bool(max(coverage) >= self._settings.change.nu_min)

    def _has_moved(self, move: Move) -> bool:
        T = move.T_world_motion
        centroid = self._centroids[move.previous]
        shift_m = float(np.linalg.norm(T[:3, :3] @ centroid + T[:3, 3] - centroid))
        turn_deg = float(np.degrees(rotation_angle_rad(np.eye(3), T[:3, :3])))
        return shift_m > self._settings.change.tau_d_m or turn_deg > self._settings.moves.min_rotation_deg
