"""``oasisview generate``."""

from __future__ import annotations

import argparse
from pathlib import Path

from oasisview.commands.options import HELD_OUT_SCENES, SCENE_FRAMES, SCENES
from oasisview.console import ConsoleProgress

NAME = "generate"
HELP = "a synthetic pair of recordings with exact ground truth"
DESCRIPTION = """Write OUT/s0 and OUT/s1, two recordings of a procedural place that changed in between,
OUT/gt.ply, what really changed, and OUT/gt.json, how things moved. The same scene, seed and frames give the
same files."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    kinds = (*SCENES, *HELD_OUT_SCENES)
    parser.add_argument("scene", metavar="SCENE", choices=kinds, help=" or ".join(kinds))
    parser.add_argument("out", metavar="OUT", type=Path, help="folder to write, new or empty")
    parser.add_argument("--seed", type=int, required=True, metavar="N", help="which of the scenes")
    parser.add_argument(
        "--frames",
        type=int,
        default=SCENE_FRAMES,
        metavar="N",
        help=f"of each visit (default: {SCENE_FRAMES})",
    )


def run_command(arguments: argparse.Namespace) -> int:
    """Generate and name what was written."""
    from pipeline.synthetic import generate

    with ConsoleProgress() as report:
        generate(arguments.scene, arguments.out, arguments.seed, arguments.frames, report)
    for name in ("s0", "s1", "gt.ply", "gt.json"):
        print(arguments.out / name)
    return 0
