"""Which objects of the two visits are one, and what became of each.

Two rules share the evidence. ``paper``: the association alone decides (Eq. 8). ``evidence``: what changed is
decided at each place (``change_score``); objects that stayed keep their identity by place, objects that
left are looked for elsewhere (``association.moves``), and only what left and was not found has disappeared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from pipeline.association.accumulation import AccumulatedAssociation
from pipeline.association.moves import Move
from pipeline.change.confidence import NO_MOVE_LOG_ODDS, confidence_features, label_confidence
from pipeline.change.evidence import ObjectEvidence
from pipeline.change.labels import labels_from_association
from pipeline.result import ChangeLabel
from pipeline.settings import ChangeSettings, Settings

# Objects of the two visits that overlap this much (intersection over union) are at one place: at most one
# object of either visit can.
_ONE_PLACE_OVERLAP = 0.5
# Label code of an object that nobody has seen yet.
NOT_MET = 255


@dataclass(frozen=True)
class VisitEvidence:
    """What speaks about the objects of one visit; arrays are (K + 1,), entry 0 is background.

    Attributes:
        objects: coverage, seen-through share, appearance.
        log_odds: of a change at the object's place.
        is_met: the object has been seen by now (all of them in a finished visit).
    """

    objects: ObjectEvidence
    log_odds: NDArray[np.float64]
    is_met: NDArray[np.bool_]

    @property
    def count(self) -> int:
        """K, the number of instances."""
        return len(self.log_odds) - 1


@dataclass(frozen=True)
class Identity:
    """A previous and a current instance (counted from 1) that are one object, and how sure that is.

    Attributes:
        T_world_motion: (4, 4), p_current = T p_previous; None where it was not estimated.
    """

    previous: int
    current: int
    confidence: float
    T_world_motion: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Decision:
    """Labels and identities at one moment; arrays are (K + 1,), entry 0 is background.

    Attributes:
        identities: objects of both visits.
        labels0, labels1: ``ChangeLabel`` codes per instance, ``NOT_MET`` before it was seen.
        confidence0, confidence1: of the labels, in [0, 1].
        log_odds: of a change at the place of each object, for either visit.
        move_log_odds: of the likeliest move of each object, for either visit.
    """

    identities: tuple[Identity, ...]
    labels0: NDArray[np.int64]
    labels1: NDArray[np.int64]
    confidence0: NDArray[np.float64]
    confidence1: NDArray[np.float64]
    log_odds: tuple[NDArray[np.float64], NDArray[np.float64]]
    move_log_odds: tuple[NDArray[np.float64], NDArray[np.float64]]


# Chooses moves among those between two sets of instances (counted from 1) that may have moved, but for pairs
# that stayed.
FindMoves = Callable[[set[int], set[int], set[tuple[int, int]]], Sequence[Move]]


def decide_by_association(
    previous: VisitEvidence,
    current: VisitEvidence,
    association: AccumulatedAssociation,
    settings: ChangeSettings,
    *,
    is_final: bool,
) -> Decision:
    """The paper's rule, Eq. 8; before the last submap, case 2 is deferred and stays unknown."""
    pairs = association.pairs()
    labels0, labels1 = labels_from_association(
        pairs,
        previous.objects.centroid_world[1:],
        current.objects.centroid_world[1:],
        previous.objects.coverage[1:],
        current.objects.coverage[1:],
        settings.tau_d_m,
        settings.nu_min,
    )
    if not is_final:
        taken = ({current for _, current in pairs}, {previous for previous, _ in pairs})
        for axis, labels in enumerate((labels0, labels1)):
            unmatched = np.isin(labels, (ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED))
            for instance in np.flatnonzero(unmatched):
                if association.is_deferred(axis, int(instance), taken[axis]):
                    labels[instance] = ChangeLabel.UNKNOWN
    evidence = association.evidence
    identities = tuple(
        Identity(row + 1, column + 1, float(evidence.s_bar[row, column])) for row, column in pairs
    )
    full0, full1 = np.concatenate([[0], labels0]), np.concatenate([[0], labels1])
    confidence = [
        np.where(full == ChangeLabel.UNKNOWN, 0.5, visit.objects.coverage).astype(float)
        for full, visit in ((full0, previous), (full1, current))
    ]
    for identity in identities:
        confidence[0][identity.previous] = confidence[1][identity.current] = identity.confidence
    visits = (previous, current)
    no_moves = (np.full(len(full0), NO_MOVE_LOG_ODDS), np.full(len(full1), NO_MOVE_LOG_ODDS))
    odds = (previous.log_odds, current.log_odds)
    return _finished(identities, visits, (full0, full1), (confidence[0], confidence[1]), odds, no_moves)


def decide_by_evidence(
    previous: VisitEvidence,
    current: VisitEvidence,
    overlap: NDArray[np.float64],
    find_moves: FindMoves,
    move_log_odds: tuple[NDArray[np.float64], NDArray[np.float64]],
    settings: Settings,
) -> Decision:
    """Decide from what changed at each place.

    Args:
        previous, current: evidence of either visit.
        overlap: (n, m) voxel intersection over union of the objects' places.
        find_moves: finds objects that left their place at another one.
        move_log_odds: (K + 1,) of the likeliest move of each object of either visit.
        settings: of the run.
    """
    visits = (previous, current)
    change = settings.change
    log_odds = _agreed(previous, current, overlap)
    changed = [
        (odds > change.min_log_odds) & visit.is_met for odds, visit in zip(log_odds, visits, strict=True)
    ]
    for of_visit in changed:
        of_visit[0] = False  # background is no object, however much of it looks changed
    labels = [
        np.where(visit.objects.coverage >= change.nu_min, ChangeLabel.STATIC, ChangeLabel.UNKNOWN)
        for visit in visits
    ]
    for visit, code in enumerate((ChangeLabel.DISAPPEARED, ChangeLabel.APPEARED)):
        is_covered = visits[visit].objects.coverage >= change.nu_min
        labels[visit][changed[visit] & is_covered] = code
    may_move = [
        set(np.flatnonzero((odds > settings.moves.least_change_log_odds) & visit.is_met).tolist()) - {0}
        for odds, visit in zip(log_odds, visits, strict=True)
    ]
    # Two objects at one place that hardly looks changed are one that stayed: what moves a thing only a
    # little leaves less doubt than an alignment that is a little off.
    at_one_place = np.argwhere(overlap > change.same_place_overlap) + 1
    stayed = {
        (int(p), int(c))
        for p, c in at_one_place
        if min(log_odds[0][p], log_odds[1][c]) <= change.min_log_odds
    }
    moves = find_moves(may_move[0], may_move[1], stayed)
    likeliest = [odds.copy() for odds in move_log_odds]
    for move in moves:
        labels[0][move.previous] = labels[1][move.current] = ChangeLabel.MOVED
        changed[0][move.previous] = changed[1][move.current] = True
        likeliest[0][move.previous] = likeliest[1][move.current] = move.log_odds
    identities = _same_place(changed, overlap, previous, current, change)
    for identity in identities:
        labels[0][identity.previous] = labels[1][identity.current] = ChangeLabel.STATIC
    confidence = [
        _confidence(codes, odds, visit, move_odds, settings)
        for codes, odds, visit, move_odds in zip(labels, log_odds, visits, likeliest, strict=True)
    ]
    moved = tuple(
        Identity(m.previous, m.current, float(confidence[0][m.previous]), m.T_world_motion) for m in moves
    )
    return _finished(
        (*identities, *moved),
        visits,
        (labels[0], labels[1]),
        (confidence[0], confidence[1]),
        log_odds,
        (likeliest[0], likeliest[1]),
    )


def _agreed(
    previous: VisitEvidence, current: VisitEvidence, overlap: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Log odds of a change; what two visits say of one and the same place is averaged."""
    odds0, odds1 = previous.log_odds.copy(), current.log_odds.copy()
    rows, columns = np.nonzero(overlap >= _ONE_PLACE_OVERLAP)
    for row, column in zip(rows + 1, columns + 1, strict=True):
        size0, size1 = previous.objects.voxel_count[row], current.objects.voxel_count[column]
        both = previous.log_odds[row] * size0 + current.log_odds[column] * size1
        odds0[row] = odds1[column] = both / max(size0 + size1, 1)
    return odds0, odds1


def _same_place(
    changed: list[NDArray[np.bool_]],
    overlap: NDArray[np.float64],
    previous: VisitEvidence,
    current: VisitEvidence,
    settings: ChangeSettings,
) -> tuple[Identity, ...]:
    """One-to-one identities of unchanged objects by the place they share."""
    stayed = [
        np.flatnonzero((~c & v.is_met)[1:]) + 1 for c, v in zip(changed, (previous, current), strict=True)
    ]
    if not len(stayed[0]) or not len(stayed[1]):
        return ()
    shared = overlap[np.ix_(stayed[0] - 1, stayed[1] - 1)]
    rows, columns = linear_sum_assignment(-shared)
    return tuple(
        Identity(int(stayed[0][row]), int(stayed[1][column]), float(shared[row, column]))
        for row, column in zip(rows, columns, strict=True)
        if shared[row, column] > settings.same_place_overlap
    )


def _confidence(
    labels: NDArray[np.integer],
    log_odds: NDArray[np.float64],
    visit: VisitEvidence,
    move_log_odds: NDArray[np.float64],
    settings: Settings,
) -> NDArray[np.float64]:
    objects = visit.objects
    features = confidence_features(log_odds, objects.coverage, objects.voxel_count, move_log_odds)
    # An unknown object is the surer unknown the less of it was observed.
    unknown = 1.0 - np.minimum(objects.coverage, 1.0)
    decided = label_confidence(labels, features, settings.confidence)
    return np.where(labels == ChangeLabel.UNKNOWN, unknown, decided)


def _finished(
    identities: tuple[Identity, ...],
    visits: tuple[VisitEvidence, VisitEvidence],
    labels: tuple[NDArray[np.integer], NDArray[np.integer]],
    confidences: tuple[NDArray[np.float64], NDArray[np.float64]],
    log_odds: tuple[NDArray[np.float64], NDArray[np.float64]],
    move_log_odds: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> Decision:
    """A decision that leaves out what was not met, and whose background is static for certain."""
    codes = [np.where(v.is_met, c, NOT_MET).astype(np.int64) for v, c in zip(visits, labels, strict=True)]
    values = [confidence.copy() for confidence in confidences]
    for visit in range(2):
        codes[visit][0], values[visit][0] = ChangeLabel.STATIC, 1.0
    return Decision(identities, codes[0], codes[1], values[0], values[1], log_odds, move_log_odds)
