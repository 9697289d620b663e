"""Ground truth: what the cameras of each visit truly saw, labelled with what could be known from both.

Seen in both visits but elsewhere, or turned, is ``moved`` (by more than 5 cm or 10 degrees, see ``motion``);
a place that the other visit never looked at is not scored (255). Occluded is not observed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, invert_rigid, transform_points
from pipeline.ply import NOT_SCORED, LabelledPoints
from pipeline.result import ChangeLabel
from pipeline.synthetic.motion import T_world_motion
from pipeline.synthetic.world import SyntheticScene

# (camera centre in the world, points in the world) -> distance of the first hit over that of the point,
# and the object hit; see Renderer.first_hit.
FirstHit = Callable[[NDArray[np.float64], NDArray[np.float32]], tuple[NDArray[np.float32], NDArray[np.int32]]]

COLOURS: dict[int, tuple[int, int, int]] = {
    ChangeLabel.STATIC: (46, 160, 67),
    ChangeLabel.APPEARED: (218, 54, 51),
    ChangeLabel.DISAPPEARED: (47, 111, 235),
    ChangeLabel.MOVED: (227, 160, 8),
    NOT_SCORED: (128, 128, 128),
}


@dataclass(frozen=True)
class TruthSettings:
    """When an object counts as seen, and its place as observed."""

    observed_share: float = 0.5  # of an object's points whose place the other visit must have observed
    min_points: int = 20  # an object of fewer points in a visit was not seen enough there
    min_seen_share: float = 0.15  # ... nor one of less than this share of its points in the other visit
    tolerance_m: float = 0.02
    tolerance_per_m: float = 0.005


class SeenPoints:
    """Points that one visit saw, thinned to one per voxel and object; what was seen first stays."""

    def __init__(self, voxel_m: float) -> None:
        self._voxel_m = voxel_m
        self._points = [np.zeros((0, 3), dtype=np.float32)]
        self._owners = [np.zeros(0, dtype=np.int32)]

    def add(self, points_world: NDArray[np.float32], object_id: NDArray[np.int32]) -> None:
        """Add what a keyframe saw: (N, 3) metres, exactly on the surfaces, and (N,) their objects.

        What was thinned already need not be thinned again, but the order of the keyframes counts.
        """
        self._points.append(points_world)
        self._owners.append(object_id)

    def points(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """All points of the visit, (N, 3) metres, and their objects, (N,), 0 = background."""
        points, owners = self.thinned(np.concatenate(self._points), np.concatenate(self._owners))
        self._points, self._owners = [points], [owners]
        return points, owners

    def thinned(
        self, points: NDArray[np.float32], owners: NDArray[np.int32]
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """The first of the points in each voxel of each object; any thread may call it."""
        cells = np.floor(points / self._voxel_m).astype(np.int64) + (1 << 15)
        key = cells[:, 0] << 48 ^ cells[:, 1] << 32 ^ cells[:, 2] << 16 ^ owners
        _, first = np.unique(key, return_index=True)
        first.sort()
        return points[first], owners[first]


def observed(
    points_world: NDArray[np.float32],
    object_id: NDArray[np.int32],
    camera: PinholeCamera,
    path: NDArray[np.float64],
    first_hit: FirstHit,
    max_range_m: float,
    partners: dict[int, int],
    settings: TruthSettings,
) -> NDArray[np.bool_]:
    """Whether the place of each point was observed by another visit: seen, or seen through.

    Args:
        points_world: (N, 3) of one visit.
        object_id: (N,) of the points.
        camera: of the other visit.
        path: true T_world_camera of the other visit, (frames, 4, 4).
        first_hit: casts rays into the world of the other visit.
        max_range_m: farther away nothing is measured.
        partners: for an object, the one that stands in its place in the other visit: to see that is to
            observe the place, although it hides the very point.
        settings: tolerances.
    """
    known = np.zeros(len(points_world), dtype=bool)
    successor = np.zeros(int(object_id.max(initial=0)) + 1, dtype=np.int32)
    for number, other in partners.items():
        if number < len(successor):
            successor[number] = other
    partner = successor[object_id]
    for T_world_camera in path:
        open_points = np.flatnonzero(~known)
        if not len(open_points):
            break
        in_camera = transform_points(invert_rigid(T_world_camera), points_world[open_points])
        pixel, z = camera.project(in_camera)
        inside = (z > 0.1) & (z < max_range_m)
        inside &= (
            (pixel > -0.5).all(1) & (pixel[:, 0] < camera.width - 0.5) & (pixel[:, 1] < camera.height - 0.5)
        )
        candidates = open_points[inside]
        if not len(candidates):
            continue
        centre = T_world_camera[:3, 3]
        share, owner = first_hit(centre, points_world[candidates])
        distance = np.linalg.norm(points_world[candidates] - centre, axis=1)
        tolerance = settings.tolerance_m + settings.tolerance_per_m * distance
        free = share * distance >= distance - tolerance
        free |= (owner > 0) & (owner == partner[candidates])
        known[candidates[free]] = True
    return known


def label_points(
    object_id: tuple[NDArray[np.int32], NDArray[np.int32]],
    known: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    static: set[int],
    moved: set[int],
    settings: TruthSettings,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Labels of the points of both visits.

    Args:
        object_id: of the points of visit 0 and visit 1, 0 = background.
        known: whether the other visit observed the place of each point.
        static: objects that stand at the same place in both visits.
        moved: objects that stand at another place in each visit; all others are there in one visit only.
        settings: when an object counts as seen.

    Returns:
        Labels of visit 0 and visit 1: ``ChangeLabel`` codes or 255.
    """
    labels = [np.where(known[visit], ChangeLabel.STATIC, NOT_SCORED).astype(np.uint8) for visit in (0, 1)]
    for number in np.union1d(object_id[0], object_id[1]):
        if number == 0:
            continue
        mine = [ids == number for ids in object_id]
        counts = [int(chosen.sum()) for chosen in mine]
        least = max(settings.min_points, settings.min_seen_share * max(counts))
        for visit in (0, 1):
            if not counts[visit]:
                continue
            place_observed = bool(known[visit][mine[visit]].mean() >= settings.observed_share)
            label: int = (ChangeLabel.DISAPPEARED, ChangeLabel.APPEARED)[visit]
            if int(number) in static:
                label = ChangeLabel.STATIC if all(counts) or place_observed else NOT_SCORED
            elif int(number) in moved and min(counts) >= least:
                label = ChangeLabel.MOVED
            elif not place_observed or counts[visit] < counts[1 - visit]:
                # Of a moved object seen well in the other visit only, these few points tell nothing.
                label = NOT_SCORED
            labels[visit][mine[visit]] = label
    return labels[0], labels[1]


def assemble(
    points_world: tuple[NDArray[np.float32], NDArray[np.float32]],
    object_id: tuple[NDArray[np.int32], NDArray[np.int32]],
    labels: tuple[NDArray[np.uint8], NDArray[np.uint8]],
) -> LabelledPoints:
    """One cloud of both visits, coloured by label."""
    label = np.concatenate(labels)
    colours = np.zeros((256, 3), dtype=np.uint8)
    for code, colour in COLOURS.items():
        colours[code] = colour
    return LabelledPoints(
        points_world=np.concatenate(points_world),
        colours=colours[label],
        session=np.repeat(np.array([0, 1], dtype=np.uint8), [len(ids) for ids in object_id]),
        label=label,
        object_id=np.concatenate(object_id),
        confidence=np.ones(len(label), dtype=np.float32),
    )


def motions(scene: SyntheticScene, truth: LabelledPoints) -> dict[str, Any]:
    """What ``gt.json`` holds: how each object seen in both visits got from one pose to the other.

    Objects labelled moved, and the static ones that were jolted by less than counts as a move; a static
    object without a motion did not move at all.

    Returns:
        ``schema_version`` 1; ``motions``: of each, ``object_id``, ``T_world_motion`` (4x4, rows, metres; a
        point of the object in the world goes from p in the previous visit to T p in the current one) and
        ``symmetry_order`` (1 = none, n = n-fold about the object's up axis, 0 = any angle); ``kinds``: how
        each changed object changed, by object id (see ``changes``).
    """
    shown = np.isin(truth.label, (ChangeLabel.MOVED, ChangeLabel.STATIC))
    seen = [set(truth.object_id[shown & (truth.session == visit)].tolist()) for visit in (0, 1)]
    return {
        "schema_version": 1,
        "motions": [
            {
                "object_id": thing.object_id,
                "T_world_motion": np.round(T_world_motion(thing), 9).tolist(),
                "symmetry_order": thing.symmetry_order,
            }
            for thing in scene.objects
            if thing.object_id in seen[0] & seen[1] and (thing.is_moved or thing.story == "jolted")
        ],
        "kinds": {str(thing.object_id): thing.story or thing.fate for thing in scene.objects},
    }
