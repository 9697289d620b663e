"""The command: parses, calls one of ``oasisview.commands`` and turns errors into exit codes.

Exit codes: 0 done; 2 the call or the input is wrong (one line on stderr); 1 anything else.
Nothing heavy is imported before a command runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Sequence
from typing import NoReturn

import pipeline
from oasisview.commands import COMMANDS
from pipeline.errors import OasisError

DONE, FAILED, WRONG_INPUT = 0, 1, 2

_DESCRIPTION = """What changed between two visits of a place, object by object, with the evidence for every
decision. Start with `oasisview demo`; with recordings of your own: `oasisview view PREVIOUS CURRENT`."""

_EPILOG = """exit codes: 0 done; 2 the call or the input is wrong (one line says what and how to mend it);
1 anything else. Progress goes to stderr, results to stdout. `oasisview COMMAND --help` tells more."""


class OneLineParser(argparse.ArgumentParser):
    """A parser whose complaints are one line that names the help to read."""

    def error(self, message: str) -> NoReturn:
        """Exit with code 2 and one line."""
        text = " ".join(message.split())
        self.exit(WRONG_INPUT, f"{self.prog}: {text}: see `{self.prog} --help`\n")


def build_parser() -> argparse.ArgumentParser:
    """The parser of the whole command."""
    parser = OneLineParser(prog="oasisview", description=_DESCRIPTION, epilog=_EPILOG)
    parser.add_argument("--version", action="version", version=f"oasisview {pipeline.__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        subparser = commands.add_parser(command.NAME, help=command.HELP, description=command.DESCRIPTION)
        command.configure(subparser)
        subparser.set_defaults(run_command=command.run_command)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    try:
        arguments = build_parser().parse_args(argv)
        code: int = arguments.run_command(arguments)
        sys.stdout.flush()
        return code
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else DONE if stop.code is None else FAILED
    except OasisError as error:
        print(f"oasisview: {_one_line(error)}", file=sys.stderr)
        return WRONG_INPUT
    except KeyboardInterrupt:
        print("oasisview: interrupted; the same command goes on from where it was", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        # Whoever read our output (head, less) has left; Python must not complain at exit either.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except Exception as error:
        traceback.print_exc()
        print(f"oasisview: internal error, please report it: {_one_line(error)}", file=sys.stderr)
        return FAILED


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
