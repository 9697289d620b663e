"""A finished result folder behind the protocols of ``pipeline.result``; arrays load when asked for."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import ResultError
from pipeline.result import (
    KeyframeRecord,
    MapObject,
    PatchLinks,
    ReplacedEvent,
    Result,
    ScoreMatrix,
    SessionResult,
)
from pipeline.store.files import read_npy
from pipeline.store.layout import MAP_ARRAYS, SCHEMA_VERSION, SCORE_ARRAYS, ResultLayout
from pipeline.store.records import keyframe_from_dict, objects_from_dict, replaced_from_dict

_RUN_AGAIN = "run it again"


def read_json(path: Path) -> Any:
    """Content of a JSON file of a result; ``ResultError`` when it is missing or broken."""
    try:
        return json.loads(path.read_bytes())
    except FileNotFoundError:
        raise ResultError(f"{path} is missing", f"the result is not complete, {_RUN_AGAIN}") from None
    except OSError as error:
        raise ResultError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise ResultError(f"{path} is not valid JSON ({error})", _RUN_AGAIN) from None


def read_array(path: Path, *, mmap: bool = True) -> NDArray[Any]:
    """An ``.npy`` of a result, memory-mapped read-only; ``ResultError`` when missing or truncated."""
    try:
        return read_npy(path, mmap=mmap)
    except FileNotFoundError:
        raise ResultError(f"{path} is missing", f"the result is not complete, {_RUN_AGAIN}") from None
    except (OSError, ValueError, EOFError):
        if mmap:  # an array without elements cannot be mapped, but can be read
            return read_array(path, mmap=False)
        raise ResultError(f"{path} is not a readable array", f"the result is damaged, {_RUN_AGAIN}") from None


def read_manifest(path: Path) -> Mapping[str, Any]:
    """``result.json`` of a result folder.

    Raises:
        ResultError: no folder, no or broken ``result.json``, or another schema version.
    """
    layout = ResultLayout(path)
    if not path.exists():
        raise ResultError(
            f"there is no result at {path}", "make one with `oasisview run PREVIOUS CURRENT -o RESULT`"
        )
    if not path.is_dir() or not layout.manifest.exists():
        raise ResultError(
            f"{path} is not a result", "it has no result.json; name a folder made by `oasisview run`"
        )
    manifest = read_json(layout.manifest)
    if not isinstance(manifest, dict):
        raise ResultError(f"{layout.manifest} is not a result's description", _RUN_AGAIN)
    schema = manifest.get("schema_version")
    if schema != SCHEMA_VERSION:
        raise ResultError(
            f"{path} was written by schema {schema}, this program reads {SCHEMA_VERSION}", _RUN_AGAIN
        )
    return manifest


@dataclass(eq=False)
class StoredSession:
    """One visit of a stored result (``pipeline.result.SessionResult``)."""

    index: int
    name: str
    captured_at: str | None
    archive: str
    up_world: NDArray[np.float64]
    keyframes: tuple[KeyframeRecord, ...]
    layout: ResultLayout = field(repr=False)

    @cached_property
    def points_world(self) -> NDArray[np.float32]:
        """(N, 3) metres, memory-mapped."""
        return read_array(self.layout.map_array(self.index, "points_world"))

    @cached_property
    def colours(self) -> NDArray[np.uint8]:
        """(N, 3) RGB, memory-mapped."""
        return read_array(self.layout.map_array(self.index, "colours"))

    @cached_property
    def object_ids(self) -> NDArray[np.int32]:
        """(N,) object of each point, 0 = background, memory-mapped."""
        return read_array(self.layout.map_array(self.index, "object_ids"))

    def image_path(self, k: int) -> Path:
        """JPEG of keyframe ``k``."""
        return self.layout.image(self.index, self.keyframes[k].frame_index)

    def object_mask(self, k: int) -> NDArray[np.uint16]:
        """(h, w) object id of every second pixel; ``ResultError`` when the file is damaged."""
        import cv2

        path = self.layout.mask(self.index, self.keyframes[k].frame_index)
        try:
            mask = cv2.imdecode(np.frombuffer(path.read_bytes(), dtype=np.uint8), cv2.IMREAD_UNCHANGED)
        except (OSError, cv2.error):
            mask = None
        if mask is None or mask.dtype != np.uint16:
            raise ResultError(f"{path} is not a readable mask", f"the result is damaged, {_RUN_AGAIN}")
        return np.asarray(mask, dtype=np.uint16)

    @property
    def evidence(self) -> NDArray[np.void]:
        """(K,) raw evidence of every instance, fields as in ``pipeline.change.evidence``."""
        return read_array(self.layout.evidence(self.index))

    def semantic_heatmap(self, k: int) -> NDArray[np.float32]:
        """(H_f, W_f) in [0, 1], NaN = not co-visible."""
        path = self.layout.semantic(self.index, self.keyframes[k].frame_index)
        return read_array(path, mmap=False).astype(np.float32)

    def geometric_heatmap(self, k: int) -> NDArray[np.float32]:
        """(h, w) signed metres, NaN = not co-visible."""
        path = self.layout.geometric(self.index, self.keyframes[k].frame_index)
        return read_array(path, mmap=False).astype(np.float32)

    def features(self, k: int) -> NDArray[np.float16] | None:
        """Patch features of keyframe ``k`` as they were written, memory-mapped; None if not kept."""
        path = self.layout.features(self.index, self.keyframes[k].frame_index)
        return read_array(path) if path.exists() else None


@dataclass(eq=False)
class StoredResult:
    """A change map opened from its folder (``pipeline.result.Result``)."""

    path: Path
    schema_version: int
    manifest: Mapping[str, Any] = field(repr=False)
    sessions: tuple[SessionResult, ...] = field(repr=False)
    objects: tuple[MapObject, ...] = field(repr=False)
    replaced: tuple[ReplacedEvent, ...] = field(repr=False)
    score_matrix: ScoreMatrix = field(repr=False)
    layout: ResultLayout = field(repr=False)

    @cached_property
    def belief(self) -> NDArray[np.uint8]:
        """(submaps of the current visit, objects) label believed after each submap; 255 = not met yet."""
        return read_array(self.layout.belief)

    @property
    def moves(self) -> NDArray[np.void] | None:
        """Pairs of objects laid over each other, fields as in ``association.moves.moves_table``.

        None in results of methods that lay nothing, and of before there were such pairs.
        """
        return read_array(self.layout.moves) if self.layout.moves.exists() else None

    @property
    def basis_arrays(self) -> Mapping[str, NDArray[Any]] | None:
        """What the labels follow from, for ``pipeline.change.basis``; None where it was not stored."""
        if not self.layout.basis.exists():
            return None
        try:
            with np.load(self.layout.basis, allow_pickle=False) as arrays:
                return dict(arrays)
        except Exception as error:  # zipfile, zlib and numpy raise many kinds for a damaged file
            raise ResultError(
                f"{self.layout.basis} is not readable", f"the result is damaged, {_RUN_AGAIN}"
            ) from error

    @cached_property
    def _by_id(self) -> dict[int, MapObject]:
        return {item.object_id: item for item in self.objects}

    def object(self, object_id: int) -> MapObject:
        """The object with that id; ``KeyError`` if there is none."""
        return self._by_id[object_id]

    def links(self, previous_keyframe: int, current_keyframe: int) -> PatchLinks | None:
        """Patch matches of a co-visible pair (positions in ``keyframes``); None if not compared."""
        previous = self.sessions[0].keyframes[previous_keyframe].frame_index
        current = self.sessions[1].keyframes[current_keyframe].frame_index
        path = self.layout.links(previous, current)
        if not path.exists():
            return None
        try:
            with np.load(path, allow_pickle=False) as arrays:
                return PatchLinks(
                    forward=arrays["forward"],
                    forward_score=arrays["forward_score"],
                    backward=arrays["backward"],
                    backward_score=arrays["backward_score"],
                    previous_shape=tuple(arrays["previous_shape"].tolist()),
                    current_shape=tuple(arrays["current_shape"].tolist()),
                )
        except Exception as error:  # zipfile, zlib and numpy raise many kinds for a damaged file
            raise ResultError(f"{path} is not readable", f"the result is damaged, {_RUN_AGAIN}") from error


def open_result(path: str | Path) -> Result:
    """Open a finished result folder; nothing large is read.

    Raises:
        ResultError: the folder is missing, incomplete, damaged, or of another schema version.
    """
    path = Path(path)
    manifest = read_manifest(path)
    layout = ResultLayout(path)
    record = read_json(layout.objects)
    scores: dict[str, Any] = {name: read_array(layout.score_array(name)) for name in SCORE_ARRAYS}
    read_array(layout.belief)
    try:
        objects, replaced = objects_from_dict(record), replaced_from_dict(record)
        gates = record["gates"]
        score_matrix = ScoreMatrix(**scores, tau_sigma=gates["tau_sigma"], tau_s=gates["tau_s"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ResultError(
            f"{layout.objects} is not what this program writes ({error!r})", _RUN_AGAIN
        ) from None
    sessions = tuple(_open_session(layout, index) for index in range(len(manifest.get("inputs", ()))))
    if len(sessions) < 2:
        raise ResultError(f"{layout.manifest} names fewer than two visits", _RUN_AGAIN)
    return StoredResult(path, SCHEMA_VERSION, manifest, sessions, objects, replaced, score_matrix, layout)


def _open_session(layout: ResultLayout, index: int) -> SessionResult:
    record = read_json(layout.session_record(index))
    try:
        session = StoredSession(
            index=index,
            name=record["name"],
            captured_at=record["captured_at"],
            archive=record["archive"],
            up_world=np.array(record["up_world"], dtype=np.float64).reshape(3),
            keyframes=tuple(keyframe_from_dict(keyframe) for keyframe in record["keyframes"]),
            layout=layout,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ResultError(
            f"{layout.session_record(index)} is not what this program writes ({error!r})", _RUN_AGAIN
        ) from None
    lengths = {len(read_array(layout.map_array(index, name))) for name in MAP_ARRAYS}
    if len(lengths) != 1:
        raise ResultError(f"the map arrays in {layout.session(index)} differ in length", _RUN_AGAIN)
    for file_of in (layout.image, layout.mask, layout.semantic, layout.geometric):
        for keyframe in session.keyframes:
            file = file_of(index, keyframe.frame_index)
            if not file.exists():
                raise ResultError(f"{file} is missing", f"the result is not complete, {_RUN_AGAIN}")
    return session


def finished_result(path: str | Path, key: str) -> Result | None:
    """The result at ``path`` if it is whole and has this key; None if it has to be computed."""
    try:
        result = open_result(path)
    except ResultError:
        return None
    return result if result.manifest.get("key") == key else None
