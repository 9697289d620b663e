"""``csv`` and ``json``: one row per object, the machine's label beside the final one."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any

from oasisview.export.exporter import ReviewedResult
from oasisview.export.object_rows import object_rows
from pipeline.progress import Report, silent
from pipeline.store.files import atomic_file

# A spreadsheet takes a cell that begins so for a formula, and people write names and reasons.
_FORMULA_STARTS = ("=", "+", "-", "@")
_NO_OBJECT_COLUMNS = ("id", "label_machine", "label_final")


class JsonExporter:
    """A JSON array of objects, UTF-8; None is ``null``."""

    name = "json"
    suffix = ".json"
    summary = "one row per object with labels, evidence and decisions"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the file; see ``Exporter.write``."""
        text = json.dumps(object_rows(reviewed), indent=1, ensure_ascii=False, allow_nan=False)
        with atomic_file(out_path) as file:
            file.write((text + "\n").encode())


class CsvExporter:
    """RFC 4180 with a header line, UTF-8; None is empty, lists are joined by ``;`` (notes by ``|``)."""

    name = "csv"
    suffix = ".csv"
    summary = "one row per object with labels, evidence and decisions, for spreadsheets"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the file; see ``Exporter.write``."""
        rows = object_rows(reviewed)
        text = io.StringIO(newline="")
        writer = csv.writer(text)
        writer.writerow(rows[0] if rows else _NO_OBJECT_COLUMNS)
        writer.writerows([_cell(name, value) for name, value in row.items()] for row in rows)
        with atomic_file(out_path) as file:
            file.write(text.getvalue().encode())


def _cell(name: str, value: Any) -> Any:
    if name == "notes":
        value = " | ".join(f"{note['who']}: {note['text']}" for note in value)
    elif isinstance(value, list):
        value = ";".join(map(str, value))
    if isinstance(value, str) and value.startswith(_FORMULA_STARTS):
        return "'" + value
    return value
