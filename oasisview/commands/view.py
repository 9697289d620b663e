"""``oasisview view``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from oasisview.cache import cached_result_path
from oasisview.commands.options import add_engine_options, add_serve_options, require_two, settings_from
from oasisview.job import Job
from pipeline.errors import InputError

NAME = "view"
HELP = "process two visits unless a cached result fits, then serve the viewer; or view a RESULT"
DESCRIPTION = """Open the viewer on a result folder, or on two recordings: these are processed first, with
progress on the page, unless that was done before. Results of recordings are kept in $OASISVIEW_CACHE or
~/.cache/oasisview."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument(
        "sources", nargs="+", metavar="PREVIOUS CURRENT | RESULT", help="two archives, or one result folder"
    )
    add_serve_options(parser)
    add_engine_options(parser)


def run_command(arguments: argparse.Namespace) -> int:
    """Serve until interrupted."""
    settings = settings_from(arguments)
    if len(arguments.sources) == 1:
        return serve(_finished_result(Path(arguments.sources[0])), arguments)
    previous, current = require_two(arguments.sources)
    from pipeline.readers import open_session

    for archive in (previous, current):
        open_session(archive)  # an unusable archive is told here, in the terminal, not on a page
    result = cached_result_path(previous, current, settings)
    return serve(Job(previous, current, result, settings, overwrite=True), arguments)


def _finished_result(path: Path) -> Path:
    from pipeline.store import open_result

    if path.exists() and not (path / "result.json").exists():
        raise InputError(
            f"{path} is not a result", "to compare two visits name both: oasisview view PREVIOUS CURRENT"
        )
    open_result(path)
    return path


def serve(source: Path | Job, arguments: argparse.Namespace) -> int:
    """Serve the viewer with the options of ``add_serve_options``; returns when it is stopped."""
    from oasisview.app import serve as serve_viewer

    try:
        serve_viewer(source, host=arguments.host, port=arguments.port, open_browser=not arguments.no_open)
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)  # Ctrl-C is how a viewer is meant to end
    return 0
