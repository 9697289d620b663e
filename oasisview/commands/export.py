"""``oasisview export``."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.errors import InputError

NAME = "export"
HELP = "write the annotated change map, inspectors' overrides applied"
DESCRIPTION = """Write the change map of a result. Labels are the final ones: what inspectors decided where
they did, else the machine's, which is kept beside them."""

# Names and meanings as in oasisview.export.FORMATS, which a test holds them to: importing that here would
# make every command slower.
FORMATS = {
    "report": "one HTML page to read or print: plan, pictures and evidence of every change",
    "csv": "one row per object with labels, evidence and decisions, for spreadsheets",
    "json": "one row per object with labels, evidence and decisions",
    "geojson": "footprint polygon of every object with label, displacement and confidence, for maps",
    "ply": "points of all visits with label, object and confidence",
    "laz": "points of all visits as compressed LAS 1.4 with session, label, object_id, confidence",
    "glb": "3D scene (glTF 2.0): one named mesh per object and visit, coloured by label",
    "heatmaps": "folder of semantic and geometric heatmaps of every keyframe (TIFF and PNG)",
    "coco": "COCO instance JSON: masks of the final labels in every keyframe (RLE)",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "formats:\n" + "\n".join(f"  {name:<10}{about}" for name, about in FORMATS.items())
    parser.add_argument("result", type=Path, metavar="RESULT", help="result folder")
    parser.add_argument("--format", required=True, metavar="FORMAT", help="one of the formats below")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="PATH", help="file (heatmaps: folder)"
    )


def run_command(arguments: argparse.Namespace) -> int:
    """Export and name what was written."""
    chosen = arguments.format
    if chosen not in FORMATS:
        raise InputError(f"there is no export format {chosen!r}", f"choose one of {', '.join(FORMATS)}")
    from oasisview.console import ConsoleProgress
    from oasisview.export import export
    from pipeline.store import read_manifest

    read_manifest(arguments.result)
    with ConsoleProgress() as report:
        export(arguments.result, chosen, arguments.output, report)
    print(arguments.output)
    return 0
