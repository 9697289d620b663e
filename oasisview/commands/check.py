"""``oasisview check``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from oasisview.commands.options import add_json_option
from pipeline.errors import InputError

NAME = "check"
HELP = "what is inside an archive, and what is wrong with it"
DESCRIPTION = "Open an archive and say what it holds and what is wrong with it. Nothing is changed."


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("archive", type=Path, metavar="ARCHIVE", help="folder, .zip, .tar or .tar.gz")
    add_json_option(parser)


def run_command(arguments: argparse.Namespace) -> int:
    """Print what was found."""
    if not arguments.archive.exists():
        raise InputError(f"there is no archive {arguments.archive}", "check the path")
    from pipeline.readers.check import check_archive

    found = check_archive(arguments.archive)
    if arguments.json:
        print(json.dumps(found.to_dict(), indent=2))
    if not found.usable:
        raise InputError("; ".join(found.problems))
    if not arguments.json:
        print("\n".join(found.lines()))
    return 0
