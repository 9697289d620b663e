"""``oasisview run``."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from oasisview.commands.options import add_engine_options, add_json_option, require_two, settings_from
from pipeline.errors import InputError, OasisError, ResultError
from pipeline.progress import Report
from pipeline.settings import Settings

if TYPE_CHECKING:
    from pipeline.result import Result

NAME = "run"
HELP = "process two visits into a result folder"
DESCRIPTION = """Compute the change map of two visits. A result that fits the recordings and settings is taken
as it is; a run that was interrupted goes on from where it was."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("sessions", nargs="*", metavar="PREVIOUS CURRENT", help="archives of the two visits")
    parser.add_argument("-o", "--output", type=Path, metavar="RESULT", help="result folder, NAME.oasis")
    parser.add_argument(
        "--overwrite", action="store_true", help="replace a result of other recordings or settings"
    )
    parser.add_argument(
        "--settings", action="store_true", help="list all settings with their values, and stop"
    )
    add_json_option(parser)
    add_engine_options(parser)
    parser.add_argument("--progress-json", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--until-stdin-closes", action="store_true", help=argparse.SUPPRESS)


def run_command(arguments: argparse.Namespace) -> int:
    """Process, and tell what came out."""
    if arguments.until_stdin_closes:
        _end_when_stdin_closes()
    if arguments.progress_json:
        return _run_for_a_program(arguments)
    settings = settings_from(arguments)
    if arguments.settings:
        _print_settings(settings, as_json=arguments.json)
        return 0
    from oasisview.console import ConsoleProgress

    with ConsoleProgress() as report:
        result, from_cache = _process(arguments, settings, report)
    if arguments.json:
        print(json.dumps(_record(result, from_cache), indent=2, sort_keys=True))
    else:
        counts = ", ".join(f"{count} {label}" for label, count in result.manifest["summary"].items())
        print(f"{result.path}{' (taken from cache)' if from_cache else ''}: {counts}")
    return 0


def _process(arguments: argparse.Namespace, settings: Settings, report: Report) -> tuple[Result, bool]:
    """The result and whether it was there already."""
    previous, current = require_two(arguments.sessions)
    if arguments.output is None:
        raise InputError("no result folder was named", "add -o NAME.oasis")
    output: Path = arguments.output
    if not arguments.overwrite:
        _refuse_foreign_result(output, (previous, current), settings)
    from pipeline.system import run

    before = _manifest_inode(output)
    result = run(previous, current, settings=settings, output=output, report=report)
    return result, before is not None and before == _manifest_inode(output)


def _run_for_a_program(arguments: argparse.Namespace) -> int:
    from oasisview.progress_lines import Failed, Finished, ProgressLines

    say = ProgressLines()
    try:
        result, from_cache = _process(arguments, settings_from(arguments), say)
    except OasisError as error:
        say(Failed(" ".join(str(error).split())))
        return 2
    say(Finished(result.path, from_cache))
    return 0


def _refuse_foreign_result(output: Path, archives: tuple[Path, Path], settings: Settings) -> None:
    from pipeline.store import read_manifest

    try:
        manifest = read_manifest(output)
    except ResultError:
        return  # nothing there, or nothing that this version could show: the engine decides
    stored = [str(item.get("archive", "")) for item in manifest.get("inputs", [])]
    same_archives = len(stored) == len(archives) and all(map(_is_same_archive, stored, archives))
    if same_archives and manifest.get("settings") == settings.to_dict():
        return
    other = "settings" if same_archives else "recordings"
    raise InputError(
        f"{output} holds the result of other {other}",
        "add --overwrite to replace it (decisions of inspectors are kept), or name another folder",
    )


def _is_same_archive(stored: str, archive: Path) -> bool:
    """Whether a stored path, relative to whatever folder the run started in, can mean this archive."""
    parts = [part for part in Path(stored).parts if part not in ("..", "/")]
    return bool(parts) and list(archive.resolve().parts[-len(parts) :]) == parts


def _manifest_inode(result: Path) -> int | None:
    try:
        return (result / "result.json").stat().st_ino
    except OSError:
        return None


def _record(result: Result, from_cache: bool) -> dict[str, Any]:
    kept = ("summary", "warnings", "timings_s", "key", "schema_version")
    return {
        "result": str(result.path),
        "from_cache": from_cache,
        **{name: result.manifest[name] for name in kept},
    }


def _print_settings(settings: Settings, *, as_json: bool) -> None:
    if as_json:
        print(json.dumps(settings.to_dict(), indent=2))
        return
    for section in dataclasses.fields(settings):
        values = getattr(settings, section.name)
        print(f"{section.name}: {(type(values).__doc__ or '').splitlines()[0]}")
        for entry in dataclasses.fields(values):
            unit, symbol = entry.metadata.get("unit", ""), entry.metadata.get("symbol", "")
            value = f"{getattr(values, entry.name)}{' ' + unit if unit else ''}"
            about = entry.metadata.get("help", "") + (f" [{symbol}]" if symbol else "")
            print(f"  {section.name + '.' + entry.name:<40} {value:<16} {about}")


def _end_when_stdin_closes() -> None:
    """End this process as soon as its parent is gone, however the parent ended."""

    def watch() -> None:
        while os.read(sys.stdin.fileno(), 1024):
            pass
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()
