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
    Download("csv", ".csv", "Table (CSV)", "one row per object: label, evidence, who decided"),
    Download("json", ".json", "Table (JSON)", "the same for programs"),
    Download("ply", ".ply", "Annotated map (PLY)", "points of both visits in label colours"),
    Download("heatmaps", "_heatmaps.zip", "Heatmaps (ZIP)", "float TIFF and PNG of every keyframe"),
)  # fmt: skip


def export_html(reviewed: int, total: int, status: str) -> str:
    """The panel; ``status`` tells what is being prepared or was sent."""
    rows = "".join(
        f'<div class="oa-download"><button {sends("export", d.format)} data-format="{d.format}">'
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
    shown = f'<div class="oa-status" role="status">{escape(status)}</div>' if status else ""
    return (
        f'<div class="oa oa-export"><p>{note} The machine\'s label is kept beside the final one.</p>'
        f"{rows}{shown}</div>"
    )
