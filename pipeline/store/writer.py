"""Writing a result: everything into ``NAME.oasis.partial/``, swapped in whole at the end.

```
NAME.oasis.partial/
  lock         held while a process writes
  result/      what will become NAME.oasis
  work/        key.json, stages/*.json (what is done), arrays that only later stages need
```
"""

from __future__ import annotations

import json
import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, StorageError
from pipeline.result import (
    ChangeLabel,
    KeyframeRecord,
    MapObject,
    PatchLinks,
    ReplacedEvent,
    Result,
    ScoreMatrix,
)
from pipeline.store.files import sync_tree, write_array, write_arrays, write_bytes, writing
from pipeline.store.layout import SCHEMA_VERSION, SCORE_ARRAYS, ResultLayout
from pipeline.store.lock import WriterLock
from pipeline.store.opened import finished_result, open_result, read_array
from pipeline.store.records import keyframe_to_dict, objects_to_dict, to_json
from pipeline.store.swap import recover_interrupted_swap, swap_in
from pipeline.store.versions import library_versions

JPEG_QUALITY = 92


class ResultWriter:
    """Builds one result folder; resumes what an earlier writer with the same key left behind.

    A stage writes its files, then calls ``mark_stage``; after a crash ``stage_done`` tells which stages
    need not run again. Use it as a context manager or call ``close``.
    """

    def __init__(self, path: str | Path, key: str) -> None:
        """Take the partial folder beside ``path``; one with another key is discarded.

        Args:
            path: the result folder to be, ``NAME.oasis``.
            key: hash of inputs and settings.

        Raises:
            InputError: something that is not a result stands at ``path``.
            StorageError: the folder cannot be written, or another process is writing it.
        """
        self.path = Path(path)
        self.key = key
        self.partial = self.path.with_name(self.path.name + ".partial")
        self.layout = ResultLayout(self.partial / "result")
        self._work = self.partial / "work"
        self._swapping = self._work / "swapping"
        if self.path.exists() and not ResultLayout(self.path).manifest.exists():
            raise InputError(f"{self.path} exists and is not a result", "choose another path for the result")
        with writing(self.partial):
            self.partial.mkdir(parents=True, exist_ok=True)
        self._lock = WriterLock(self.partial / "lock")
        try:
            with writing(self.partial):
                recover_interrupted_swap(self.path)
                for unfinished in self.partial.rglob(".*.tmp"):  # of a writer that was killed
                    unfinished.unlink()
                if not self._can_be_resumed():
                    shutil.rmtree(self.layout.root, ignore_errors=True)
                    shutil.rmtree(self._work, ignore_errors=True)
            write_bytes(self._work / "key.json", to_json({"key": key, "schema_version": SCHEMA_VERSION}))
        except BaseException:
            self._lock.release()
            raise

    def _can_be_resumed(self) -> bool:
        try:
            record = json.loads((self._work / "key.json").read_bytes())
        except (OSError, ValueError):
            return False
        if record != {"key": self.key, "schema_version": SCHEMA_VERSION}:
            return False
        # A crash while swapping may have left the replaced result, or half of it, where ours was built.
        return not self._swapping.exists() or finished_result(self.layout.root, self.key) is not None

    def __enter__(self) -> ResultWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the partial folder; it stays, and a writer with the same key goes on from it."""
        self._lock.release()

    # Stages and scratch

    @property
    def work(self) -> Path:
        """Folder for intermediate files of any kind; gone after ``finish``."""
        return self._work

    def _marker(self, stage: str) -> Path:
        return self._work / "stages" / f"{stage}.json"

    def stage_done(self, stage: str) -> bool:
        """Whether ``mark_stage`` was called for it, now or before a crash."""
        return self._marker(stage).exists()

    def stage_info(self, stage: str) -> dict[str, Any]:
        """What ``mark_stage`` was given; ``KeyError`` if the stage is not done."""
        try:
            return dict(json.loads(self._marker(stage).read_bytes()))
        except FileNotFoundError:
            raise KeyError(stage) from None

    def mark_stage(self, stage: str, info: Mapping[str, Any] | None = None) -> None:
        """Note that all files of a stage are written; ``info`` is small and JSON-like."""
        write_bytes(self._marker(stage), to_json(dict(info or {})))

    def save_array(self, name: str, array: NDArray[Any]) -> None:
        """Keep an intermediate array (``name`` may hold slashes) until ``finish``."""
        write_array(self._work / "arrays" / f"{name}.npy", array)

    def load_array(self, name: str, *, mmap: bool = True) -> NDArray[Any]:
        """An array kept by ``save_array``, memory-mapped read-only; ``ResultError`` if it is not there."""
        return read_array(self._work / "arrays" / f"{name}.npy", mmap=mmap)

    def has_array(self, name: str) -> bool:
        """Whether ``save_array`` kept it."""
        return (self._work / "arrays" / f"{name}.npy").exists()

    # Parts of the result

    def write_image(self, session: int, frame_index: int, image: NDArray[np.uint8] | bytes) -> None:
        """Colour image of a keyframe: (H, W, 3) RGB, or the bytes of a JPEG."""
        content = image if isinstance(image, bytes) else _encoded(image[:, :, ::-1], ".jpg", JPEG_QUALITY)
        write_bytes(self.layout.image(session, frame_index), content)

    def write_mask(self, session: int, frame_index: int, mask: NDArray[np.integer]) -> None:
        """(h, w) object id of every second pixel of a keyframe, 0 = background."""
        write_bytes(self.layout.mask(session, frame_index), _encoded(mask.astype(np.uint16), ".png", 3))

    def write_heatmaps(
        self, session: int, frame_index: int, semantic: NDArray[np.floating], geometric: NDArray[np.floating]
    ) -> None:
        """Heatmaps of a keyframe: (H_f, W_f) in [0, 1] and (h, w) signed metres, NaN = not co-visible."""
        write_array(self.layout.semantic(session, frame_index), semantic.astype(np.float16))
        write_array(self.layout.geometric(session, frame_index), geometric.astype(np.float16))

    def write_features(self, session: int, frame_index: int, features: NDArray[np.floating]) -> None:
        """Patch features of a keyframe, stored as float16 in the shape given."""
        write_array(self.layout.features(session, frame_index), features.astype(np.float16))

    def read_image(self, session: int, frame_index: int) -> NDArray[np.uint8]:
        """(H, W, 3) RGB image that ``write_image`` stored."""
        import cv2

        return cv2.cvtColor(cv2.imread(str(self.layout.image(session, frame_index))), cv2.COLOR_BGR2RGB)

    def read_features(self, session: int, frame_index: int) -> NDArray[np.float16]:
        """Features that ``write_features`` stored, memory-mapped read-only."""
        return read_array(self.layout.features(session, frame_index))

    def write_links(self, previous_frame: int, current_frame: int, links: PatchLinks) -> None:
        """Patch matches of a pair, named by the archive frame indices of its keyframes."""
        write_arrays(
            self.layout.links(previous_frame, current_frame),
            forward=links.forward.astype(np.uint16),
            forward_score=links.forward_score.astype(np.float16),
            backward=links.backward.astype(np.uint16),
            backward_score=links.backward_score.astype(np.float16),
            previous_shape=np.array(links.previous_shape, dtype=np.int32),
            current_shape=np.array(links.current_shape, dtype=np.int32),
        )

    def write_session(
        self,
        session: int,
        *,
        name: str,
        captured_at: str | None,
        archive: str,
        up_world: NDArray[np.floating],
        keyframes: Sequence[KeyframeRecord],
    ) -> None:
        """What defines a visit, with its keyframes in recording order."""
        record = {
            "name": name,
            "captured_at": captured_at,
            "archive": archive,
            "up_world": np.asarray(up_world, dtype=np.float64).tolist(),
            "keyframes": [keyframe_to_dict(keyframe) for keyframe in keyframes],
        }
        write_bytes(self.layout.session_record(session), to_json(record))

    def write_map(
        self,
        session: int,
        points_world: NDArray[np.floating],
        colours: NDArray[np.uint8],
        object_ids: NDArray[np.integer],
    ) -> None:
        """Map of a visit: (N, 3) metres, (N, 3) RGB, (N,) object ids with 0 = background."""
        if not len(points_world) == len(colours) == len(object_ids):
            raise ValueError(f"map arrays of {len(points_world)}, {len(colours)}, {len(object_ids)} points")
        write_array(self.layout.map_array(session, "points_world"), points_world.astype(np.float32))
        write_array(self.layout.map_array(session, "colours"), colours.astype(np.uint8))
        write_array(self.layout.map_array(session, "object_ids"), object_ids.astype(np.int32))

    def write_evidence(self, session: int, evidence: NDArray[np.void]) -> None:
        """(K,) structured rows of raw evidence, in instance order."""
        write_array(self.layout.evidence(session), evidence)

    def write_moves(self, moves: NDArray[np.void]) -> None:
        """Structured rows, one per pair of objects that was laid over each other."""
        write_array(self.layout.moves, moves)

    def write_basis(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """What the labels follow from (``pipeline.change.basis``), as named arrays."""
        write_arrays(self.layout.basis, **arrays)

    def write_objects(
        self,
        objects: Sequence[MapObject],
        replaced: Sequence[ReplacedEvent],
        score_matrix: ScoreMatrix,
        belief: NDArray[np.integer],
    ) -> None:
        """Objects (in ascending id, as the columns of ``belief``), events, evidence and belief."""
        dtypes = (np.float32, np.float32, np.float32, np.int32, np.int32, np.int32)
        for name, dtype in zip(SCORE_ARRAYS, dtypes, strict=True):
            write_array(self.layout.score_array(name), getattr(score_matrix, name).astype(dtype))
        write_array(self.layout.belief, belief.astype(np.uint8))
        record = objects_to_dict(objects, replaced, score_matrix.tau_sigma, score_matrix.tau_s)
        record["gates"] = {name: float(gate) for name, gate in record["gates"].items()}
        write_bytes(self.layout.objects, to_json(record))

    def finish(self, manifest: Mapping[str, Any]) -> Result:
        """Complete the result and put it in place of whatever result stood there.

        Inspectors' decisions (``review.sqlite``) of an older result survive: as they are when its key is
        the same, else beside the new ones as ``review-<n>.sqlite``.

        Args:
            manifest: settings, inputs, timings_s, warnings (weights, versions and summary are filled in
                when absent). Everything but ``timings_s`` must be the same for the same inputs.

        Raises:
            StorageError: writing failed; the partial folder is kept and can be resumed.
        """
        record = {
            "weights": {},
            "versions": library_versions(),
            "warnings": [],
            "timings_s": {},
            **manifest,
            "schema_version": SCHEMA_VERSION,
            "key": self.key,
        }
        record.setdefault("summary", self._summary())
        missing = {"settings", "inputs"} - record.keys()
        if missing:
            raise ValueError(f"the manifest lacks {', '.join(sorted(missing))}")
        write_bytes(self.layout.manifest, to_json(record))
        open_result(self.layout.root)  # a result that could not be opened must never replace one that can
        with writing(self.path):
            sync_tree(self.layout.root)
            write_bytes(self._swapping, b"")
            swap_in(self.layout.root, self.path, self.key)
            shutil.rmtree(self.partial, ignore_errors=True)
        self._lock.release()
        return open_result(self.path)

    def _summary(self) -> dict[str, int]:
        labels = Counter(item["label"] for item in json.loads(self.layout.objects.read_bytes())["objects"])
        return {label.name.lower(): labels[label.name.lower()] for label in ChangeLabel}


def _encoded(image: NDArray[Any], extension: str, quality: int) -> bytes:
    import cv2

    flag = cv2.IMWRITE_JPEG_QUALITY if extension == ".jpg" else cv2.IMWRITE_PNG_COMPRESSION
    done, content = cv2.imencode(extension, np.ascontiguousarray(image), [flag, quality])
    if not done:
        raise StorageError(f"an image of shape {image.shape} cannot be written as {extension}")
    return content.tobytes()
