"""Draw a scene from a seed and record both visits, with the ground truth."""

from __future__ import annotations

import importlib
import json
import os
import shutil
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, transform_points
from pipeline.errors import InputError, StorageError
from pipeline.ply import NOT_SCORED, LabelledPoints, write_ply
from pipeline.progress import ProgressEvent, Report, silent
from pipeline.result import ChangeLabel
from pipeline.synthetic.archive import ArchiveWriter
from pipeline.synthetic.atlas import TextureAtlas
from pipeline.synthetic.props import Workshop
from pipeline.synthetic.render import Renderer
from pipeline.synthetic.sensor import expose, measure, misplace
from pipeline.synthetic.truth import (
    SeenPoints,
    TruthSettings,
    assemble,
    label_points,
    motions,
    observed,
)
from pipeline.synthetic.world import SensorSettings, SyntheticScene

SCENES = ("office", "carpark", "warehouse", "market")
# For checks only: no setting, rule or weight is ever tuned on these.
HELD_OUT_SCENES = ("hillside", "tunnel")
_KINDS = SCENES + HELD_OUT_SCENES  # random numbers depend on the order
_FIRST_DAY = datetime(2026, 1, 5, 8, 0, tzinfo=UTC)
_TRUTH_STRIDE = 2  # every second pixel is enough for points 2 cm apart
_STAGE = "generate"
T = TypeVar("T")


def generate(
    scene: str,
    out: Path,
    seed: int,
    frames: int = 40,
    report: Report = silent,
    *,
    size: tuple[int, int] = (640, 480),
    sensor: SensorSettings | None = None,
    workers: int | None = None,
) -> None:
    """Write two visits of a synthetic scene: ``OUT/s0``, ``OUT/s1``, ``OUT/gt.ply``, ``OUT/gt.json``.

    The same arguments give the same bytes. ``gt.json`` holds the true motions (see ``truth.motions``).
    ``OUT/scene.json`` is for people and tests; nothing that processes the visits may need it.

    Args:
        scene: one of ``SCENES`` or ``HELD_OUT_SCENES``.
        out: folder to make; it must not exist, or be empty.
        seed: everything is drawn from it: layout, shapes, sizes, textures, counts, light, paths.
        frames: keyframes of each visit, at least 2.
        report: told of every keyframe.
        size: width and height of the images, pixels.
        sensor: noise of depth, image and poses; None = the scene's own.
        workers: threads that make keyframes; None = one for each processor. The bytes do not depend on it.

    Raises:
        InputError: an unknown scene, too few frames, a folder that is not empty or cannot be made.
        StorageError: writing failed on the way (disk full); nothing is left behind.
    """
    out = Path(out)
    if frames < 2:
        raise InputError(f"{frames} frames are too few for a visit", "ask for at least 2")
    if seed < 0:
        raise InputError(f"{seed} is not a seed", "it is a whole number from 0 on")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} exists already and is not an empty folder", "name a new one")
    drawn = build_scene(scene, seed, frames, size)
    unfinished = out.with_name(f".{out.name}.{os.getpid()}.part")
    try:
        unfinished.mkdir(parents=True)
    except OSError as error:
        raise InputError(f"cannot write {out}: {error.strerror or error}", "choose another place") from None
    try:
        record(drawn, unfinished, sensor or drawn.sensor, report, workers or _processors())
        if out.exists():
            out.rmdir()
        unfinished.rename(out)
    except OSError as error:
        raise StorageError(f"writing {out} failed: {error.strerror or error}") from None
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def build_scene(scene: str, seed: int, frames: int, size: tuple[int, int] = (640, 480)) -> SyntheticScene:
    """Draw a scene without rendering it.

    Raises:
        InputError: there is no scene of that name.
    """
    if scene not in _KINDS:
        raise InputError(f"there is no scene {scene!r}", f"choose one of {', '.join(_KINDS)}")
    shop = Workshop(np.random.default_rng([_KINDS.index(scene), seed]), TextureAtlas())
    standard = PinholeCamera(640, 480, 525.0, 525.0, 319.5, 239.5)
    module = importlib.import_module(f"pipeline.synthetic.{scene}")
    drawn: SyntheticScene = module.build(shop, seed, frames, standard.resized(*size))
    return drawn


def record(
    scene: SyntheticScene, folder: Path, sensor: SensorSettings, report: Report = silent, workers: int = 1
) -> LabelledPoints:
    """Record both visits of a scene into an existing folder and return its ground truth.

    Threads, not processes: numpy, OpenCV and Open3D run without Python's lock, and a forked child of a
    process that has used Open3D may hang.
    """
    rng = np.random.default_rng([_KINDS.index(scene.name), scene.seed, 1])
    renderers = [Renderer(*scene.mesh_of_visit(v), scene.atlas, scene.lighting[v]) for v in (0, 1)]
    start = _FIRST_DAY + timedelta(minutes=int(rng.integers(0, 300 * 24 * 60)))
    starts = (start, start + timedelta(days=int(rng.integers(1, 40)), minutes=int(rng.integers(-200, 200))))
    frames = len(scene.paths[0])
    archives = [
        ArchiveWriter(
            folder / f"s{visit}",
            scene.camera,
            f"{scene.name} {scene.seed}, visit {visit + 1}",
            starts[visit].strftime("%Y-%m-%dT%H:%M:%SZ"),
        )
        for visit in (0, 1)
    ]
    clouds = [SeenPoints(scene.truth_voxel_m) for _ in (0, 1)]
    reported = [misplace(scene.paths[visit], sensor, rng) for visit in (0, 1)]

    def keyframe(number: int) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        visit, index = divmod(number, frames)
        T_world_camera = scene.paths[visit][index]
        view = renderers[visit].view(scene.camera, T_world_camera)
        # Noise of its own for every frame: the order in which frames are made does not matter.
        noise = np.random.default_rng([_KINDS.index(scene.name), scene.seed, 2 + visit, index])
        rgb = expose(view, scene.lighting[visit].exposure, sensor, noise)
        archives[visit].add(index, rgb, measure(view, sensor, noise), reported[visit][index], index * 0.5)
        within = view.depth[::_TRUTH_STRIDE, ::_TRUTH_STRIDE]
        valid = (within > sensor.min_range_m) & (within < sensor.max_range_m)
        in_camera = scene.camera.strided(_TRUTH_STRIDE).backproject(np.where(valid, within, 0))[valid]
        owner = view.object_id[::_TRUTH_STRIDE, ::_TRUTH_STRIDE][valid]
        return clouds[visit].thinned(transform_points(T_world_camera, in_camera), owner)

    for number, (points_world, owner) in enumerate(_in_order(keyframe, 2 * frames, workers)):
        clouds[number // frames].add(points_world, owner)
        report(ProgressEvent(_STAGE, number + 1, 2 * frames))
    for archive in archives:
        archive.close()
    truth = _label(
        scene, list(_in_order(lambda v: clouds[v].points(), 2, workers)), renderers, sensor, workers
    )
    write_ply(folder / "gt.ply", truth)
    (folder / "gt.json").write_text(json.dumps(motions(scene, truth), indent=1) + "\n")
    (folder / "scene.json").write_text(json.dumps(describe(scene, truth), indent=1) + "\n")
    return truth


def _label(
    scene: SyntheticScene,
    seen: list[tuple[NDArray[np.float32], NDArray[np.int32]]],
    renderers: list[Renderer],
    sensor: SensorSettings,
    workers: int,
) -> LabelledPoints:
    settings = TruthSettings()
    partners: dict[int, int] = {}
    for thing in scene.objects:
        if thing.replaced_by is not None:
            partners[thing.object_id] = thing.replaced_by
            partners[thing.replaced_by] = thing.object_id

    def observed_of(visit: int) -> NDArray[np.bool_]:
        other = 1 - visit
        hit = renderers[other].first_hit
        path, farthest = scene.paths[other], sensor.max_range_m
        return observed(*seen[visit], scene.camera, path, hit, farthest, partners, settings)

    known = list(_in_order(observed_of, 2, workers))
    owners = (seen[0][1], seen[1][1])
    static = {thing.object_id for thing in scene.objects if thing.fate == "static"}
    moved = {thing.object_id for thing in scene.objects if thing.is_moved}
    labels = label_points(owners, (known[0], known[1]), static, moved, settings)
    return assemble((seen[0][0], seen[1][0]), owners, labels)


def _processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _in_order(make: Callable[[int], T], count: int, workers: int) -> Iterator[T]:
    """``make(0), make(1), ...`` made by several threads; few results wait at a time."""
    with ThreadPoolExecutor(workers) as pool:
        waiting: deque[Future[T]] = deque()
        try:
            for index in range(count):
                waiting.append(pool.submit(make, index))
                if len(waiting) > workers:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            for future in waiting:
                future.cancel()


def describe(scene: SyntheticScene, truth: LabelledPoints) -> dict[str, Any]:
    """What is in a scene, for people: counts, and of every object its class, poses, fate and label."""
    objects = []
    for thing in scene.objects:
        mine = truth.object_id == thing.object_id
        labels = [sorted({int(v) for v in truth.label[mine & (truth.session == s)]}) for s in (0, 1)]
        objects.append(
            {
                "object_id": thing.object_id,
                "class": thing.class_name,
                "fate": thing.fate,
                "story": thing.story,
                "symmetry_order": thing.symmetry_order,
                "replaced_by": thing.replaced_by,
                "T_world_object": [
                    None if pose is None else np.round(pose, 6).tolist() for pose in thing.poses
                ],
                "extent_m": np.round(np.diff(thing.mesh.bounds, axis=0)[0].astype(float), 4).tolist(),
                "points": [int((mine & (truth.session == s)).sum()) for s in (0, 1)],
                "labels": [[_label_name(code) for code in codes] for codes in labels],
            }
        )
    fates = [thing.fate for thing in scene.objects]
    return {
        "scene": scene.name,
        "seed": scene.seed,
        "frames": len(scene.paths[0]),
        "object_count": len(objects),
        "fates": {fate: fates.count(fate) for fate in sorted(set(fates))},
        "points": {
            _label_name(int(code)): int((truth.label == code).sum()) for code in np.unique(truth.label)
        },
        "objects": objects,
    }


def _label_name(code: int) -> str:
    return "not scored" if code == NOT_SCORED else ChangeLabel(code).name.lower()
