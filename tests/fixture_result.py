"""A small, complete and consistent result for tests of whatever reads results.

    from fixture_result import write_small_result          # tests/ is on sys.path (tests/conftest.py)
    path = write_small_result(tmp_path)                     # tmp_path / "small.oasis"

or take the fixtures ``small_result_path`` (a fresh copy for every test: write into it as you like) and
``small_result`` (that copy, opened). Two visits of six 320x240 keyframes in two submaps of three; images,
masks, geometry, links and evidence all come from one scene of boxes (tests/fixture_scene.py):

| id | label | |
|---|---|---|
| 1, 2, 3 | static | 3 by a partial match |
| 4, 5 | moved | 4 by (0.8, -0.2) m; 5 by (0.8, -0.1) m and turned by 90 degrees |
| 6, 12 | appeared | |
| 7 | appeared | replaces 8 |
| 8 | disappeared | replaced by 7 |
| 9 | disappeared | |
| 10, 11 | unknown | seen only where the other visit never looked |

Background points have object id 0. Patches are 16 px: grids of (15, 20).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from fixture_basis import small_basis, small_tables
from fixture_scene import CAMERA, OBJECTS, SceneObject, View, camera_pose, render, seen_by
from numpy.typing import NDArray

from pipeline.camera import invert_rigid, transform_points
from pipeline.result import (
    ChangeLabel,
    CovisiblePair,
    KeyframeRecord,
    MapObject,
    PatchLinks,
    ReplacedEvent,
    ScoreMatrix,
    Sighting,
)
from pipeline.settings import Settings
from pipeline.store import ResultWriter

KEYFRAMES, SUBMAP_SIZE, FRAME_STEP = 6, 3, 4  # archive frame indices 0, 4, 8, ...
PATCH_PX, GRID = 16, (15, 20)
CONFIDENCE = {ChangeLabel.UNKNOWN: 0.31, ChangeLabel.STATIC: 0.94}
SESSION_NAMES = ("before", "after")


@dataclass(frozen=True)
class _Visit:
    session: int
    views: list[View]
    poses: list[NDArray[np.float64]]
    counterfactual: list[View]  # the other visit's scene from the same poses

    @cached_property
    def _all_points_world(self) -> list[NDArray[np.float32]]:
        depths = [CAMERA.backproject(view.depth_m) for view in self.views]
        return [transform_points(T, points) for T, points in zip(self.poses, depths, strict=True)]

    def points_world(self, k: int) -> NDArray[np.float32]:
        return self._all_points_world[k]

    def patch_ids(self, k: int) -> NDArray[np.uint16]:
        return self.views[k].object_ids[PATCH_PX // 2 :: PATCH_PX, PATCH_PX // 2 :: PATCH_PX].ravel()


def write_small_result(folder: Path, name: str = "small.oasis", key: str = "small-fixture") -> Path:
    """Write ``folder / name`` through ``ResultWriter`` and return its path; about a second."""
    visits, pairs, score_matrix = _scene()
    with ResultWriter(folder / name, key) as writer:
        for visit in visits:
            _write_visit(writer, visits, visit)
        for (j, k), links in pairs.items():
            writer.write_links(j * FRAME_STEP, k * FRAME_STEP, links)
        objects = [_map_object(visits, score_matrix, item) for item in OBJECTS]
        event = ReplacedEvent(disappeared_id=8, appeared_id=7, overlap=_overlap(8, 7))
        writer.write_objects(objects, [event], score_matrix, _belief(objects))
        basis = small_basis(objects, score_matrix)
        writer.write_basis(basis.arrays())
        for session, table in enumerate(small_tables(basis)):
            writer.write_evidence(session, table)
        writer.finish(
            {
                "settings": Settings().to_dict(),
                "inputs": [
                    {
                        "name": SESSION_NAMES[session],
                        "archive": f"archives/{SESSION_NAMES[session]}",
                        "format": "nerfstudio",
                        "fingerprint": f"{session:064x}",
                        "frames": KEYFRAMES * FRAME_STEP,
                        "keyframes": KEYFRAMES,
                        "captured_at": _captured_at(session),
                    }
                    for session in (0, 1)
                ],
                "timings_s": {
                    "open": 0.1,
                    "map_previous": 1.0,
                    "map_current": 1.1,
                    "compare": 2.0,
                    "decide": 0.1,
                },
                "warnings": ["frame 7 (rgb/00007.png) of after was left out: its pose is not rigid"],
            }
        )
    return folder / name


@cache
def _scene() -> tuple[list[_Visit], dict[tuple[int, int], PatchLinks], ScoreMatrix]:
    visits = [_visit(0), _visit(1)]
    pairs = {
        (j, k): _links(visits, j, k)
        for j in range(KEYFRAMES)
        for k in range(KEYFRAMES)
        if _shared(visits, 0, j, k)
    }
    return visits, pairs, _score_matrix(visits, pairs)


def _captured_at(session: int) -> str:
    return ("2026-03-02T09:00:00Z", "2026-03-09T09:30:00Z")[session]


def _visit(session: int) -> _Visit:
    poses = [camera_pose(session, k) for k in range(KEYFRAMES)]
    return _Visit(
        session, [render(session, T) for T in poses], poses, [render(1 - session, T) for T in poses]
    )


def _shared(visits: list[_Visit], session: int, k: int, other_k: int) -> float:
    """Share of pixels of a keyframe that one keyframe of the other visit sees; 0 below 0.15."""
    other = visits[1 - session]
    points = visits[session].points_world(k)[::8, ::8].reshape(-1, 3).astype(np.float64)
    share = float(seen_by(points, [other.views[other_k]], [other.poses[other_k]], 0.05).mean())
    return share if share >= 0.15 else 0.0


def _write_visit(writer: ResultWriter, visits: list[_Visit], visit: _Visit) -> None:
    session = visit.session
    keyframes = []
    for k, view in enumerate(visit.views):
        frame_index = k * FRAME_STEP
        covisible = [CovisiblePair(j, _shared(visits, session, k, j)) for j in range(KEYFRAMES)]
        ranked = sorted((pair for pair in covisible if pair.shared), key=lambda pair: -pair.shared)
        keyframes.append(
            KeyframeRecord(
                frame_index, frame_index / 10.0, k // SUBMAP_SIZE, CAMERA, visit.poses[k], tuple(ranked)
            )
        )
        writer.write_image(session, frame_index, view.rgb)
        writer.write_mask(session, frame_index, view.object_ids[::2, ::2])
        writer.write_heatmaps(session, frame_index, *_heatmaps(visits, visit, k))
        patches = view.rgb.reshape(GRID[0], PATCH_PX, GRID[1], PATCH_PX, 3).astype(np.float32) / 255.0
        writer.write_features(
            session, frame_index, np.concatenate([patches.mean((1, 3)), patches.std((1, 3))], axis=-1)
        )
    writer.write_session(
        session,
        name=SESSION_NAMES[session],
        captured_at=_captured_at(session),
        archive=f"archives/{SESSION_NAMES[session]}",
        up_world=np.array([0.0, 0.0, 1.0]),
        keyframes=keyframes,
    )
    writer.write_map(
        session,
        np.concatenate([visit.points_world(k)[::3, ::3].reshape(-1, 3) for k in range(KEYFRAMES)]),
        np.concatenate([view.rgb[::3, ::3].reshape(-1, 3) for view in visit.views]),
        np.concatenate([view.object_ids[::3, ::3].ravel() for view in visit.views]),
    )


def _heatmaps(visits: list[_Visit], visit: _Visit, k: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    own, counterpart = visit.views[k], visit.counterfactual[k]
    previous, current = (own, counterpart) if visit.session == 0 else (counterpart, own)
    geometric = (previous.depth_m - current.depth_m)[::2, ::2]
    other = visits[1 - visit.session]
    points = visit.points_world(k)[::2, ::2].reshape(-1, 3).astype(np.float64)
    seen = seen_by(points, other.views, other.poses, 0.05).reshape(geometric.shape)
    geometric = np.where(seen, geometric, np.nan).astype(np.float32)
    changed = (previous.object_ids != current.object_ids)[::2, ::2]
    half = PATCH_PX // 2
    share = changed.reshape(GRID[0], half, GRID[1], half).mean(axis=(1, 3))
    known = seen.reshape(GRID[0], half, GRID[1], half).mean(axis=(1, 3)) >= 0.5
    return np.where(known, share, np.nan).astype(np.float32), geometric


def _matches(
    visits: list[_Visit], session: int, k: int, other_k: int
) -> tuple[NDArray[np.uint16], NDArray[np.float16]]:
    """Best patch of the other keyframe for each patch of this one; objects are followed to where they are."""
    visit, other = visits[session], visits[1 - session]
    half = PATCH_PX // 2
    points = visit.points_world(k)[half::PATCH_PX, half::PATCH_PX].reshape(-1, 3).astype(np.float64)
    ids = visit.patch_ids(k)
    for item in OBJECTS:
        if len(item.boxes) == 2:
            here, there = (np.array(item.boxes[s]).mean(axis=0) for s in (session, 1 - session))
            points[ids == item.object_id] += there - here
    pixels, depth = CAMERA.project(transform_points(invert_rigid(other.poses[other_k]), points))
    column = np.clip(pixels[:, 0] // PATCH_PX, 0, GRID[1] - 1).astype(int)
    row = np.clip(pixels[:, 1] // PATCH_PX, 0, GRID[0] - 1).astype(int)
    best = row * GRID[1] + column
    inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels < [CAMERA.width, CAMERA.height]).all(axis=1)
    same = inside & (other.patch_ids(other_k)[best] == ids)
    wiggle = 0.02 * np.sin(np.arange(len(best)) * 1.7)
    return best.astype(np.uint16), (np.where(same, 0.93, 0.42) + wiggle).astype(np.float16)


def _links(visits: list[_Visit], previous_k: int, current_k: int) -> PatchLinks:
    forward, forward_score = _matches(visits, 0, previous_k, current_k)
    backward, backward_score = _matches(visits, 1, current_k, previous_k)
    return PatchLinks(forward, forward_score, backward, backward_score, GRID, GRID)


def _instances(session: int) -> list[int]:
    return [item.object_id for item in OBJECTS if session in item.boxes]


def _score_matrix(visits: list[_Visit], pairs: dict[tuple[int, int], PatchLinks]) -> ScoreMatrix:
    rows, columns = _instances(0), _instances(1)
    count, total = np.zeros((len(rows), len(columns))), np.zeros((len(rows), len(columns)))
    row_patches, column_patches = np.zeros(len(rows)), np.zeros(len(columns))
    for (j, k), links in pairs.items():
        before, after = visits[0].patch_ids(j), visits[1].patch_ids(k)
        kept = links.forward_score > 0.6
        for a, row_id in enumerate(rows):
            row_patches[a] += (before == row_id).sum()
            for b, column_id in enumerate(columns):
                matched = kept & (before == row_id) & (after[links.forward] == column_id)
                count[a, b] += matched.sum()
                total[a, b] += links.forward_score[matched].astype(np.float64).sum()
        for b, column_id in enumerate(columns):
            column_patches[b] += (after == column_id).sum()
    a, b = rows.index(8), columns.index(7)  # the replaced pair: many weak matches (a lookalike)
    count[a, b], total[a, b] = 0.7 * row_patches[a] // 1, 0.55 * (0.7 * row_patches[a] // 1)
    a, b = rows.index(3), columns.index(3)  # the partial match: few, but confident ones
    count[a, b], total[a, b] = count[a, b] // 4, total[a, b] / count[a, b] * (count[a, b] // 4)
    return ScoreMatrix(
        sigma=(count / np.maximum(row_patches[:, None], 1)).clip(0, 1).astype(np.float32),
        sigma_backward=(count / np.maximum(column_patches[None, :], 1)).clip(0, 1).astype(np.float32),
        s_bar=(total / np.maximum(count, 1)).astype(np.float32),
        match_count=count.astype(np.int32),
        row_object_ids=np.array(rows, dtype=np.int32),
        column_object_ids=np.array(columns, dtype=np.int32),
        tau_sigma=Settings().association.tau_sigma,
        tau_s=Settings().association.tau_s,
    )


def _sighting(visits: list[_Visit], item: SceneObject, session: int) -> Sighting:
    low, high = item.boxes[session]
    pixels = np.array([(view.object_ids == item.object_id).sum() for view in visits[session].views])
    order = np.argsort(-pixels, kind="stable")
    points = np.concatenate(
        [
            visits[session].points_world(k)[::3, ::3][view.object_ids[::3, ::3] == item.object_id]
            for k, view in enumerate(visits[session].views)
        ]
    )
    other = visits[1 - session]
    return Sighting(
        session=session,
        instance=_instances(session).index(item.object_id),
        centroid_world_m=tuple(np.round(np.add(low, high) / 2, 6).tolist()),
        box_min_world_m=tuple(np.round(low, 6).tolist()),
        box_max_world_m=tuple(np.round(high, 6).tolist()),
        point_count=len(points),
        coverage=round(float(seen_by(points.astype(np.float64), other.views, other.poses, 0.05).mean()), 4),
        keyframes=tuple(int(k) for k in order if pixels[k] >= 40),
    )


def _map_object(visits: list[_Visit], score: ScoreMatrix, item: SceneObject) -> MapObject:
    sightings = tuple(_sighting(visits, item, session) for session in sorted(item.boxes))
    rows, columns = score.row_object_ids.tolist(), score.column_object_ids.tolist()
    label, in_both = item.label, len(item.boxes) == 2
    first = sightings[0]
    if in_both:
        sigma, s_bar = _evidence(score, rows.index(item.object_id), columns.index(item.object_id))
        counterpart = sightings[1].instance
    else:
        line = (score.sigma if first.session == 0 else score.sigma.T)[first.instance]
        best = int(line.argmax())
        row, column = (first.instance, best) if first.session == 0 else (best, first.instance)
        sigma, s_bar = _evidence(score, row, column)
        counterpart = best if sigma > 0 else None
    distance = np.linalg.norm(np.subtract(sightings[-1].centroid_world_m, first.centroid_world_m))
    gone_or_new = label in (ChangeLabel.APPEARED, ChangeLabel.DISAPPEARED)
    return MapObject(
        object_id=item.object_id,
        label=label,
        confidence=CONFIDENCE.get(label, 0.86),
        case=item.case,
        sigma=sigma,
        s_bar=s_bar,
        coverage=min(sighting.coverage for sighting in sightings),
        displacement_m=round(float(distance), 6) if in_both else None,
        rotation_rad=(round(np.pi / 2, 6) if item.object_id == 5 else 0.0) if in_both else None,
        seen_through=0.9 if gone_or_new or label is ChangeLabel.MOVED else 0.0,
        appearance_change=None
        if label is ChangeLabel.UNKNOWN
        else 0.05
        if label is ChangeLabel.STATIC
        else 0.8,
        decided_in_submap=None if label is ChangeLabel.UNKNOWN else int(item.object_id in (3, 5, 12)),
        counterpart_instance=counterpart,
        replaced_by=7 if item.object_id == 8 else None,
        replaces=8 if item.object_id == 7 else None,
        sightings=sightings,
    )


def _evidence(score: ScoreMatrix, row: int, column: int) -> tuple[float, float]:
    return round(float(score.sigma[row, column]), 4), round(float(score.s_bar[row, column]), 4)


def _overlap(one: int, other: int) -> float:
    boxes = [next(iter(item.boxes.values())) for item in OBJECTS if item.object_id in (one, other)]
    (low_a, high_a), (low_b, high_b) = (np.array(box) for box in boxes)
    common = np.clip(np.minimum(high_a, high_b) - np.maximum(low_a, low_b), 0, None).prod()
    return round(float(common / min((high_a - low_a).prod(), (high_b - low_b).prod())), 4)


def _belief(objects: list[MapObject]) -> NDArray[np.uint8]:
    """Two submaps: in the first, late objects are not met (255) and slow ones still unknown."""
    final = np.array([item.label for item in objects], dtype=np.uint8)
    first = final.copy()
    for column, item in enumerate(objects):
        current = item.sighting(1)
        if current and all(k >= SUBMAP_SIZE for k in current.keyframes) and item.sighting(0) is None:
            first[column] = 255
        elif item.decided_in_submap != 0:
            first[column] = ChangeLabel.UNKNOWN
    return np.stack([first, final])
