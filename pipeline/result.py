"""What the engine found: the typed, read-only view of a change map.

Everything here is plain data. ``pipeline.store`` writes and opens the folder behind it; arrays of
keyframes are memory-mapped or read only when asked for, so a result of any length opens at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera


class ChangeLabel(IntEnum):
    """What became of an object between the visits (paper, Eq. 8); the numbers are the exported codes."""

    UNKNOWN = 0
    STATIC = 1
    APPEARED = 2
    DISAPPEARED = 3
    MOVED = 4


class MatchCase(StrEnum):
    """The four cases of mask-to-mask matching (paper, Sec. III-C.2)."""

    CONFIDENT = "confident"  # 1: high s-bar, high sigma: a true association
    PARTIAL = "partial"  # 2: high s-bar, low sigma: seen in part, deferred
    LOOKALIKE = "lookalike"  # 3: low s-bar, high sigma: similar but another object
    NONE = "none"  # 4: low s-bar, low sigma: no counterpart


@dataclass(frozen=True)
class Sighting:
    """One object as one visit saw it.

    Attributes:
        session: 0 = previous, 1 = current, ...
        instance: row (session 0) or column (session 1) of the object in the score matrix.
        centroid_world_m: (3,) mean of its points, metres.
        box_min_world_m, box_max_world_m: (3,) axis-aligned bounds in the world frame, metres.
        point_count: map points that carry the object.
        coverage: nu, the fraction of its volume that the other visit observed, in [0, 1].
        keyframes: positions in ``SessionResult.keyframes`` that see it, best view first.
    """

    session: int
    instance: int
    centroid_world_m: tuple[float, float, float]
    box_min_world_m: tuple[float, float, float]
    box_max_world_m: tuple[float, float, float]
    point_count: int
    coverage: float
    keyframes: tuple[int, ...]

    @property
    def extent_m(self) -> tuple[float, float, float]:
        """Side lengths of the axis-aligned bounds, metres."""
        low, high = self.box_min_world_m, self.box_max_world_m
        return (high[0] - low[0], high[1] - low[1], high[2] - low[2])


@dataclass(frozen=True)
class MapObject:
    """One object of the change map, with one identity over all visits.

    Attributes:
        object_id: 1, 2, ...; the same number in every visit that saw it.
        label: the machine's label; inspectors' overrides are not in the result.
        confidence: of the label, in [0, 1].
        case: the case of its chosen or best counterpart.
        sigma: match proportion to that counterpart, in [0, 1]; 0 without any link.
        s_bar: mean confidence of those matches; 0 without any link.
        coverage: the smaller nu of its sightings (the evidence that decides unknown).
        displacement_m: how far its centroid went between the visits, by ``T_world_motion`` where that is
            known, for objects seen in both; else None.
        rotation_rad: rotation between the visits where it was estimated; else None.
        seen_through: share of its observed volume that the other visit saw to be empty, in [0, 1].
        appearance_change: how differently the same place looks in the other visit, in [0, 1];
            None where appearance could not be compared.
        decided_in_submap: submap of the current session that settled the label; None = still unknown.
        counterpart_instance: instance of the best counterpart in the other visit, chosen or rejected;
            None without any link. For an object of both visits: its own instance in session 1.
        replaced_by, replaces: the other object of a *replaced* event, if any.
        sightings: one per visit that saw it, in visit order.
        T_world_motion: 4x4 rigid motion row by row, p_current = T p_previous in the world frame, metres,
            where it was estimated by registration; else None.
    """

    object_id: int
    label: ChangeLabel
    confidence: float
    case: MatchCase
    sigma: float
    s_bar: float
    coverage: float
    displacement_m: float | None
    rotation_rad: float | None
    seen_through: float
    appearance_change: float | None
    decided_in_submap: int | None
    counterpart_instance: int | None
    replaced_by: int | None
    replaces: int | None
    sightings: tuple[Sighting, ...]
    T_world_motion: tuple[tuple[float, ...], ...] | None = None

    def sighting(self, session: int) -> Sighting | None:
        """The object's sighting in a visit, or None."""
        return next((s for s in self.sightings if s.session == session), None)


@dataclass(frozen=True)
class ReplacedEvent:
    """A disappeared and an appeared object that stood in the same place; each keeps its label."""

    disappeared_id: int
    appeared_id: int
    overlap: float  # share of the smaller object's bounds that the two have in common, in [0, 1]


@dataclass(frozen=True)
class ScoreMatrix:
    """Accumulated patch-to-mask evidence between all objects of two visits (paper, Eq. 5-7).

    Rows are instances of the previous visit, columns of the current one.

    Attributes:
        sigma: (n, m) |C_lk| / |C_l|, matches counted from the previous object's side.
        sigma_backward: (n, m) |C_lk| / |C_k|, counted from the current object's side.
        s_bar: (n, m) mean confidence of C_lk; 0 where it is empty.
        match_count: (n, m) |C_lk|.
        row_object_ids: (n,) object id of each row; column_object_ids: (m,) of each column.
        tau_sigma, tau_s: the gates that were applied.
    """

    sigma: NDArray[np.float32]
    sigma_backward: NDArray[np.float32]
    s_bar: NDArray[np.float32]
    match_count: NDArray[np.int32]
    row_object_ids: NDArray[np.int32]
    column_object_ids: NDArray[np.int32]
    tau_sigma: float
    tau_s: float


@dataclass(frozen=True)
class PatchLinks:
    """Best matches between the patches of two co-visible keyframes, in both directions (Eq. 2-4).

    Patches are numbered row by row on a grid of ``grid_shape`` = (H_f, W_f) over each image.

    Attributes:
        forward: (N0,) best current patch q for every previous patch p; forward_score: (N0,) s(p, q).
        backward: (N1,) best previous patch p for every current patch q; backward_score: (N1,).
        previous_shape, current_shape: patch grids (H_f, W_f).
    """

    forward: NDArray[np.uint16]
    forward_score: NDArray[np.float16]
    backward: NDArray[np.uint16]
    backward_score: NDArray[np.float16]
    previous_shape: tuple[int, int]
    current_shape: tuple[int, int]


@dataclass(frozen=True)
class CovisiblePair:
    """A keyframe of the other visit that sees the same place.

    Attributes:
        other_keyframe: position in the other visit's ``keyframes``.
        shared: fraction of this keyframe's measured pixels that the other one sees, in [0, 1].
    """

    other_keyframe: int
    shared: float


@dataclass(frozen=True)
class KeyframeRecord:
    """A keyframe of a result.

    Attributes:
        frame_index: the archive's frame number (names exported files).
        submap: which submap of N_sub keyframes it belongs to.
        covisible: keyframes of the other visit that see the same place, best first; may be empty.
    """

    frame_index: int
    timestamp_s: float | None
    submap: int
    camera: PinholeCamera
    T_world_camera: NDArray[np.float64]
    covisible: tuple[CovisiblePair, ...]


class SessionResult(Protocol):
    """One visit inside a result. ``k`` is a position in ``keyframes``."""

    index: int
    name: str
    captured_at: str | None
    archive: str
    up_world: NDArray[np.float64]  # (3,) unit vector against gravity
    keyframes: tuple[KeyframeRecord, ...]

    @property
    def points_world(self) -> NDArray[np.float32]:
        """(N, 3) metres, memory-mapped."""

    @property
    def colours(self) -> NDArray[np.uint8]:
        """(N, 3) RGB of the points."""

    @property
    def object_ids(self) -> NDArray[np.int32]:
        """(N,) object of each point, 0 = background."""

    def image_path(self, k: int) -> Path:
        """JPEG of the keyframe's colour image, inside the result folder."""

    def object_mask(self, k: int) -> NDArray[np.uint16]:
        """(h, w) object id of every second pixel (stride 2 of the keyframe's camera), 0 = background."""

    def semantic_heatmap(self, k: int) -> NDArray[np.float32]:
        """(H_f, W_f) in [0, 1], 1 = changed, NaN = not co-visible."""

    def geometric_heatmap(self, k: int) -> NDArray[np.float32]:
        """(h, w) signed metres, + = newly appeared foreground, NaN = not co-visible.

        In both visits the sign is the current visit's: + where the current visit has something nearer.
        """


class Result(Protocol):
    """A change map opened from its folder (``pipeline.store.open_result``)."""

    path: Path
    schema_version: int
    manifest: Mapping[str, Any]  # result.json as it is
    sessions: tuple[SessionResult, ...]
    objects: tuple[MapObject, ...]  # ascending object_id
    replaced: tuple[ReplacedEvent, ...]
    score_matrix: ScoreMatrix

    @property
    def belief(self) -> NDArray[np.uint8]:
        """(submaps of the current visit, objects) label believed after each submap; 255 = not met yet.

        Columns follow ``objects``; the last row equals the final labels.
        """

    def object(self, object_id: int) -> MapObject:
        """The object with that id; ``KeyError`` if there is none."""

    def links(self, previous_keyframe: int, current_keyframe: int) -> PatchLinks | None:
        """Patch matches of a co-visible pair (positions in ``keyframes``); None if not compared."""
