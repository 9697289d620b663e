"""``oasisview evaluate``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from oasisview.commands.options import add_json_option
from pipeline.errors import InputError

NAME = "evaluate"
HELP = "precision, recall and F1 against ground truth"
DESCRIPTION = (
    "Compare a result with ground truth: a PLY as `oasisview generate` writes it (OUT/gt.ply), and the "
    "motions of its objects in a .json of the same name, if there is one."
)
# As in pipeline.evaluation.presets, which is heavy to import; a test holds the two together.
PRESETS = ("paper", "khronos", "livingscenes", "scenediff")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("result", type=Path, metavar="RESULT", help="result folder")
    parser.add_argument("ground_truth", type=Path, metavar="GROUND_TRUTH", help="PLY with exact labels")
    parser.add_argument(
        "--preset",
        choices=PRESETS,
        metavar="NAME",
        help=f"only the metrics as a publication defines them: {', '.join(PRESETS)}",
    )
    add_json_option(parser)


def run_command(arguments: argparse.Namespace) -> int:
    """Print the table, or JSON."""
    if not arguments.ground_truth.exists():
        raise InputError(f"there is no ground truth {arguments.ground_truth}", "check the path")
    from pipeline.evaluation import evaluate, evaluate_preset
    from pipeline.store import read_manifest

    read_manifest(arguments.result)
    if arguments.preset is not None:
        preset = evaluate_preset(arguments.preset, arguments.result, arguments.ground_truth)
        print(json.dumps(preset.to_dict(), indent=2) if arguments.json else preset.table())
        return 0
    report = evaluate(arguments.result, arguments.ground_truth)
    print(json.dumps(report.to_dict(), indent=2) if arguments.json else report.table())
    return 0
