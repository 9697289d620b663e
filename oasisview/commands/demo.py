"""``oasisview demo``."""

from __future__ import annotations

import argparse

from oasisview.cache import cached_result_path, demo_folder
from oasisview.commands.options import (
    SCENE_FRAMES,
    SCENES,
    add_engine_options,
    add_serve_options,
    settings_from,
)
from oasisview.commands.view import serve
from oasisview.console import ConsoleProgress
from oasisview.job import Job

NAME = "demo"
HELP = "make a pair of recordings, process it, open the viewer"
DESCRIPTION = """Make two synthetic visits of a place, process them and open the viewer. The same scene and
seed are made only once."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--scene", choices=SCENES, default="office", help="kind of place (default: office)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="which of them (default: 1)")
    parser.add_argument(
        "--frames",
        type=int,
        default=SCENE_FRAMES,
        metavar="N",
        help=f"of each visit (default: {SCENE_FRAMES})",
    )
    add_serve_options(parser)
    add_engine_options(parser)


def run_command(arguments: argparse.Namespace) -> int:
    """Generate unless cached, process, serve."""
    settings = settings_from(arguments)
    folder = demo_folder(arguments.scene, arguments.seed, arguments.frames)
    if not folder.exists():
        from pipeline.synthetic import generate

        with ConsoleProgress() as report:
            generate(arguments.scene, folder, arguments.seed, arguments.frames, report)
    previous, current = folder / "s0", folder / "s1"
    result = cached_result_path(previous, current, settings)
    return serve(Job(previous, current, result, settings, overwrite=True), arguments)
