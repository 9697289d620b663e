"""``oasisview models``."""

from __future__ import annotations

import argparse
import dataclasses
import json

from oasisview.commands.backends import BACKENDS
from oasisview.commands.options import add_json_option

NAME = "models"
HELP = "perception backends, and whether their weights are there"
DESCRIPTION = "List the perception backends and whether they can be used."


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    add_json_option(parser)


def run_command(arguments: argparse.Namespace) -> int:
    """Print the table."""
    if arguments.json:
        print(json.dumps([dataclasses.asdict(backend) for backend in BACKENDS], indent=2))
        return 0
    rows = [("kind", "backend", "weights", "what it is")]
    rows += [(backend.kind, backend.name, backend.weights, backend.about) for backend in BACKENDS]
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    return 0
