"""``oasisview export``."""

from __future__ import annotations

import argparse
from pathlib import Path

from pipeline.errors import InputError

NAME = "export"
HELP = "write the annotated change map, inspectors' overrides applied"
DESCRIPTION = """Write the change map of a result. Labels are the final ones: what inspectors decided where
they did, else the machine's, which is kept beside them."""

FORMATS = ("ply", "csv", "json", "heatmaps")
LATER_FORMATS = ("laz", "glb", "geojson", "coco", "report")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("result", type=Path, metavar="RESULT", help="result folder")
    parser.add_argument("--format", required=True, metavar="FORMAT", help=", ".join(FORMATS))
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="PATH", help="file (heatmaps: folder)"
    )


def run_command(arguments: argparse.Namespace) -> int:
    """Export and name what was written."""
    chosen = arguments.format
    if chosen not in FORMATS:
        what = "is not in this version" if chosen in LATER_FORMATS else "does not exist"
        raise InputError(f"export format {chosen} {what}", f"choose {', '.join(FORMATS)}")
    from oasisview.export import export
    from pipeline.store import read_manifest

    read_manifest(arguments.result)
    export(arguments.result, chosen, arguments.output)
    print(arguments.output)
    return 0
