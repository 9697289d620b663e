"""``coco``: the objects' masks in every keyframe with their final labels, to train and score models on."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oasisview.export.exporter import ReviewedResult, Steps
from oasisview.export.run_lengths import packed, run_lengths
from oasisview.wording import LABEL_NAMES
from pipeline.progress import Report, silent
from pipeline.result import ChangeLabel, SessionResult
from pipeline.store.files import atomic_file

# Category 0 means background to many trainers, so that unknown is not 0 here but the last.
CATEGORY_OF: dict[ChangeLabel, int] = {
    label: int(label) if label is not ChangeLabel.UNKNOWN else 5 for label in ChangeLabel
}
MASK_STRIDE = 2  # of SessionResult.object_mask


class CocoExporter:
    """COCO instances: one category per label, the object and who decided in each annotation's attributes.

    ``file_name`` is relative to the result folder, so that it serves as the folder of images. Masks have
    the size of the images; they were made at every second pixel.
    """

    name = "coco"
    suffix = ".json"
    summary = "COCO instance JSON: masks of the final labels in every keyframe (RLE)"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the file, keyframe by keyframe; see ``Exporter.write``."""
        keyframes = list(_keyframes(reviewed))
        steps = Steps(report, len(keyframes))
        with atomic_file(out_path) as file:
            file.write(b'{"info": ' + _encoded(_info(reviewed)))
            file.write(b',\n"licenses": [],\n"categories": ' + _encoded(_categories()))
            file.write(b',\n"images": [')
            for image_id, session, k in keyframes:
                file.write(b"\n" if image_id == 1 else b",\n")
                file.write(_encoded(_image(reviewed, image_id, session, k)))
            file.write(b'],\n"annotations": [')
            written = 0
            for image_id, session, k in keyframes:
                for annotation in _annotations(reviewed, image_id, session, k):
                    written += 1
                    file.write(b"\n" if written == 1 else b",\n")
                    file.write(_encoded({"id": written, **annotation}))
                steps.step()
            file.write(b"]}\n")


def _keyframes(reviewed: ReviewedResult) -> Iterator[tuple[int, SessionResult, int]]:
    image_id = 0
    for session in reviewed.result.sessions:
        for k in range(len(session.keyframes)):
            image_id += 1
            yield image_id, session, k


def _info(reviewed: ReviewedResult) -> dict[str, Any]:
    return {
        "description": f"Changes between the visits of {reviewed.result.path.stem}",
        "version": "1.0",
        "contributor": "oasisview",
        "sessions": [
            {"session": s.index, "name": s.name, "captured_at": s.captured_at}
            for s in reviewed.result.sessions
        ],
    }


def _categories() -> list[dict[str, Any]]:
    return [
        {"id": number, "name": LABEL_NAMES[label], "supercategory": "change"}
        for label, number in sorted(CATEGORY_OF.items(), key=lambda entry: entry[1])
    ]


def _image(reviewed: ReviewedResult, image_id: int, session: SessionResult, k: int) -> dict[str, Any]:
    record = session.keyframes[k]
    return {
        "id": image_id,
        "file_name": session.image_path(k).relative_to(reviewed.result.path).as_posix(),
        "width": record.camera.width,
        "height": record.camera.height,
        "session": session.index,
        "frame_index": record.frame_index,
    }


def _annotations(
    reviewed: ReviewedResult, image_id: int, session: SessionResult, k: int
) -> Iterator[dict[str, Any]]:
    camera = session.keyframes[k].camera
    ids = full_size(reviewed.object_mask(session, k), camera.height, camera.width)
    machine = {item.object_id: item for item in reviewed.objects}
    for object_id in np.unique(ids[ids > 0]).tolist():
        final, item = reviewed.final.get(object_id), machine.get(object_id)
        if final is None or item is None:
            continue
        mask = ids == object_id
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        left, top = int(columns[0]), int(rows[0])
        yield {
            "image_id": image_id,
            "category_id": CATEGORY_OF[final.label],
            "segmentation": {"size": [camera.height, camera.width], "counts": packed(run_lengths(mask))},
            "area": int(mask.sum()),
            "bbox": [left, top, int(columns[-1]) + 1 - left, int(rows[-1]) + 1 - top],
            "iscrowd": 0,
            "attributes": {
                "object_id": object_id,
                "label": LABEL_NAMES[final.label],
                "label_machine": LABEL_NAMES[item.label],
                "session": session.index,
                "confidence": round(item.confidence, 6),
                "decided_by": final.decided_by,
            },
        }


def full_size(mask: NDArray[np.uint16], height: int, width: int) -> NDArray[np.uint16]:
    """A mask of every second pixel at the size of its image, each value for its block of pixels."""
    rows = np.minimum(np.arange(height) // MASK_STRIDE, mask.shape[0] - 1)
    columns = np.minimum(np.arange(width) // MASK_STRIDE, mask.shape[1] - 1)
    return mask[rows[:, None], columns[None, :]]


def _encoded(value: Any) -> bytes:
    return json.dumps(value, ensure_ascii=False, allow_nan=False).encode()
