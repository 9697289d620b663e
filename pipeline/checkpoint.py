"""Saving what a finished stage computed, so that a run goes on where it was stopped."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from pipeline.association.aggregation import MatchEvidence
from pipeline.camera import PinholeCamera
from pipeline.change.observation import Observation
from pipeline.change.observe import MutualObservation
from pipeline.correspondence.compare import Comparison
from pipeline.correspondence.place_similarity import PlaceSimilarity
from pipeline.mapping.front_end import MappedKeyframe, SessionGeometry
from pipeline.mapping.keyframe_store import KeyframeStore
from pipeline.mapping.objects import SessionObjects
from pipeline.mapping.submap import SubmapSurfaces
from pipeline.mapping.surface import FusedSurface
from pipeline.store import ResultWriter

_SURFACE = ("points_world", "normals_world", "lab", "sample_count", "up_world", "camera_positions_world")


def save_geometry(writer: ResultWriter, visit: int, geometry: SessionGeometry) -> None:
    """Keep the front-end output of a visit."""
    surface, keyframes = geometry.surface, geometry.keyframes
    arrays: dict[str, NDArray[Any]] = {name: getattr(surface, name) for name in _SURFACE}
    arrays |= {
        "neighbour_indices": surface.neighbours.indices,
        "neighbour_indptr": surface.neighbours.indptr,
        "voxel_size_m": np.array(surface.voxel_size_m),
        "first_keyframe": geometry.first_keyframe,
        "log_colours": geometry.log_colours,
        "log_gains": geometry.log_gains,
        "remap": geometry.store.remap if geometry.store.remap is not None else np.zeros(0, np.int32),
        "frame_index": np.array([k.frame_index for k in keyframes]),
        "timestamp_s": np.array([np.nan if k.timestamp_s is None else k.timestamp_s for k in keyframes]),
        "submap": np.array([k.submap for k in keyframes]),
        "poses": np.array([k.T_world_camera for k in keyframes]),
        "cameras": np.array(
            [[c.width, c.height, c.fx, c.fy, c.cx, c.cy] for c in (k.camera for k in keyframes)], np.float64
        ),
    }
    for name, array in arrays.items():
        writer.save_array(f"geometry_{visit}/{name}", array)


def load_geometry(
    writer: ResultWriter, visit: int, store: KeyframeStore, submaps: SubmapSurfaces, stride: int
) -> SessionGeometry:
    """What ``save_geometry`` kept."""

    def load(name: str) -> NDArray[Any]:
        return writer.load_array(f"geometry_{visit}/{name}", mmap=False)

    indices, indptr = load("neighbour_indices"), load("neighbour_indptr")
    size = len(indptr) - 1
    neighbours = csr_matrix((np.ones(len(indices), np.float32), indices, indptr), shape=(size, size))
    surface = FusedSurface(
        voxel_size_m=float(load("voxel_size_m")),
        neighbours=neighbours,
        **{name: load(name) for name in _SURFACE},
    )
    store.remap = load("remap")
    keyframes = tuple(
        MappedKeyframe(
            int(index),
            None if np.isnan(timestamp) else float(timestamp),
            PinholeCamera(int(camera[0]), int(camera[1]), *map(float, camera[2:])),
            pose,
            int(submap),
        )
        for index, timestamp, camera, pose, submap in zip(
            load("frame_index"),
            load("timestamp_s"),
            load("cameras"),
            load("poses"),
            load("submap"),
            strict=True,
        )
    )
    return SessionGeometry(
        keyframes=keyframes,
        surface=surface,
        first_keyframe=load("first_keyframe"),
        log_colours=load("log_colours"),
        log_gains=load("log_gains"),
        submaps=submaps,
        store=store,
        stride=stride,
    )


def save_quality(writer: ResultWriter, name: str, quality: dict[str, Any]) -> None:
    """Keep what a stage says about itself in the manifest."""
    writer.save_array(f"quality/{name}", np.frombuffer(json.dumps(quality).encode(), np.uint8))


def load_quality(writer: ResultWriter, name: str) -> dict[str, Any]:
    """What ``save_quality`` kept."""
    quality: dict[str, Any] = json.loads(writer.load_array(f"quality/{name}", mmap=False).tobytes())
    return quality


def save_observation(writer: ResultWriter, observation: MutualObservation) -> None:
    """Keep what the visits saw of each other."""
    parts = {"of_current": observation.of_current.to_sparse()}
    parts |= {f"submap_{number:04d}": sparse for number, sparse in enumerate(observation.by_submap)}
    writer.save_array("observation/is_noise_0", observation.is_noise0)
    writer.save_array("observation/is_noise_1", observation.is_noise1)
    for part, sparse in parts.items():
        for name, array in sparse.items():
            writer.save_array(f"observation/{part}/{name}", np.asarray(array))


def load_observation(
    writer: ResultWriter, previous_voxels: int, current_voxels: int, submaps: int
) -> MutualObservation:
    """What ``save_observation`` kept."""
    names = tuple(Observation(0).to_sparse())

    def load(part: str) -> dict[str, NDArray[Any]]:
        return {name: writer.load_array(f"observation/{part}/{name}") for name in names}

    of_current, of_previous = Observation(current_voxels), Observation(previous_voxels)
    of_current.add_sparse(load("of_current"))
    by_submap = tuple(load(f"submap_{number:04d}") for number in range(submaps))
    for sparse in by_submap:
        of_previous.add_sparse(sparse)
    is_noise = [writer.load_array(f"observation/is_noise_{visit}", mmap=False) for visit in range(2)]
    return MutualObservation(of_current, of_previous, is_noise[0], is_noise[1], by_submap)


def save_objects(writer: ResultWriter, visit: int, objects: SessionObjects) -> None:
    """Keep the object map of a visit."""
    writer.save_array(f"objects_{visit}/instance_of_voxel", objects.instance_of_voxel)
    writer.save_array(f"objects_{visit}/view_pixels", objects.view_pixels)


def load_objects(writer: ResultWriter, visit: int) -> SessionObjects:
    """What ``save_objects`` kept."""
    view_pixels = writer.load_array(f"objects_{visit}/view_pixels", mmap=False)
    instances = writer.load_array(f"objects_{visit}/instance_of_voxel", mmap=False)
    return SessionObjects(instances, view_pixels.shape[1] - 1, view_pixels)


_EVIDENCE = ("link_count", "link_score", "leaving_count", "arriving_count")


def save_comparison(writer: ResultWriter, comparison: Comparison) -> None:
    """Keep match evidence and light."""
    for name in _EVIDENCE:
        stacked = np.stack([getattr(evidence, name) for evidence in comparison.evidence])
        writer.save_array(f"comparison/{name}", stacked)
    for visit, similarity in enumerate((comparison.similarity0, comparison.similarity1)):
        writer.save_array(f"comparison/similarity_total_{visit}", np.stack([s.total for s in similarity]))
        writer.save_array(f"comparison/similarity_count_{visit}", np.stack([s.count for s in similarity]))
    writer.save_array("comparison/light", np.zeros(0) if comparison.light is None else comparison.light)


def load_comparison(writer: ResultWriter) -> Comparison:
    """What ``save_comparison`` kept."""

    def load(name: str) -> NDArray[Any]:
        return writer.load_array(f"comparison/{name}", mmap=False)

    evidence = tuple(MatchEvidence(*parts) for parts in zip(*map(load, _EVIDENCE), strict=True))
    similarity = [
        tuple(
            PlaceSimilarity(total, count)
            for total, count in zip(
                load(f"similarity_total_{visit}"), load(f"similarity_count_{visit}"), strict=True
            )
        )
        for visit in range(2)
    ]
    light = load("light")
    return Comparison(evidence, similarity[0], similarity[1], light if light.size else None)
