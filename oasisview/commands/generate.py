"""``oasisview generate``."""

from __future__ import annotations

import argparse
from pathlib import Path

from oasisview.commands.options import SCENE_FRAMES, SCENES
from oasisview.console import ConsoleProgress

NAME = "generate"
HELP = "a synthetic pair of recordings with exact ground truth"
DESCRIPTION = """Write OUT/s0 and OUT/s1, two recordings of a procedural place that changed in between, and
OUT/gt.ply, what really changed. The same scene, seed and frames give the same files."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("scene", metavar="SCENE", choices=SCENES, help=" or ".join(SCENES))
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
    for name in ("s0", "s1", "gt.ply"):
        print(arguments.out / name)
    return 0
