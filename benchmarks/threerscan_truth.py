"""Write the annotations of a 3RScan rescan as ground truth: gt.ply and gt.json.

    python benchmarks/threerscan_truth.py 3RScan.json SCANS RESCAN_ID OUT

SCANS holds a folder per scan id with ``semseg.v2.json`` and ``labels.instances.annotated.v2.ply``. The world
is that of the reference scan: recordings to be evaluated must be in it too, so the alignment of the rescan
is printed (row by row, p_reference = T p_rescan). What is labelled how stands in
``pipeline/evaluation/threerscan_truth.py``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from pipeline.errors import OasisError
from pipeline.evaluation.threerscan_files import read_rescan
from pipeline.evaluation.threerscan_truth import (
    MoveThreshold,
    ThreeRScanSettings,
    threerscan_truth,
    write_truth,
)
from pipeline.ply import NOT_SCORED
from pipeline.result import ChangeLabel


def main(call: list[str] | None = None) -> int:
    """Run the script; 2 when the call or the annotations are wrong."""
    arguments = _arguments(call)
    threshold = MoveThreshold(arguments.translation_m, arguments.rotation_deg)
    try:
        truth = threerscan_truth(
            arguments.index, arguments.scans, arguments.rescan, ThreeRScanSettings(threshold)
        )
        write_truth(arguments.out, truth)
        T_reference_rescan = read_rescan(arguments.index, arguments.rescan).T_reference_rescan
    except OasisError as error:
        print(error, file=sys.stderr)
        return 2
    print("T_reference_rescan", np.round(T_reference_rescan, 6).tolist())
    print(f"moved = more than {threshold.translation_m} m or {threshold.rotation_deg} degrees")
    points = truth.points
    for label in (*ChangeLabel, NOT_SCORED):
        mine = points.label == label
        objects = len(set(points.object_id[mine].tolist()) - {0})
        name = "not scored" if label == NOT_SCORED else ChangeLabel(label).name.lower()
        if mine.any():
            print(f"{name}: {objects} objects, {int(mine.sum())} points")
    return 0


def _arguments(call: list[str] | None) -> argparse.Namespace:
    default = MoveThreshold()
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("index", type=Path, metavar="3RScan.json")
    parser.add_argument("scans", type=Path, metavar="SCANS")
    parser.add_argument("rescan", metavar="RESCAN_ID")
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--translation-m", type=float, default=default.translation_m, metavar="M")
    parser.add_argument("--rotation-deg", type=float, default=default.rotation_deg, metavar="DEG")
    return parser.parse_args(call)


if __name__ == "__main__":
    sys.exit(main())
