"""The export formats by name, and the one call that writes any of them."""

from __future__ import annotations

from pathlib import Path

from oasisview.export.coco_masks import CocoExporter
from oasisview.export.exporter import Exporter, ReviewedResult
from oasisview.export.geojson_objects import GeoJsonExporter
from oasisview.export.glb_scene import GlbExporter
from oasisview.export.heatmaps import HeatmapExporter
from oasisview.export.laz_points import LazExporter
from oasisview.export.ply_points import PlyExporter
from oasisview.export.report import ReportExporter
from oasisview.export.tables import CsvExporter, JsonExporter
from pipeline.errors import InputError
from pipeline.progress import Report, silent
from pipeline.store import open_result

FORMATS: dict[str, Exporter] = {
    exporter.name: exporter
    for exporter in (
        ReportExporter(),
        CsvExporter(),
        JsonExporter(),
        GeoJsonExporter(),
        PlyExporter(),
        LazExporter(),
        GlbExporter(),
        HeatmapExporter(),
        CocoExporter(),
    )
}


def export(result_path: str | Path, format: str, out_path: str | Path, report: Report = silent) -> None:
    """Write a result with inspectors' decisions applied.

    Args:
        result_path: the result folder.
        format: a name in ``FORMATS``.
        out_path: file or (``heatmaps``) folder; an earlier export there is replaced in one step.
        report: hears how far it is.

    Raises:
        InputError: unknown format, or ``out_path`` must not be replaced.
        ResultError: the result or its journal cannot be read.
        StorageError: writing failed; nothing half-written is left, an earlier export stays.
    """
    exporter = FORMATS.get(format)
    if exporter is None:
        raise InputError(f"there is no export format {format!r}", f"choose one of {', '.join(FORMATS)}")
    result = open_result(Path(result_path))
    out = Path(out_path)
    if exporter.suffix and out.is_dir():
        raise InputError(f"{out} is a folder", f"name a file, such as {out / ('map' + exporter.suffix)}")
    if out.resolve().is_relative_to(Path(result_path).resolve()):
        raise InputError(f"{out} is inside the result", "export to a place outside the result folder")
    exporter.write(ReviewedResult.of(result), out, report)
