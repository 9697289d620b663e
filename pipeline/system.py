"""From two sessions to a change map: reads like the paper's system figure."""

from __future__ import annotations

import dataclasses
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from hashlib import blake2b
from itertools import count
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline import checkpoint
from pipeline.change.observe import MutualObservation, observe
from pipeline.correspondence.compare import (
    Comparison,
    Covisibility,
    VisitImages,
    compare,
    find_covisible,
)
from pipeline.errors import OasisError
from pipeline.mapping.dense_map import dense_map
from pipeline.mapping.front_end import KeyframeSinks, SessionGeometry, map_again, map_session, reopen_stores
from pipeline.mapping.keyframes import select_keyframes
from pipeline.mapping.objects import SessionObjects
from pipeline.mapping.scale import voxel_size_m
from pipeline.methods import MappedVisits, Method, Outcome, chosen_method
from pipeline.perception.protocols import FeatureExtractor
from pipeline.perception.registry import feature_extractor
from pipeline.progress import ProgressEvent, Report, Warned, silent
from pipeline.readers import open_session
from pipeline.readers.fingerprint import fingerprint
from pipeline.registration.between_visits import moved_geometry, register
from pipeline.result import CovisiblePair, KeyframeRecord, Result
from pipeline.session import Session
from pipeline.settings import Settings
from pipeline.store import ResultWriter, finished_result

# Changes whenever the same inputs and settings would give another result.
ENGINE_VERSION = 4
VISITS = ("previous", "current")
REGISTERED = 2  # the current visit's geometry, fused anew with corrected poses


def run(
    previous: Path | str,
    current: Path | str,
    *,
    settings: Settings | None = None,
    output: Path | str | None = None,
    report: Report = silent,
) -> Result:
    """Compare two visits of a place.

    Args:
        previous, current: session archives (see ``pipeline.readers``).
        settings: of the engine.
        output: the result folder to write (``NAME.oasis``); None = a temporary folder. A finished result of
            the same inputs and settings is taken as it is; an interrupted run goes on where it stopped.
        report: told about progress and about what had to be left out.

    Raises:
        InputError: an archive or a setting is wrong, or the sessions never see the same place.
        StorageError: the result cannot be written.
    """
    settings = settings or Settings()
    extractor, method = feature_extractor(settings), chosen_method(settings)
    report(ProgressEvent("open", 0, 2))
    sessions = (open_session(Path(previous)), open_session(Path(current)))
    for session in sessions:
        for line in session.warnings:
            report(Warned(line))
    fingerprints = tuple(fingerprint(session) for session in sessions)
    key = run_key(fingerprints, settings)
    report(ProgressEvent("open", 2, 2))
    path = Path(output) if output is not None else Path(tempfile.mkdtemp()) / "changes.oasis"
    finished = finished_result(path, key)
    if finished is not None:
        return finished
    with ResultWriter(path, key) as writer:
        return _Run(sessions, fingerprints, settings, extractor, method, writer, report).result()


def run_key(fingerprints: tuple[str, ...], settings: Settings) -> str:
    """Hash of everything that a result follows from."""
    content = {"engine": ENGINE_VERSION, "inputs": list(fingerprints), "settings": settings.to_dict()}
    return blake2b(json.dumps(content, sort_keys=True).encode(), digest_size=20).hexdigest()


class _Run:
    """One run: each method is a stage, and is skipped when an earlier run finished it."""

    def __init__(
        self,
        sessions: tuple[Session, Session],
        fingerprints: tuple[str, ...],
        settings: Settings,
        extractor: FeatureExtractor,
        method: Method,
        writer: ResultWriter,
        report: Report,
    ) -> None:
        self._sessions = sessions
        self._fingerprints = fingerprints
        self._settings = settings
        self._extractor = extractor
        self._method = method
        self._writer = writer
        self._report = report
        self._timings_s: dict[str, float] = {}
        self._registration: dict[str, Any] = {}
        self._warnings = [line for session in sessions for line in session.warnings]

    def result(self) -> Result:
        """All stages, in the order in which data walks."""
        geometries = self._register(self._front_end())
        covisibility = self._covisibility(geometries)
        observation = self._observe(geometries)
        mapped = self._mapped(geometries, covisibility, observation)
        objects = self._objects(mapped)
        visits = self._visit_images(geometries, objects)
        comparison = self._compare(visits, covisibility)
        outcome = self._decide(mapped, visits, comparison)
        return self._write(visits, covisibility, outcome)

    def _front_end(self) -> tuple[SessionGeometry, SessionGeometry]:
        settings = self._settings
        selected = tuple(select_keyframes(session, settings.keyframes) for session in self._sessions)
        # One voxel size for both visits, from the one that was there first.
        voxel_m = voxel_size_m(self._sessions[0], selected[0], settings)
        warnings: tuple[list[str], list[str]] = ([], [])
        with ThreadPoolExecutor(len(VISITS)) as threads:
            mapped = [
                threads.submit(self._map_visit, visit, selected[visit], voxel_m, warnings[visit])
                for visit in range(len(VISITS))
            ]
        # In visit order whichever thread was first: the same inputs give the same bytes.
        self._warnings += warnings[0] + warnings[1]
        return mapped[0].result(), mapped[1].result()

    def _map_visit(
        self, visit: int, positions: tuple[int, ...], voxel_m: float, warnings: list[str]
    ) -> SessionGeometry:
        stage = f"map_{VISITS[visit]}"

        def warn(line: str) -> None:
            warnings.append(line)
            self._report(Warned(line))

        with self._stage(stage, warnings) as is_done:
            folder = self._writer.work / stage
            if is_done:
                store, submaps = reopen_stores(folder, voxel_m, self._settings)
                stride = self._settings.image.geometry_stride
                return checkpoint.load_geometry(self._writer, visit, store, submaps, stride)
            geometry = map_session(
                self._sessions[visit],
                positions,
                voxel_m,
                self._extractor,
                self._settings,
                folder,
                self._sinks(visit),
                on_keyframe=self._progress(stage, len(positions)),
                warn=warn,
            )
            checkpoint.save_geometry(self._writer, visit, geometry)
            return geometry

    def _sinks(self, visit: int) -> KeyframeSinks:
        def write_image(frame_index: int, rgb: NDArray[np.uint8]) -> None:
            self._writer.write_image(visit, frame_index, rgb)

        def write_features(frame_index: int, features: NDArray[np.float16]) -> None:
            self._writer.write_features(visit, frame_index, features)

        return KeyframeSinks(write_image, write_features)

    def _register(
        self, geometries: tuple[SessionGeometry, SessionGeometry]
    ) -> tuple[SessionGeometry, SessionGeometry]:
        """The current visit laid on the previous one, in whose world the result stays."""
        if not self._settings.registration.enabled:
            return geometries
        previous, current = geometries
        folder, warnings = self._writer.work / "register", list[str]()
        with self._stage("register", warnings) as is_done:
            if is_done:
                self._registration = checkpoint.load_quality(self._writer, "registration")
                if self._writer.has_array(f"geometry_{REGISTERED}/poses"):
                    stores = reopen_stores(folder, current.surface.voxel_size_m, self._settings)
                    current = checkpoint.load_geometry(self._writer, REGISTERED, *stores, current.stride)
            else:
                found = register(previous, current, self._settings)
                self._registration = found.quality()
                if found.warning is not None:
                    warnings.append(found.warning)
                    self._report(Warned(found.warning))
                if found.keyframes is not None and found.keyframes.corrected:
                    is_lidar = self._sessions[1].depth_source == "lidar"
                    current = map_again(current, found.poses, self._settings, folder, is_lidar=is_lidar)
                    checkpoint.save_geometry(self._writer, REGISTERED, current)
                checkpoint.save_quality(self._writer, "registration", self._registration)
                self._report(ProgressEvent("register", 1, 1))
        self._warnings += warnings
        if self._registration["applied"] and not self._registration.get("keyframes_corrected"):
            # JSON keeps every bit of a float: a resumed run moves the visit exactly as the first one did.
            current = moved_geometry(current, np.array(self._registration["T_previous_current"]))
        return previous, current

    def _covisibility(self, geometries: tuple[SessionGeometry, SessionGeometry]) -> Covisibility:
        grids = tuple(self._features(visit, geometries[visit])(0).shape[:2] for visit in range(2))
        return find_covisible(*geometries, (grids[0], grids[1]), self._settings.correspondence)

    def _observe(self, geometries: tuple[SessionGeometry, SessionGeometry]) -> MutualObservation:
        sizes = tuple(len(geometry.surface.points_world) for geometry in geometries)
        with self._stage("observe") as is_done:
            if is_done:
                return checkpoint.load_observation(
                    self._writer, sizes[0], sizes[1], geometries[1].submap_count
                )
            total = 2 * sum(len(geometry.keyframes) for geometry in geometries)
            observation = observe(*geometries, self._settings, self._progress("observe", total))
            checkpoint.save_observation(self._writer, observation)
            return observation

    def _mapped(
        self,
        geometries: tuple[SessionGeometry, SessionGeometry],
        covisibility: Covisibility,
        observation: MutualObservation,
    ) -> MappedVisits:
        features = [self._features(visit, geometry) for visit, geometry in enumerate(geometries)]
        images = [self._images(visit, geometry) for visit, geometry in enumerate(geometries)]
        return MappedVisits(
            geometries=geometries,
            covisibility=covisibility,
            observation=observation,
            features=(features[0], features[1]),
            images=(images[0], images[1]),
            extractor=self._extractor,
            settings=self._settings,
        )

    def _objects(self, mapped: MappedVisits) -> tuple[SessionObjects, SessionObjects]:
        with self._stage("objects") as is_done:
            if is_done:
                return checkpoint.load_objects(self._writer, 0), checkpoint.load_objects(self._writer, 1)
            objects = self._method.find_objects(mapped)
            for visit, of_visit in enumerate(objects):
                checkpoint.save_objects(self._writer, visit, of_visit)
            self._report(ProgressEvent("objects", 2, 2))
            return objects

    def _visit_images(
        self,
        geometries: tuple[SessionGeometry, SessionGeometry],
        objects: tuple[SessionObjects, SessionObjects],
    ) -> tuple[VisitImages, VisitImages]:
        visits = [
            VisitImages(
                geometry, objects[visit], self._features(visit, geometry), self._images(visit, geometry)
            )
            for visit, geometry in enumerate(geometries)
        ]
        return visits[0], visits[1]

    def _compare(self, visits: tuple[VisitImages, VisitImages], covisibility: Covisibility) -> Comparison:
        frames = [[keyframe.frame_index for keyframe in visit.geometry.keyframes] for visit in visits]
        with self._stage("compare") as is_done:
            if is_done:
                return checkpoint.load_comparison(self._writer)
            comparison = compare(
                *visits,
                covisibility,
                self._extractor,
                self._settings,
                write_links=lambda k0, k1, links: self._writer.write_links(
                    frames[0][k0], frames[1][k1], links
                ),
                write_heatmaps=lambda visit, k, semantic, geometric: self._writer.write_heatmaps(
                    visit, frames[visit][k], semantic, geometric
                ),
                on_step=lambda done, total: self._report(ProgressEvent("compare", done, total)),
            )
            checkpoint.save_comparison(self._writer, comparison)
            return comparison

    def _decide(
        self, mapped: MappedVisits, visits: tuple[VisitImages, VisitImages], comparison: Comparison
    ) -> Outcome:
        with self._stage("decide"):
            on_submap = self._progress("decide", len(comparison.evidence))
            return self._method.conclude(mapped, visits, comparison, on_submap)

    def _write(
        self,
        visits: tuple[VisitImages, VisitImages],
        covisibility: Covisibility,
        outcome: Outcome,
    ) -> Result:
        assembled = outcome.assembled
        ids = (assembled.ids0, assembled.ids1)
        covisible = (covisibility.of_previous, covisibility.of_current)
        total = sum(len(visit.geometry.keyframes) for visit in visits)
        started = time.perf_counter()
        step = self._counter("write", total)
        with ThreadPoolExecutor(len(VISITS)) as threads:
            maps = list(
                threads.map(
                    lambda images: dense_map(images.geometry, images.objects.instance_of_voxel, step), visits
                )
            )
        for visit, images in enumerate(visits):
            geometry, session = images.geometry, self._sessions[visit]
            for k, keyframe in enumerate(geometry.keyframes):
                self._writer.write_mask(
                    visit, keyframe.frame_index, ids[visit][images.objects.mask(geometry, k)]
                )
            points = maps[visit]
            self._writer.write_map(visit, points.points_world, points.colours, ids[visit][points.instances])
            self._writer.write_session(
                visit,
                name=session.name,
                captured_at=session.captured_at,
                archive=str(session.path),
                up_world=geometry.surface.up_world,
                keyframes=_keyframe_records(geometry, covisible[visit]),
            )
            self._writer.write_evidence(visit, outcome.evidence[visit])
        self._writer.write_objects(
            assembled.objects, assembled.replaced, assembled.score_matrix, assembled.belief
        )
        if outcome.moves is not None:
            self._writer.write_moves(outcome.moves)
        if outcome.basis is not None:
            self._writer.write_basis(outcome.basis)
        self._timings_s["write"] = round(time.perf_counter() - started, 3)
        return self._writer.finish(self._manifest(visits, outcome))

    def _manifest(self, visits: tuple[VisitImages, VisitImages], outcome: Outcome) -> dict[str, object]:
        return {
            "settings": self._settings.to_dict(),
            "inputs": [
                {
                    "name": session.name,
                    "archive": str(session.path),
                    "format": session.format,
                    "fingerprint": self._fingerprints[visit],
                    "frames": len(session.frames),
                    "keyframes": len(visits[visit].geometry.keyframes),
                    "captured_at": session.captured_at,
                    **({"origin": dataclasses.asdict(session.origin)} if session.origin else {}),
                }
                for visit, session in enumerate(self._sessions)
            ],
            "weights": {"features": self._extractor.weights_hash},
            "quality": {
                "voxel_size_m": round(visits[0].geometry.surface.voxel_size_m, 6),
                "registration": self._registration,
                **outcome.quality,
            },
            "warnings": self._warnings,
            "timings_s": self._timings_s,
        }

    def _features(self, visit: int, geometry: SessionGeometry) -> Callable[[int], NDArray[np.float16]]:
        frames = [keyframe.frame_index for keyframe in geometry.keyframes]
        return lambda k: self._writer.read_features(visit, frames[k])

    def _images(self, visit: int, geometry: SessionGeometry) -> Callable[[int], NDArray[np.uint8]]:
        frames = [keyframe.frame_index for keyframe in geometry.keyframes]
        return lambda k: self._writer.read_image(visit, frames[k])

    def _progress(self, stage: str, total: int) -> Callable[[int], None]:
        return lambda done: self._report(ProgressEvent(stage, done, total))

    def _counter(self, stage: str, total: int) -> Callable[[int], None]:
        """Progress of a stage that several threads work on: every call is one step more."""
        numbers, lock = count(1), Lock()

        def step(_: int) -> None:
            with lock:
                self._report(ProgressEvent(stage, next(numbers), total))

        return step

    @contextmanager
    def _stage(self, name: str, warnings: list[str] | None = None) -> Iterator[bool]:
        """Time a stage and mark it done; yields whether it was done before (a resumed run).

        Args:
            name: of the stage.
            warnings: collects what the stage warns about, and gets back what it warned about before.
        """
        warnings = [] if warnings is None else warnings
        if self._writer.stage_done(name):
            info = self._writer.stage_info(name)
            self._timings_s[name] = info["seconds"]
            warnings += info["warnings"]
            yield True
            return
        started = time.perf_counter()
        try:
            yield False
        except (MemoryError, RecursionError) as error:
            raise OasisError(f"stage {name!r} ran out of memory", "raise surface.voxel_size_m") from error
        seconds = round(time.perf_counter() - started, 3)
        self._timings_s[name] = seconds
        self._writer.mark_stage(name, {"seconds": seconds, "warnings": warnings})


def _keyframe_records(
    geometry: SessionGeometry, covisible: tuple[tuple[CovisiblePair, ...], ...]
) -> list[KeyframeRecord]:
    return [
        KeyframeRecord(
            frame_index=keyframe.frame_index,
            timestamp_s=keyframe.timestamp_s,
            submap=keyframe.submap,
            camera=keyframe.camera,
            T_world_camera=keyframe.T_world_camera,
            covisible=covisible[k],
        )
        for k, keyframe in enumerate(geometry.keyframes)
    ]
