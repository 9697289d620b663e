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
    "ply": "points of all visits with label, object and confidence",
    "csv": "one row per object with labels, evidence and decisions, for spreadsheets",
    "json": "one row per object with labels, evidence and decisions",
    "heatmaps": "folder of semantic and geometric heatmaps of every keyframe (TIFF and PNG)",
    "report": "one HTML page to read or print: plan, pictures and evidence of every change",
}
LATER_FORMATS = ("laz", "glb", "geojson", "coco")


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
        what = "is not in this version" if chosen in LATER_FORMATS else "does not exist"
        raise InputError(f"export format {chosen} {what}", f"choose {', '.join(FORMATS)}")
    from oasisview.console import ConsoleProgress
    from oasisview.export import export
    from pipeline.store import read_manifest

    read_manifest(arguments.result)
    with ConsoleProgress() as report:
        export(arguments.result, chosen, arguments.output, report)
    print(arguments.output)
    return 0
