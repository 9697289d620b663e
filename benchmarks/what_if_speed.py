"""How long it takes to decide a finished result anew under other limits, and to say what would change.

    python benchmarks/what_if_speed.py [RESULT]

With a result: its own objects. Without: a made-up place of 170 objects before and 175 after, over 27 submaps.
Prints the median and the slowest of 100 random trials by either rule, milliseconds.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from types import SimpleNamespace
from typing import Any

import numpy as np

from pipeline.association.accumulation import Proposals
from pipeline.association.aggregation import MatchEvidence
from pipeline.change.basis import DecisionBasis, KnownMove
from pipeline.change.decision import VisitEvidence
from pipeline.change.evidence import ObjectEvidence
from pipeline.change.relabel import WhatIf, what_if
from pipeline.result import ChangeLabel
from pipeline.settings import Settings
from pipeline.store import open_result

COUNTS, SHARED, SUBMAPS, MOVES, TRIALS = (170, 175), 120, 27, 250, 100


def main() -> None:
    """Print both rules' times."""
    draw = np.random.default_rng(0)
    if len(sys.argv) > 1:
        again = what_if(open_result(sys.argv[1]))
        if again is None:
            sys.exit(f"{sys.argv[1]} does not hold what its labels follow from")
    else:
        again = made_up(draw)
    for rule in ("evidence", "paper"):
        took_ms, flips = [], []
        for _ in range(TRIALS):
            settings = Settings().override("change.rule", rule)
            for name, low, high in (
                ("change.min_log_odds", -2, 4),
                ("moves.min_log_odds", -3, 3),
                ("change.nu_min", 0, 1),
                ("change.tau_d_m", 0, 2),
                ("association.tau_sigma", 0, 1),
                ("association.tau_s", 0.5, 1),
            ):
                settings = settings.override(name, draw.uniform(low, high))
            started = time.perf_counter()
            flips.append(len(again.under(settings).flips))
            took_ms.append(1e3 * (time.perf_counter() - started))
        print(
            f"{rule}: median {np.median(took_ms):.1f} ms, slowest {max(took_ms):.1f} ms, "
            f"{min(flips)} to {max(flips)} objects would change"
        )


def made_up(draw: np.random.Generator) -> WhatIf:
    """Objects with random evidence, most of them unchanged."""
    visits = [_visit(draw, count) for count in COUNTS]
    evidence, proposals = MatchEvidence.empty(*COUNTS), Proposals.empty()
    for _ in range(SUBMAPS):
        local = MatchEvidence.empty(*COUNTS)
        owners = [draw.integers(0, count + 1, 4000) for count in COUNTS]
        same = draw.random(4000) < 0.6
        owners[1][same] = np.minimum(owners[0][same], COUNTS[1])
        local.add(owners[0], owners[1], draw.uniform(0.7, 1.0, 4000))
        evidence.merge(local)
        proposals = proposals.joined(local).joined(evidence)
    overlap = np.zeros(COUNTS)
    overlap[np.arange(SHARED), np.arange(SHARED)] = draw.uniform(0.1, 1, SHARED)
    moves = []
    for _ in range(MOVES):
        motion = np.eye(4)
        motion[:3, 3] = draw.normal(0, 1, 3)
        pair = (int(draw.integers(1, COUNTS[0] + 1)), int(draw.integers(1, COUNTS[1] + 1)))
        moves.append(KnownMove(*pair, float(draw.normal(-2, 2)), motion))
    ids = (np.arange(1, COUNTS[0] + 1), np.arange(1, COUNTS[1] + 1))
    ids[1][SHARED:] += COUNTS[0]
    objects = [
        SimpleNamespace(object_id=i, label=ChangeLabel.STATIC)
        for i in sorted({*ids[0].tolist(), *ids[1].tolist()})
    ]
    matrix = SimpleNamespace(row_object_ids=ids[0], column_object_ids=ids[1])
    result: Any = SimpleNamespace(score_matrix=matrix, objects=objects, path="made up")
    basis = DecisionBasis((visits[0], visits[1]), evidence, proposals, overlap, tuple(moves))
    return WhatIf(result, basis)


def _visit(draw: np.random.Generator, count: int) -> VisitEvidence:
    values: dict[str, Any] = {
        field.name: draw.random(count + 1) for field in dataclasses.fields(ObjectEvidence)
    }
    values |= {
        "voxel_count": draw.integers(20, 2000, count + 1),
        "centroid_world": draw.uniform(-10, 10, (count + 1, 3)),
    }
    return VisitEvidence(ObjectEvidence(**values), draw.normal(-2, 3, count + 1), np.ones(count + 1, bool))


if __name__ == "__main__":
    main()
