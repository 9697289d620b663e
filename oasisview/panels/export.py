"""The export tab: what can be downloaded, with inspectors' overrides applied."""

from __future__ import annotations

from dataclasses import dataclass

from oasisview.panels.markup import sends
from oasisview.shell import escape


@dataclass(frozen=True)
class Download:
    """One kind of download: the export's format, what the file is called, and what it is good for."""

    format: str
    suffix: str
    title: str
    meaning: str


DOWNLOADS = (
    Download("report", "_report.html", "Report (HTML)", "one page to read, print or send, with pictures"),
    Download("csv", ".csv", "Table (CSV)", "one row per object: label, evidence, who decided"),
    Download("json", ".json", "Table (JSON)", "the same for programs"),
    Download("geojson", ".geojson", "Footprints (GeoJSON)", "outline of each object on the ground, for maps"),
    Download("ply", ".ply", "Annotated map (PLY)", "points of both visits in label colours"),
    Download("laz", ".laz", "Annotated map (LAZ)", "the same as compressed LAS 1.4"),
    Download("glb", ".glb", "3D scene (GLB)", "one mesh per object and visit, for Blender and viewers"),
    Download("heatmaps", "_heatmaps.zip", "Heatmaps (ZIP)", "float TIFF and PNG of every keyframe"),
    Download("coco", "_coco.json", "Masks (COCO)", "final labels in every keyframe, to train models"),
)  # fmt: skip


def export_html(reviewed: int, total: int, status: str, share: float | None = None) -> str:
    """The panel; ``status`` tells what was sent, or with a ``share`` of 1 what is being prepared."""
    busy = "disabled" if share is not None else ""
    rows = "".join(
        f'<div class="oa-download"><button {sends("export", d.format)} data-format="{d.format}" {busy}>'
        f"{escape(d.title)}</button><small>{escape(d.meaning)}</small></div>"
        for d in DOWNLOADS
    )
    left = total - reviewed
    note = (
        f"{reviewed} of {total} changed or unknown objects are reviewed; the other {left} go out with the "
        "machine's label."
        if left
        else "Every changed or unknown object is reviewed."
    )
    return (
        f'<div class="oa oa-export"><p>{note} The machine\'s label is kept beside the final one.</p>'
        f"{_status(status, share)}{rows}</div>"
    )


def _status(status: str, share: float | None) -> str:
    if not status:
        return ""
    bar = ""
    if share is not None:
        bar = (
            f'<progress value="{share:.3f}" max="1" aria-label="How much is done"></progress>'
            f"<button {sends('export_stop')}>Stop</button>"
        )
    return f'<div class="oa-status" role="status">{escape(status)}{bar}</div>'
