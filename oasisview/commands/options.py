"""Options that several commands share, and what they mean as settings."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from oasisview.commands.backends import require_backend
from pipeline.errors import InputError
from pipeline.settings import Settings

# As in pipeline.synthetic, which is heavy to import; a test holds the two together.
SCENE_FRAMES = 40
SCENES = ("office", "carpark", "warehouse", "market")
HELD_OUT_SCENES = ("hillside", "tunnel")
# As in pipeline.methods, which is heavy to import; a test holds the two together.
METHODS = ("oasis", "geometric", "conceptgraphs", "wheres-my-glasses")


def add_serve_options(parser: argparse.ArgumentParser) -> None:
    """``--host``, ``--port``, ``--no-open``."""
    group = parser.add_argument_group("viewer")
    group.add_argument(
        "--host",
        default="127.0.0.1",
        help="address to listen on; any but this machine's own asks for a token (default: 127.0.0.1)",
    )
    group.add_argument(
        "--port", type=port_number, default=8080, help="port; taken is an error (default: 8080)"
    )
    group.add_argument("--no-open", action="store_true", help="do not open a browser window")


def add_engine_options(parser: argparse.ArgumentParser) -> None:
    """``--method``, ``--set``, ``--features``, ``--masks``."""
    group = parser.add_argument_group("engine")
    group.add_argument(
        "--method",
        choices=METHODS,
        help="what decides: this engine (oasis, default) or a baseline on the same keyframes",
    )
    group.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="SECTION.NAME=VALUE",
        help="change a setting, as often as needed; `oasisview run --settings` lists them",
    )
    group.add_argument("--features", metavar="BACKEND", help="feature extractor (default: embedded)")
    group.add_argument("--masks", metavar="BACKEND", help="mask generator (default: embedded)")


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """``--json``."""
    parser.add_argument("--json", action="store_true", help="write the result as JSON")


def settings_from(arguments: argparse.Namespace) -> Settings:
    """Settings of ``add_engine_options``; ``InputError`` for what does not exist or fit."""
    settings = Settings()
    for override in arguments.overrides:
        name, equals, value = override.partition("=")
        if not equals:
            raise InputError(f"--set {override} names no value", "write --set section.name=value")
        settings = settings.override(name.strip(), value.strip())
    if arguments.method is not None:
        settings = settings.override("run.method", arguments.method)
    for kind in ("features", "masks"):
        backend = getattr(arguments, kind)
        if backend is not None:
            settings = settings.override(f"perception.{kind}", backend)
        require_backend(kind, getattr(settings.perception, kind))
    return settings


def require_two(sessions: Sequence[str]) -> tuple[Path, Path]:
    """The previous and the current archive; ``InputError`` unless there are exactly two that exist."""
    if len(sessions) > 2:
        raise InputError(
            f"{len(sessions)} visits were named, and more than two are not supported yet",
            "compare them two at a time",
        )
    if len(sessions) < 2:
        raise InputError("two visits are needed", "name the previous and the current archive")
    previous, current = (Path(session) for session in sessions)
    for archive in (previous, current):
        if not archive.exists():
            raise InputError(f"there is no archive {archive}", "check the path")
    return previous, current


def port_number(text: str) -> int:
    """A TCP port, for argparse."""
    if not text.isdecimal() or not 0 < int(text) < 65536:
        raise argparse.ArgumentTypeError(f"{text} is not a port (1 to 65535)")
    return int(text)


def positive(text: str) -> int:
    """A whole number from 1 on, for argparse."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a whole number from 1 on")
    return int(text)
