"""Ground truth in our schema from 3RScan's own annotations.

World frame: the coordinates of the reference scan (z up), which is the previous visit. The rescan, the
current visit, is aligned by its ``transform``. Object ids are the reference's instance ids; what is in the
rescan only gets ids after the last one of the reference, because ids may collide.

- In both scans: *moved* if the annotated pose differs by more than 5 cm at the instance's centroid or by
  more than 1 degree up to its symmetry (``MoveThreshold``, the rule of LivingScenes: a ``rigid`` entry need
  not be a move), else *static*.
- In the reference only: *disappeared*, whether or not ``removed`` lists it. In the rescan only: *appeared*
  (there is no list of those). Unlisted ones only where the other mesh comes close to their place: there
  was a look at it.
- Not scored (255): what changed its shape (``nonrigid``); of look-alikes (``ambiguity``) one that moved to
  where another one stood, because nobody could tell; what ``removed`` lists although the rescan has it;
  vertices without instance or of structure (wall, floor, ceiling) where the other mesh has nothing near.

There are no dates in 3RScan: reference and rescan need not be in the order of time.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.camera import transform_points
from pipeline.errors import InputError, StorageError
from pipeline.evaluation.ground_truth import SCHEMA_VERSION, GroundTruth, Motion
from pipeline.evaluation.motion_error import rotation_error_rad
from pipeline.evaluation.threerscan_files import AnnotatedScan, Rescan, read_rescan, read_scan
from pipeline.ply import NOT_SCORED, LabelledPoints, write_ply
from pipeline.result import ChangeLabel

_UP = np.array([0.0, 0.0, 1.0])
_COLOURS = {
    ChangeLabel.STATIC: (46, 160, 67),
    ChangeLabel.APPEARED: (218, 54, 51),
    ChangeLabel.DISAPPEARED: (47, 111, 235),
    ChangeLabel.MOVED: (227, 160, 8),
}


@dataclass(frozen=True)
class MoveThreshold:
    """What counts as a move; the defaults are LivingScenes' (Zhu et al., CVPR 2024)."""

    translation_m: float = 0.05
    rotation_deg: float = 1.0


@dataclass(frozen=True)
class ThreeRScanSettings:
    """How annotations are read.

    Attributes:
        threshold: what counts as a move.
        structure: labels that are background, not objects.
        seen_within_m: a place was looked at if the other mesh comes this near.
        seen_share: of an instance's vertices whose place must have been looked at.
        same_place_m: a look-alike this close to another one's old place took it.
    """

    threshold: MoveThreshold = field(default_factory=MoveThreshold)
    structure: frozenset[str] = frozenset({"wall", "floor", "ceiling"})
    seen_within_m: float = 0.3
    seen_share: float = 0.5
    same_place_m: float = 0.3


def threerscan_truth(
    index: Path | str, scans: Path | str, rescan_id: str, settings: ThreeRScanSettings | None = None
) -> GroundTruth:
    """Ground truth of a reference (visit 0) and one of its rescans (visit 1), in the reference's frame.

    Args:
        index: ``3RScan.json``.
        scans: folder that holds a folder per scan id.
        rescan_id: of the current visit.
        settings: thresholds; None = defaults.

    Raises:
        InputError: a file is missing or not in 3RScan's format, or the rescan is of the test split, whose
            moves have no transforms.
    """
    rescan = read_rescan(Path(index), rescan_id)
    if any(entry.T_rescan_reference is None for entry in rescan.rigid):
        raise InputError(
            f"rescan {rescan_id} is of the {rescan.split or 'test'} split: its moves have no transforms",
            "choose a rescan of the train or validation split",
        )
    previous, current = (read_scan(Path(scans) / name) for name in (rescan.reference, rescan_id))
    return truth_of_pair(rescan, previous, current, settings or ThreeRScanSettings())


def truth_of_pair(
    rescan: Rescan, previous: AnnotatedScan, current: AnnotatedScan, settings: ThreeRScanSettings
) -> GroundTruth:
    """Like :func:`threerscan_truth`, for annotations already in memory."""
    current_world = np.asarray(transform_points(rescan.T_reference_rescan, current.points), dtype=np.float64)
    owners = (
        _objects_of_reference(previous, settings.structure),
        _objects_of_rescan(rescan, previous, current, settings.structure),
    )
    points = (previous.points, current_world)
    near = tuple(_near(points[v], points[1 - v], settings.seen_within_m) for v in (0, 1))
    motions = _motions(rescan)
    moved = {
        object_id
        for object_id, motion in motions.items()
        if _is_move(motion, points[0][owners[0] == object_id], settings.threshold)
    }
    unknowable = set(rescan.nonrigid) | _taken_places(rescan, points[0], owners[0], motions, moved, settings)
    labels = tuple(np.where(near[v], ChangeLabel.STATIC, NOT_SCORED).astype(np.uint8) for v in (0, 1))
    ids = (set(owners[0].tolist()), set(owners[1].tolist()))
    for object_id in (ids[0] | ids[1]) - {0}:
        both = object_id in ids[0] and object_id in ids[1]
        for visit in (0, 1):
            mine = owners[visit] == object_id
            if not mine.any():
                continue
            label: int = (ChangeLabel.DISAPPEARED, ChangeLabel.APPEARED)[visit]
            if object_id in unknowable or (both and object_id in rescan.removed):
                label = NOT_SCORED
            elif both:
                label = ChangeLabel.MOVED if object_id in moved else ChangeLabel.STATIC
            elif object_id not in rescan.removed and near[visit][mine].mean() < settings.seen_share:
                label = NOT_SCORED
            labels[visit][mine] = label
    known = {
        object_id: motion
        for object_id, motion in motions.items()
        if object_id in ids[0] & ids[1] and object_id not in unknowable | rescan.removed
    }
    return GroundTruth(_assembled(points, owners, (labels[0], labels[1])), known)


def write_truth(folder: Path | str, truth: GroundTruth) -> None:
    """Write ``gt.ply`` and ``gt.json`` into a folder, which is made.

    Raises:
        StorageError: it cannot be written.
    """
    folder = Path(folder)
    record = {
        "schema_version": SCHEMA_VERSION,
        "motions": [
            {
                "object_id": object_id,
                "T_world_motion": np.round(motion.T_world_motion, 9).tolist(),
                "symmetry_order": motion.symmetry_order,
            }
            for object_id, motion in sorted(truth.motions.items())
        ],
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_ply(folder / "gt.ply", truth.points)
        (folder / "gt.json").write_text(json.dumps(record, indent=1) + "\n")
    except OSError as error:
        raise StorageError(f"cannot write {folder}: {error.strerror or error}") from None


def _objects_of_reference(scan: AnnotatedScan, structure: frozenset[str]) -> NDArray[np.int32]:
    """(N,) object of each vertex of the reference; structure and what is not annotated are 0."""
    structural = [number for number, name in scan.names.items() if name in structure]
    return np.where(np.isin(scan.instance, structural), 0, scan.instance).astype(np.int32)


def _objects_of_rescan(
    rescan: Rescan, previous: AnnotatedScan, scan: AnnotatedScan, structure: frozenset[str]
) -> NDArray[np.int32]:
    """(N,) object of each vertex of the rescan, under the ids of the reference where it is the same thing."""
    renamed = {entry.rescan_id: entry.reference_id for entry in rescan.rigid}
    claimed = set(renamed.values())
    known = {int(number) for number in np.unique(previous.instance)} | set(previous.names)
    following = max(known | claimed, default=0) + 1
    owner = np.zeros(len(scan.instance), dtype=np.int32)
    for number in np.unique(scan.instance).tolist():
        if number == 0 or scan.names.get(number) in structure:
            continue
        if number in renamed:
            object_id = renamed[number]
        elif number in known and number not in claimed:
            object_id = number
        else:
            object_id, following = following, following + 1
        owner[scan.instance == number] = object_id
    return owner


def _motions(rescan: Rescan) -> dict[int, Motion]:
    """Annotated motions by object id: reference coordinates to the rescan's own, then to the reference's."""
    return {
        entry.reference_id: Motion(rescan.T_reference_rescan @ entry.T_rescan_reference, entry.symmetry_order)
        for entry in rescan.rigid
        if entry.T_rescan_reference is not None
    }


def _is_move(motion: Motion, points: NDArray[np.float64], threshold: MoveThreshold) -> bool:
    """Whether an instance moved, judged at the centroid of its vertices in the reference."""
    if not len(points):
        return False
    centre = points.mean(axis=0)
    shift = float(np.linalg.norm(transform_points(motion.T_world_motion, centre[None])[0] - centre))
    turn = rotation_error_rad(np.eye(3), motion.T_world_motion[:3, :3], _UP, motion.symmetry_order)
    return shift > threshold.translation_m or np.degrees(turn) > threshold.rotation_deg


def _taken_places(
    rescan: Rescan,
    points: NDArray[np.float64],
    owner: NDArray[np.int32],
    motions: dict[int, Motion],
    moved: set[int],
    settings: ThreeRScanSettings,
) -> set[int]:
    """Moved look-alikes that stand where another one of their group stood: no one could tell them apart."""
    taken = set()
    for group in rescan.ambiguity:
        centres = {i: points[owner == i].mean(axis=0) for i in group if (owner == i).any()}
        for object_id in moved & centres.keys():
            now = transform_points(motions[object_id].T_world_motion, centres[object_id][None])[0]
            others = [centre for i, centre in centres.items() if i != object_id]
            if any(np.linalg.norm(now - other) < settings.same_place_m for other in others):
                taken.add(object_id)
    return taken


def _near(points: NDArray[np.float64], others: NDArray[np.float64], radius_m: float) -> NDArray[np.bool_]:
    if not len(points) or not len(others):
        return np.zeros(len(points), dtype=bool)
    distance, _ = cKDTree(others).query(points, distance_upper_bound=radius_m)
    return np.isfinite(distance)


def _assembled(
    points: tuple[NDArray[np.float64], ...],
    owners: tuple[NDArray[np.int32], ...],
    labels: tuple[NDArray[np.uint8], ...],
) -> LabelledPoints:
    label = np.concatenate(labels)
    colours = np.full((256, 3), 128, dtype=np.uint8)
    for code, colour in _COLOURS.items():
        colours[code] = colour
    return LabelledPoints(
        points_world=np.concatenate(points).astype(np.float32),
        colours=colours[label],
        session=np.repeat(np.array([0, 1], dtype=np.uint8), [len(ids) for ids in owners]),
        label=label,
        object_id=np.concatenate(owners),
        confidence=np.ones(len(label), dtype=np.float32),
    )
