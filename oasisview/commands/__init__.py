"""One file per command: ``NAME``, ``HELP``, ``DESCRIPTION``, ``configure`` and ``run_command``.

``run_command`` returns the exit code or raises; it imports what is heavy itself.
"""

from __future__ import annotations

import argparse
from typing import Protocol

from oasisview.commands import batch, check, demo, evaluate, export, generate, models, run, view


class Command(Protocol):
    """What a command's module offers."""

    NAME: str
    HELP: str
    DESCRIPTION: str

    def configure(self, parser: argparse.ArgumentParser) -> None:
        """Add the command's arguments."""

    def run_command(self, arguments: argparse.Namespace) -> int:
        """Do it; returns the exit code."""


COMMANDS: tuple[Command, ...] = (demo, view, run, export, evaluate, check, generate, batch, models)
