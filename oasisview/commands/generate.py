"""``oasisview generate``."""

from __future__ import annotations

import argparse
from pathlib import Path

from oasisview.commands.options import SCENES, positive
from pipeline.errors import InputError, StorageError

NAME = "generate"
HELP = "a synthetic pair of recordings with exact ground truth"
DESCRIPTION = """Write OUT/s0 and OUT/s1, two recordings of a procedural place that changed in between, and
OUT/gt.ply, what really changed. The same scene, seed and frames give the same files."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("scene", metavar="SCENE", choices=SCENES, help=" or ".join(SCENES))
    parser.add_argument("out", metavar="OUT", type=Path, help="folder to write, new or empty")
    parser.add_argument("--seed", type=int, required=True, metavar="N", help="which of the scenes")
    parser.add_argument("--frames", type=positive, metavar="N", help="frames of each visit")


def run_command(arguments: argparse.Namespace) -> int:
    """Generate and name what was written."""
    out: Path = arguments.out
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} exists and is not an empty folder", "choose another folder")
    from pipeline.synthetic import generate

    try:
        frames = {} if arguments.frames is None else {"frames": arguments.frames}
        generate(arguments.scene, out, seed=arguments.seed, **frames)
    except OSError as error:
        raise StorageError(
            f"cannot write {out}: {error.strerror}", "free some space or choose another folder"
        ) from error
    for name in ("s0", "s1", "gt.ply"):
        print(out / name)
    return 0
