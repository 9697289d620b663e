"""``oasisview demo``."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from oasisview.cache import cached_result_path, demo_folder
from oasisview.commands.options import SCENES, add_engine_options, add_serve_options, positive, settings_from
from oasisview.commands.view import serve
from oasisview.job import Job
from pipeline.errors import StorageError

NAME = "demo"
HELP = "make a pair of recordings, process it, open the viewer"
DESCRIPTION = """Make two synthetic visits of a place, process them and open the viewer. The same scene and
seed are made only once."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--scene", choices=SCENES, default="office", help="kind of place (default: office)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="which of them (default: 1)")
    parser.add_argument("--frames", type=positive, metavar="N", help="frames of each visit")
    add_serve_options(parser)
    add_engine_options(parser)


def run_command(arguments: argparse.Namespace) -> int:
    """Generate unless cached, process, serve."""
    settings = settings_from(arguments)
    folder = demo_folder(arguments.scene, arguments.seed, arguments.frames)
    if not folder.exists():
        print(f"Making two visits of the {arguments.scene} in {folder}", file=sys.stderr, flush=True)
        _generate_whole(arguments.scene, folder, arguments.seed, arguments.frames)
    previous, current = folder / "s0", folder / "s1"
    result = cached_result_path(previous, current, settings)
    return serve(Job(previous, current, result, settings, overwrite=True), arguments)


def _generate_whole(scene: str, folder: Path, seed: int, frames: int | None) -> None:
    """Generate beside ``folder`` and move it there, so that an interrupted demo leaves no half recording."""
    from pipeline.synthetic import generate

    unfinished = folder.with_name(folder.name + ".unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    try:
        unfinished.parent.mkdir(parents=True, exist_ok=True)
        generate(scene, unfinished, seed=seed, **({} if frames is None else {"frames": frames}))
        unfinished.rename(folder)
    except OSError as error:
        hint = "set OASISVIEW_CACHE to a folder with space that you may write to"
        raise StorageError(f"cannot write {folder}: {error.strerror}", hint) from error
