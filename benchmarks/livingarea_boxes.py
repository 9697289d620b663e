"""Put-down objects of the recorded living area: how many boxes drawn by people hold an appeared object?

    python benchmarks/livingarea_boxes.py ../shared/real/livingarea --visits 2

A box counts as found when an appeared object has most of its pixels of that keyframe inside the (loose) box
and covers a part of it. Also printed: share of labelled map points that are static, nearly all if right.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import pipeline
from pipeline.result import ChangeLabel, Result
from pipeline.settings import Settings

MIN_INSIDE = 0.5  # of the object's pixels in the keyframe
MIN_COVERED = 0.1  # of the box


def main() -> None:
    """Print one line per visit."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("livingarea", type=Path)
    parser.add_argument("--visits", type=int, nargs="+", default=[2, 3, 4, 5, 6])
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.NAME=VALUE")
    arguments = parser.parse_args()
    settings = Settings()
    for override in arguments.set:
        settings = settings.override(*override.split("=", 1))
    items = json.loads((arguments.livingarea / "boxes.json").read_text())["items"]
    totals = np.zeros(2, int)
    for visit in arguments.visits:
        with tempfile.TemporaryDirectory() as folder:
            result = pipeline.run(
                arguments.livingarea / "visit1",
                arguments.livingarea / f"visit{visit}",
                settings=settings,
                output=Path(folder) / "changes.oasis",
            )
            boxes = [item for item in items if item["visit"] == visit]
            found, objects = count_found(result, boxes)
            total = sum(len(item["boxes"]) for item in boxes)
            totals += (found, total)
            print(
                f"visit {visit}: {found} of {total} boxes hold an appeared object; {len(objects[0])} of "
                f"{objects[1]} appeared objects lie in a box; static {static_share(result):.1%}; "
                f"{dict(result.manifest['summary'])}"
            )
    print(f"all: {totals[0]} of {totals[1]} boxes ({totals[0] / totals[1]:.0%})")


def count_found(result: Result, items: list[dict]) -> tuple[int, tuple[set[int], int]]:
    """Boxes that hold an appeared object; those objects, and how many appeared in all."""
    appeared = [o.object_id for o in result.objects if o.label is ChangeLabel.APPEARED]
    session = result.sessions[1]
    position = {keyframe.frame_index: k for k, keyframe in enumerate(session.keyframes)}
    found, in_some_box = 0, set()
    for item in items:
        mask = session.object_mask(position[item["keyframe"]])
        image = session.keyframes[position[item["keyframe"]]].camera
        scale = mask.shape[1] / image.width
        for box in item["boxes"]:
            inside = objects_in_box(mask, np.array(box) * scale, appeared)
            found += bool(inside)
            in_some_box |= inside
    return found, (in_some_box, len(appeared))


def objects_in_box(mask: NDArray[np.uint16], box: NDArray[np.float64], appeared: list[int]) -> set[int]:
    """Appeared objects that a box holds."""
    x0, y0, x1, y1 = np.clip(np.round(box), 0, [mask.shape[1], mask.shape[0]] * 2).astype(int)
    part = mask[y0:y1, x0:x1]
    return {
        number
        for number in appeared
        if (inside := int((part == number).sum())) >= MIN_INSIDE * max(1, int((mask == number).sum()))
        and inside >= MIN_COVERED * max(1, part.size)
    }


def static_share(result: Result) -> float:
    """Share of the labelled map points (background included, unknown left out) that are static."""
    labels = {o.object_id: int(o.label) for o in result.objects} | {0: int(ChangeLabel.STATIC)}
    counts = np.zeros(5, int)
    for session in result.sessions:
        numbers, points = np.unique(np.asarray(session.object_ids), return_counts=True)
        for number, count in zip(numbers.tolist(), points.tolist(), strict=True):
            counts[labels[number]] += count
    return counts[ChangeLabel.STATIC] / counts[1:].sum()


if __name__ == "__main__":
    main()
