"""Global re-association: an object first thought gone is found again elsewhere (paper, Fig. 2).

The two places of a moved object need not be in one view, so no co-visible pair compares them, and where
things look alike a patch finds its like everywhere. So every object that left its place is laid over every
object that took one (``object_registration``), and the pair is judged by how well one can be the other: by
shape, pattern and colour, and by how often the colours of any two things of this place agree as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from pipeline.association.cloud_agreement import (
    ENOUGH_SHARED,
    ObjectCloud,
    ObjectRegistration,
)
from pipeline.association.keypoint_registration import KeypointRegistration
from pipeline.association.object_registration import agreement_of, register_objects
from pipeline.camera import invert_rigid, transform_points
from pipeline.settings import MoveSettings

_THREADS = 2
_QUANTILES = np.linspace(0.05, 0.95, 19)
# Two axes of colour without brightness, over log RGB, and the directions that their quantiles are taken in.
_CHROMA_AXES = np.array([[1.0, 0.0, -1.0], [1.0, -2.0, 1.0]]) / np.sqrt([[2.0], [6.0]])
_DIRECTIONS = np.array([[1.0, 0.0], [0.0, 1.0], [0.7, 0.7], [0.7, -0.7]])
_SIZE_IN_RANKING = 0.1
# A place with a print lies on a surface within so many spacings of it.
_ON_SURFACE_SPACINGS = 3.0
_SURFACE_SAMPLE = 1500
_FULL_TEXTURE = 0.12
FEATURES = (
    "overlap_more",
    "overlap_less",
    "shared",
    "likelihood",
    "likelihood_shared",
    "texture_correlation",
    "texture",
    "gain",
    "reach_ratio",
    "height_ratio",
    "vacated",
    "voxels",
    "chroma_rank",
    "agreement_rank",
    "print",
    "print_expected",
)


@dataclass(frozen=True)
class Candidate:
    """An object that may have left its place, or taken it.

    Attributes:
        instance: counted from 1.
        cloud: what its visit saw of it.
        seen_through: share of its place that the other visit saw to be empty.
        voxel_count: of the instance.
        print_places: (p, 3) where it has keypoints, metres.
    """

    instance: int
    cloud: ObjectCloud
    print_places: NDArray[np.float64]
    seen_through: float
    voxel_count: int


class Move(Protocol):
    """What the choice among moves rests on; fields as of :class:`ScoredMove`."""

    @property
    def previous(self) -> int:
        """Previous instance, counted from 1."""

    @property
    def current(self) -> int:
        """Current instance, counted from 1."""

    @property
    def log_odds(self) -> float:
        """That both are one object."""

    @property
    def T_world_motion(self) -> NDArray[np.float64]:
        """(4, 4), p_current = T p_previous in the world frame, metres."""


AnyMove = TypeVar("AnyMove", bound=Move)


@dataclass(frozen=True)
class ScoredMove:
    """A previous and a current instance (counted from 1) that may be one object.

    Attributes:
        features: (len(FEATURES),) what the score rests on.
        log_odds: that they are one.
    """

    previous: int
    current: int
    registration: ObjectRegistration
    features: NDArray[np.float64]
    log_odds: float

    @property
    def T_world_motion(self) -> NDArray[np.float64]:
        """(4, 4), p_current = T p_previous in the world frame, metres."""
        return self.registration.T_world_motion


@dataclass(frozen=True)
class _Pair:
    previous: Candidate
    current: Candidate
    chroma_distance: float
    log_ratios: NDArray[np.float64]
    printed: KeypointRegistration | None

    @property
    def unlikeness(self) -> float:
        """Orders pairs: those of one print first, then by colours and sizes."""
        support = self.printed.support if self.printed is not None else 0.0
        return self.chroma_distance + _SIZE_IN_RANKING * float(self.log_ratios.max()) - support


def score_moves(
    previous: Sequence[Candidate],
    current: Sequence[Candidate],
    up_world: NDArray[np.floating],
    spacing_m: float,
    prints: Mapping[tuple[int, int], KeypointRegistration],
    settings: MoveSettings,
) -> list[ScoredMove]:
    """Score all pairs that share a print, or are alike enough in colour and size to be laid over each other.

    Args:
        previous, current: objects that left, and that took, a place.
        up_world: (3,) against gravity.
        spacing_m: distance of neighbouring points of the clouds.
        prints: by previous and current instance, what their keypoints agree on.
    """
    pairs = _promising(previous, current, up_world, spacing_m, prints, settings)
    if not pairs:
        return []

    def registered(pair: _Pair) -> ObjectRegistration:
        clouds = pair.previous.cloud, pair.current.cloud
        if pair.printed is not None and pair.printed.support >= settings.least_print_support:
            return agreement_of(*clouds, pair.printed.T_world_motion, spacing_m)
        return register_objects(*clouds, up_world, spacing_m)

    with ThreadPoolExecutor(_THREADS) as threads:
        registrations = list(threads.map(registered, pairs))
    chroma_rank = _log_rank(np.array([pair.chroma_distance for pair in pairs]))
    agreement_rank = _log_rank(-np.array([registration.agreement for registration in registrations]))
    weights = np.array([getattr(settings, f"{name}_weight") for name in FEATURES])
    moves = []
    for pair, registration, *ranks in zip(pairs, registrations, chroma_rank, agreement_rank, strict=True):
        support = pair.printed.support if pair.printed is not None else 0.0
        expected = _expected_support(pair, registration.T_world_motion, spacing_m)
        features = np.array([*_features(pair, registration), *ranks, np.log1p(support), np.log1p(expected)])
        log_odds = settings.bias + float(weights @ features)
        moves.append(
            ScoredMove(pair.previous.instance, pair.current.instance, registration, features, log_odds)
        )
    return moves


def choose_moves(
    scored: Sequence[AnyMove], is_possible: Callable[[AnyMove], bool], settings: MoveSettings
) -> list[AnyMove]:
    """One-to-one moves of the greatest total log odds, each above the least (Hungarian)."""
    possible = [move for move in scored if move.log_odds > settings.min_log_odds and is_possible(move)]
    if not possible:
        return []
    rows, row = np.unique([move.previous for move in possible], return_inverse=True)
    columns, column = np.unique([move.current for move in possible], return_inverse=True)
    gain = np.zeros((len(rows), len(columns)))
    which = np.full(gain.shape, -1)
    for number, move in enumerate(possible):
        gain[row[number], column[number]] = move.log_odds - settings.min_log_odds
        which[row[number], column[number]] = number
    chosen = which[linear_sum_assignment(-gain)]
    # Rows that nothing fits are assigned all the same, at no gain.
    return [possible[number] for number in chosen if number >= 0]


def moves_table(
    scored: Sequence[ScoredMove], ids0: NDArray[np.integer], ids1: NDArray[np.integer]
) -> NDArray[np.void]:
    """(n,) one row per pair: object ids of both, every feature, and the log odds that they are one.

    Args:
        scored: chosen or not.
        ids0, ids1: (K + 1,) object id of every instance of the previous and the current visit.
    """
    numbers = [(name, np.int32) for name in ("previous_object_id", "current_object_id")]
    rows = np.zeros(len(scored), [*numbers, *((name, np.float32) for name in (*FEATURES, "log_odds"))])
    for row, move in zip(rows, scored, strict=True):
        row["previous_object_id"], row["current_object_id"] = ids0[move.previous], ids1[move.current]
        row["log_odds"] = move.log_odds
        for name, value in zip(FEATURES, move.features, strict=True):
            row[name] = value
    return rows


def _promising(
    previous: Sequence[Candidate],
    current: Sequence[Candidate],
    up_world: NDArray[np.floating],
    spacing_m: float,
    prints: Mapping[tuple[int, int], KeypointRegistration],
    settings: MoveSettings,
) -> list[_Pair]:
    """Pairs of one print; and of like colours and sizes, of each object the likest few."""
    described = [
        [
            (_chroma_quantiles(c.cloud), np.log(size_m(c.cloud.points_world, up_world, spacing_m)))
            for c in group
        ]
        for group in (previous, current)
    ]
    pairs = []
    for candidate0, (chroma0, size0) in zip(previous, described[0], strict=True):
        for candidate1, (chroma1, size1) in zip(current, described[1], strict=True):
            distance = float(np.abs(chroma0 - chroma1).mean())
            ratios = np.abs(size0 - size1)
            printed = prints.get((candidate0.instance, candidate1.instance))
            pair = _Pair(candidate0, candidate1, distance, ratios, printed)
            is_printed = printed is not None and printed.support >= settings.least_print_support
            if is_printed or (
                distance < settings.chroma_distance and ratios.max() < np.log(settings.size_ratio)
            ):
                pairs.append(pair)
    pairs.sort(key=lambda pair: pair.unlikeness)
    kept, of_previous, of_current = [], dict[int, int](), dict[int, int]()
    for pair in pairs:
        row, column = pair.previous.instance, pair.current.instance
        of_previous[row], of_current[column] = of_previous.get(row, 0) + 1, of_current.get(column, 0) + 1
        if min(of_previous[row], of_current[column]) <= settings.partners_per_object:
            kept.append(pair)
    return kept[: settings.max_registrations]


def _features(pair: _Pair, found: ObjectRegistration) -> list[float]:
    """All features but the ranks."""
    textured = min(1.0, found.texture / _FULL_TEXTURE)
    return [
        max(found.overlap_previous, found.overlap_current),
        min(found.overlap_previous, found.overlap_current),
        min(found.shared, 0.5),
        found.likelihood,
        found.likelihood * min(1.0, found.shared / ENOUGH_SHARED),
        float(np.arctanh(np.clip(found.texture_correlation, -0.9, 0.97))) * textured,
        textured,
        min(abs(found.gain), 0.6),
        float(pair.log_ratios[0]),
        float(pair.log_ratios[1]),
        min(pair.previous.seen_through, pair.current.seen_through),
        float(np.log(max(1, min(pair.previous.voxel_count, pair.current.voxel_count)))),
    ]


def _expected_support(pair: _Pair, T_world_motion: NDArray[np.float64], spacing_m: float) -> int:
    """Places with a print that lie on the other object's surface: were they one, most would agree."""
    before, after = pair.previous, pair.current
    counts = []
    for own, other, T in (
        (before, after, T_world_motion),
        (after, before, invert_rigid(T_world_motion)),
    ):
        if not len(own.print_places):
            return 0
        surface = cKDTree(other.cloud.sampled(_SURFACE_SAMPLE).points_world)
        distance, _ = surface.query(transform_points(T, own.print_places), k=1)
        counts.append(int((distance < _ON_SURFACE_SPACINGS * spacing_m).sum()))
    return min(counts)


def _chroma_quantiles(cloud: ObjectCloud) -> NDArray[np.float64]:
    """(4, 19) quantiles of the colours without brightness along four directions (sliced Wasserstein)."""
    colours = np.asarray(cloud.log_colours, np.float64)
    chroma = (colours - colours.mean(axis=1, keepdims=True)) @ _CHROMA_AXES.T
    return np.quantile(chroma @ _DIRECTIONS.T, _QUANTILES, axis=0).T


def size_m(
    points_world: NDArray[np.floating], up_world: NDArray[np.floating], least_m: float
) -> NDArray[np.float64]:
    """(2,) horizontal reach and height of points in metres; turning about gravity changes neither."""
    height = points_world @ up_world
    level = points_world - height[:, None] * up_world
    reach = 2 * np.percentile(np.linalg.norm(level - level.mean(axis=0), axis=1), 95)
    low, high = np.percentile(height, [2, 98])
    return np.maximum([reach, high - low], least_m).astype(np.float64)


def _log_rank(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log of the share of all pairs that have a value as small: most pairs are two different things."""
    rank = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return np.log((rank + 0.5) / len(values))
