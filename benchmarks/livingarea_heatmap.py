"""Semantic heatmaps of the recorded living area against the boxes that people drew: AUC per visit.

    python benchmarks/livingarea_heatmap.py ../shared/real/livingarea

Visits 2 to 6 are compared with visit 1. A patch of a keyframe of the later visit is changed when its centre
lies in a box of ``boxes.json``; patches that visit 1 does not see are left out. Boxes are in pixels of the
recorded image and heatmaps in those of the undistorted one (a few pixels apart in the corners; the boxes are
loose anyway). The second figure is the AUC among patches of like texture, the third what texture alone,
without a comparison, would score (see ``pipeline.evaluation.heatmap_auc``).
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import pipeline
from pipeline.evaluation.counts import mean_defined
from pipeline.evaluation.heatmap_auc import auc, like_texture_auc, patch_texture, patches_in_boxes
from pipeline.result import Result
from pipeline.settings import Settings


@dataclass(frozen=True)
class Patches:
    """Co-visible patches of some keyframes: change score, whether changed, texture; (N,) each."""

    score: NDArray[np.floating]
    changed: NDArray[np.bool_]
    texture: NDArray[np.floating]

    def row(self, name: str) -> dict[str, float | int | str | None]:
        """What is reported of them."""
        return {
            "visit": name,
            "patches": len(self.score),
            "changed": int(self.changed.sum()),
            "auc": auc(self.score, self.changed),
            "like_texture_auc": like_texture_auc(self.score, self.changed, self.texture),
            "texture_alone_auc": auc(self.texture, self.changed),
        }


def main() -> None:
    """Print one row per visit, their mean and the pooled figures."""
    arguments = _arguments()
    settings = Settings()
    for override in arguments.set:
        settings = settings.override(*override.split("=", 1))
    items = json.loads((arguments.livingarea / "boxes.json").read_text())["items"]
    visits: list[Patches] = []
    rows: list[dict] = []
    with tempfile.TemporaryDirectory() as temporary:
        for visit in arguments.visits:
            print(f"visit {visit} ...", file=sys.stderr, flush=True)
            result = pipeline.run(
                arguments.livingarea / "visit1",
                arguments.livingarea / f"visit{visit}",
                settings=settings,
                output=(arguments.keep or Path(temporary)) / f"visit{visit}.oasis",
            )
            visits.append(patches_of(result, [item for item in items if item["visit"] == visit]))
            rows.append(visits[-1].row(str(visit)))
    keys = ("auc", "like_texture_auc", "texture_alone_auc")
    rows.append({"visit": "mean", **{key: mean_defined(row[key] for row in rows) for key in keys}})
    rows.append(concatenated(visits).row("pooled"))
    print(json.dumps(rows, indent=1) if arguments.json else table(rows))


def patches_of(result: Result, items: list[dict]) -> Patches:
    """Patches of the current visit's keyframes that were looked at by whoever drew the boxes."""
    session = result.sessions[1]
    position = {keyframe.frame_index: k for k, keyframe in enumerate(session.keyframes)}
    parts = []
    for item in items:
        k = position[item["keyframe"]]
        heat = session.semantic_heatmap(k)
        rgb = cv2.cvtColor(cv2.imread(str(session.image_path(k))), cv2.COLOR_BGR2RGB)
        camera = session.keyframes[k].camera
        changed = patches_in_boxes(item["boxes"], heat.shape, (camera.width, camera.height))
        seen = np.isfinite(heat)
        parts.append(Patches(heat[seen], changed[seen], patch_texture(rgb, heat.shape)[seen]))
    return concatenated(parts)


def concatenated(parts: list[Patches]) -> Patches:
    """Several keyframes or visits as one."""
    return Patches(*(np.concatenate([getattr(p, n) for p in parts]) for n in ("score", "changed", "texture")))


def table(rows: list[dict]) -> str:
    """Markdown."""
    lines = [
        "| visit | patches | changed | AUC | like texture | texture alone |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        numbers = (row[key] for key in ("auc", "like_texture_auc", "texture_alone_auc"))
        cells = ["-" if value is None else f"{value:.3f}" for value in numbers]
        counts = [str(row.get(key, "")) for key in ("patches", "changed")]
        lines.append("| " + " | ".join([row["visit"], *counts, *cells]) + " |")
    return "\n".join(lines)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("livingarea", type=Path)
    parser.add_argument("--visits", type=int, nargs="+", default=[2, 3, 4, 5, 6])
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.NAME=VALUE")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the results here")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    return parser.parse_args()


if __name__ == "__main__":
    main()
