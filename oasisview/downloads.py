"""Exports for the browser: made in a temporary folder, folders packed into one ZIP."""

from __future__ import annotations

import io
import tempfile
import zipfile
from pathlib import Path

from oasisview.export import export
from oasisview.panels.export import Download
from pipeline.progress import Report, silent


def make_download(result_path: Path, download: Download, report: Report = silent) -> tuple[str, bytes]:
    """Run an export and return the file's name, after the result, and its content.

    Seconds for large maps: keep it off the event loop. Raises what ``export`` raises.
    """
    name = f"{result_path.stem}{download.suffix}"
    with tempfile.TemporaryDirectory(prefix="oasisview-export-") as folder:
        path = Path(folder) / (result_path.stem if download.suffix.endswith(".zip") else name)
        export(result_path, download.format, path, report)
        return name, _zipped(path) if path.is_dir() else path.read_bytes()


def _zipped(folder: Path) -> bytes:
    packed = io.BytesIO()
    # Images and float TIFFs hardly get smaller: storing them is many times faster.
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, Path(folder.name) / file.relative_to(folder))
    return packed.getvalue()
