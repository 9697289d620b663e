"""Typed records to JSON and back, in one fixed formatting: the same values give the same bytes."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.result import (
    ChangeLabel,
    CovisiblePair,
    KeyframeRecord,
    MapObject,
    MatchCase,
    ReplacedEvent,
    Sighting,
)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in a result's JSON")


def to_json(value: Any) -> bytes:
    """UTF-8 JSON with sorted keys and a final newline; NaN and infinity are refused (``ValueError``)."""
    text = json.dumps(value, sort_keys=True, indent=1, allow_nan=False, ensure_ascii=False, default=_plain)
    return (text + "\n").encode()


def objects_to_dict(
    objects: Sequence[MapObject], replaced: Sequence[ReplacedEvent], tau_sigma: float, tau_s: float
) -> dict[str, Any]:
    """Content of ``objects.json``, objects in ascending ``object_id``."""
    ordered = sorted(objects, key=lambda item: item.object_id)
    return {
        "objects": [
            {**dataclasses.asdict(item), "label": item.label.name.lower(), "case": item.case.value}
            for item in ordered
        ],
        "replaced": [dataclasses.asdict(event) for event in replaced],
        "gates": {"tau_sigma": tau_sigma, "tau_s": tau_s},
    }


def objects_from_dict(record: Mapping[str, Any]) -> tuple[MapObject, ...]:
    """Objects of ``objects.json``; ``KeyError``, ``TypeError`` or ``ValueError`` when it is malformed."""
    return tuple(
        MapObject(
            **{
                **item,
                "label": ChangeLabel[item["label"].upper()],
                "case": MatchCase(item["case"]),
                "sightings": tuple(_sighting(sighting) for sighting in item["sightings"]),
                "T_world_motion": _matrix(item.get("T_world_motion")),
            }
        )
        for item in record["objects"]
    )


def _matrix(rows: Sequence[Sequence[float]] | None) -> tuple[tuple[float, ...], ...] | None:
    return None if rows is None else tuple(tuple(row) for row in rows)


def _sighting(record: Mapping[str, Any]) -> Sighting:
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in record.items()}
    return Sighting(**values)


def replaced_from_dict(record: Mapping[str, Any]) -> tuple[ReplacedEvent, ...]:
    """Replaced events of ``objects.json``."""
    return tuple(ReplacedEvent(**event) for event in record["replaced"])


def keyframe_to_dict(keyframe: KeyframeRecord) -> dict[str, Any]:
    """One entry of ``keyframes`` in ``session.json``."""
    return {
        "frame_index": keyframe.frame_index,
        "timestamp_s": keyframe.timestamp_s,
        "submap": keyframe.submap,
        "camera": dataclasses.asdict(keyframe.camera),
        "T_world_camera": np.asarray(keyframe.T_world_camera, dtype=np.float64).tolist(),
        "covisible": [dataclasses.asdict(pair) for pair in keyframe.covisible],
    }


def keyframe_from_dict(record: Mapping[str, Any]) -> KeyframeRecord:
    """Inverse of :func:`keyframe_to_dict`."""
    T_world_camera = np.array(record["T_world_camera"], dtype=np.float64).reshape(4, 4)
    T_world_camera.setflags(write=False)
    return KeyframeRecord(
        frame_index=int(record["frame_index"]),
        timestamp_s=record["timestamp_s"],
        submap=int(record["submap"]),
        camera=PinholeCamera(**record["camera"]),
        T_world_camera=T_world_camera,
        covisible=tuple(CovisiblePair(**pair) for pair in record["covisible"]),
    )
