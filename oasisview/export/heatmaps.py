"""``heatmaps``: both heatmaps of every keyframe as float32 TIFF and as coloured PNG."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import tifffile
from numpy.typing import NDArray

from oasisview.export.exporter import ReviewedResult, Steps
from oasisview.export.folder import atomic_folder
from oasisview.heatmap_colours import colour_geometric, colour_semantic
from pipeline.progress import Report, silent
from pipeline.result import SessionResult

_FILE_NAMES = r"\d+/\d{5,}\.(semantic|geometric)\.(tif|png)"
_DESCRIPTIONS = {
    "semantic": "semantic change in [0, 1], 1 = changed, NaN = not co-visible",
    "geometric": "depth difference in metres, + = nearer in the current visit, NaN = not co-visible",
}


class HeatmapExporter:
    """``SESSION/KEYFRAME.semantic.tif``, ``.geometric.tif`` and a ``.png`` of each.

    SESSION is 0 for the previous visit, 1 for the current one, ...; KEYFRAME the archive's frame number,
    five digits. All are as large as the keyframe's image.
    """

    name = "heatmaps"
    suffix = ""
    summary = "folder of semantic and geometric heatmaps of every keyframe (TIFF and PNG)"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the folder; an earlier export there is replaced. See ``Exporter.write``."""
        steps = Steps(report, sum(len(session.keyframes) for session in reviewed.result.sessions))
        with atomic_folder(out_path, earlier_files=_FILE_NAMES) as folder:
            for session in reviewed.result.sessions:
                (folder / str(session.index)).mkdir()
                for k in range(len(session.keyframes)):
                    _write_keyframe(session, k, folder / str(session.index))
                    steps.step()


def _write_keyframe(session: SessionResult, k: int, folder: Path) -> None:
    record = session.keyframes[k]
    height, width = record.camera.height, record.camera.width
    semantic = enlarged_bilinear(session.semantic_heatmap(k), height, width)
    geometric = enlarged_nearest(session.geometric_heatmap(k), height, width)
    images = {
        "semantic": (semantic, colour_semantic(semantic, height, width)),
        "geometric": (geometric, colour_geometric(geometric, height, width, dark=False)),
    }
    for name, (values, coloured) in images.items():
        stem = f"{record.frame_index:05d}.{name}"
        tifffile.imwrite(
            folder / f"{stem}.tif",
            values,
            photometric="minisblack",
            compression="zlib",
            compressionargs={"level": 1},
            description=_DESCRIPTIONS[name],
            metadata=None,
        )
        _, content = cv2.imencode(".png", np.ascontiguousarray(coloured[:, :, ::-1]))
        (folder / f"{stem}.png").write_bytes(content.tobytes())


def enlarged_nearest(heatmap: NDArray[np.floating], height: int, width: int) -> NDArray[np.float32]:
    """A heatmap at image size, each pixel with the value of the cell it lies in; (height, width)."""
    rows = np.arange(height) * heatmap.shape[0] // height
    columns = np.arange(width) * heatmap.shape[1] // width
    return heatmap[rows[:, None], columns[None, :]].astype(np.float32)


def enlarged_bilinear(heatmap: NDArray[np.floating], height: int, width: int) -> NDArray[np.float32]:
    """A patch grid at image size, interpolated between patch centres; (height, width).

    A pixel is NaN when the patch it lies in is; NaN neighbours have no weight in the others, so that
    what was not seen never pulls a value towards 0.
    """
    known = np.isfinite(heatmap)
    weights = _bilinear(known.astype(np.float64), height, width)
    sums = _bilinear(np.where(known, heatmap, 0.0).astype(np.float64), height, width)
    inside = np.isfinite(enlarged_nearest(heatmap, height, width)) & (weights > 0)
    enlarged = np.divide(sums, weights, out=np.full((height, width), np.nan), where=inside)
    return enlarged.astype(np.float32)


def _bilinear(grid: NDArray[np.float64], height: int, width: int) -> NDArray[np.float64]:
    (top, bottom, down), (left, right, across) = (
        _between(length, size) for length, size in zip((height, width), grid.shape, strict=True)
    )
    rows = grid[top] * (1 - down)[:, None] + grid[bottom] * down[:, None]
    return rows[:, left] * (1 - across) + rows[:, right] * across


def _between(length: int, size: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Cells before and after each pixel centre, and how far it is from the first to the second."""
    at = np.clip((np.arange(length) + 0.5) * size / length - 0.5, 0, size - 1)
    low = np.floor(at).astype(np.int64)
    return low, np.minimum(low + 1, size - 1), at - low
