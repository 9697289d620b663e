"""What the labels of the small result follow from: sure changes, sure stays, two sure moves."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.association.accumulation import Proposals
from pipeline.association.aggregation import MatchEvidence
from pipeline.change.basis import DecisionBasis, KnownMove
from pipeline.change.decision import VisitEvidence
from pipeline.change.evidence import ObjectEvidence
from pipeline.result import ChangeLabel, MapObject, ScoreMatrix

CHANGE_LOG_ODDS, MOVE_LOG_ODDS = 5.0, 2.0


def small_basis(objects: Sequence[MapObject], score: ScoreMatrix) -> DecisionBasis:
    """The basis from which the engine decides the labels that ``objects`` carry."""
    by_id = {item.object_id: item for item in objects}
    visits = tuple(
        _visit([by_id[i] for i in ids.tolist()], session)
        for session, ids in enumerate((score.row_object_ids, score.column_object_ids))
    )
    rows = np.maximum(np.round(score.match_count / np.maximum(score.sigma, 1e-9)).max(axis=1), 1)
    columns = np.maximum(np.round(score.match_count / np.maximum(score.sigma_backward, 1e-9)).max(axis=0), 1)
    matches = MatchEvidence(
        score.match_count.astype(np.int64),
        score.match_count * score.s_bar.astype(np.float64),
        rows.astype(np.int64),
        columns.astype(np.int64),
    )
    pairs = np.argwhere(score.row_object_ids[:, None] == score.column_object_ids[None, :])
    same = [by_id[int(score.row_object_ids[row])] for row, _ in pairs]
    overlap = np.zeros(score.sigma.shape)
    moves = []
    for (row, column), item in zip(pairs.tolist(), same, strict=True):
        if item.label is ChangeLabel.STATIC:
            overlap[row, column] = 0.8
        else:
            motion = np.eye(4)
            before, after = (np.array(seen.centroid_world_m) for seen in item.sightings)
            motion[:3, 3] = after - before
            moves.append(KnownMove(row + 1, column + 1, MOVE_LOG_ODDS, motion))
    return DecisionBasis(
        (visits[0], visits[1]), matches, Proposals.empty().joined(matches), overlap, tuple(moves)
    )


def small_tables(basis: DecisionBasis) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Evidence of both visits as a result stores it."""
    tables = [visit.objects.table(log_odds=visit.log_odds) for visit in basis.visits]
    return tables[0], tables[1]


def _visit(objects: list[MapObject], session: int) -> VisitEvidence:
    seen = [item.sighting(session) for item in objects]
    changed = {ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED, ChangeLabel.MOVED}

    def column(background: float, values: list[Any]) -> NDArray[Any]:
        return np.array([background, *values])

    known = {
        "voxel_count": column(0, [s.point_count for s in seen]),
        "coverage": column(1.0, [s.coverage for s in seen]),
        "seen_through": column(0.0, [item.seen_through for item in objects]),
        "centroid_world": np.array([(0.0, 0.0, 0.0), *(s.centroid_world_m for s in seen)]),
        "compared_count": column(0, [50 for _ in objects]),
        "texture_correlation": np.ones(len(objects) + 1),
    }
    fields = {
        f.name: known.get(f.name, np.zeros(len(objects) + 1)) for f in dataclasses.fields(ObjectEvidence)
    }
    odds = column(-9.0, [CHANGE_LOG_ODDS if item.label in changed else -CHANGE_LOG_ODDS for item in objects])
    return VisitEvidence(ObjectEvidence(**fields), odds, np.ones(len(objects) + 1, bool))
