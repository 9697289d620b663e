"""Change detection on synthetic scenes: scenes x seeds x methods, generated, run and evaluated in one table.

    python benchmarks/evaluate_methods.py --json all.json --plot figures
    python benchmarks/evaluate_methods.py --scenes office --seeds 1 2 --frames 20 --methods oasis
    python benchmarks/evaluate_methods.py --methods oasis --variant eq8=change.rule=paper

A method is a name given to settings: the engine and the baselines by ``run.method``, and any ``--variant``.
Seeds 101 to 103 are the reported ones and are for reporting only. Generated pairs are kept in the cache and
made again when the generator's code changes. Results go to a temporary folder unless ``--keep`` names
one, from which finished results are taken as they are. Markdown goes to stdout, progress to stderr,
everything measured to ``--json``, figures to ``--plot``.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

from scene_pairs import DEFAULT_CACHE, generated_pair, settings_with

from pipeline.errors import OasisError
from pipeline.evaluation import evaluate_result, read_ground_truth
from pipeline.evaluation.method_table import MethodTable, Outcome, Trial
from pipeline.methods import METHODS
from pipeline.settings import Settings
from pipeline.synthetic import HELD_OUT_SCENES, SCENES

ALL_SCENES = SCENES + HELD_OUT_SCENES


def main() -> int:
    """Run the benchmark; 1 when a trial failed, 2 when the call is wrong."""
    arguments = _arguments()
    try:
        methods = _methods(arguments)
    except OasisError as error:
        print(error, file=sys.stderr)
        return 2
    trials = [
        Trial(method, scene, seed)
        for scene in arguments.scenes
        for seed in arguments.seeds
        for method in methods
    ]
    outcomes: dict[Trial, Outcome] = {}
    failures: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="oasisview-benchmark-") as temporary:
        folder = arguments.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for number, trial in enumerate(trials, start=1):
            print(f"{number}/{len(trials)} {trial} ...", file=sys.stderr, flush=True)
            try:
                pair = generated_pair(arguments.cache, trial.scene, trial.seed, arguments.frames)
                output = folder / f"{trial.method}-{pair.name}.oasis"
                outcomes[trial] = run_trial(pair, output, methods[trial.method])
            except OasisError as error:
                failures[str(trial)] = str(error)
                print(f"{trial}: {error}", file=sys.stderr)
    table = MethodTable(outcomes)
    print(f"{arguments.frames} keyframes a visit, seeds {' '.join(map(str, arguments.seeds))}\n")
    print(table.text())
    for name, message in failures.items():
        print(f"\n{name} failed: {message}")
    content = {
        "frames": arguments.frames,
        "settings": {name: settings.to_dict() for name, settings in methods.items()},
        "failures": failures,
        **table.to_dict(),
    }
    if arguments.json:
        arguments.json.write_text(json.dumps(content, indent=1) + "\n")
    if arguments.plot:
        from plot_methods import draw

        for path in draw(content, arguments.plot):
            print(f"drew {path}", file=sys.stderr)
    return 1 if failures else 0


def run_trial(pair: Path, output: Path, settings: Settings) -> Outcome:
    """Run one method on one pair, or take the finished result, and evaluate it."""
    from pipeline.system import run

    # The runtime of a finished result is that of the run that made it.
    clock = output.with_suffix(".seconds.json")
    finished = output.exists() and clock.exists()
    start = time.perf_counter()
    result = run(pair / "s0", pair / "s1", settings=settings, output=output)
    seconds = time.perf_counter() - start
    if finished:
        seconds = json.loads(clock.read_text())
    else:
        clock.write_text(json.dumps(seconds))
    return Outcome(evaluate_result(result, read_ground_truth(pair / "gt.ply")), seconds)


def _methods(arguments: argparse.Namespace) -> dict[str, Settings]:
    """Settings by the name of the method, in the order in which they were asked for."""
    methods = {name: settings_with(arguments.set).override("run.method", name) for name in arguments.methods}
    for variant in arguments.variant:
        name, _, overrides = variant.partition("=")
        methods[name] = settings_with([*arguments.set, *overrides.split(",")])
    return methods


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", choices=ALL_SCENES, default=list(SCENES), metavar="SCENE")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3], metavar="N")
    parser.add_argument(
        "--methods",
        nargs="+",
        choices=METHODS,
        default=list(METHODS),
        metavar="METHOD",
        help=", ".join(METHODS),
    )
    parser.add_argument(
        "--variant",
        action="append",
        default=[],
        metavar="NAME=SECTION.NAME=VALUE[,...]",
        help="the engine with other settings, as a method of that name",
    )
    parser.add_argument("--frames", type=int, default=40, metavar="N", help="keyframes of each visit")
    parser.add_argument(
        "--set", action="append", default=[], metavar="SECTION.NAME=VALUE", help="for every method"
    )
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, metavar="FOLDER")
    parser.add_argument(
        "--keep", type=Path, metavar="FOLDER", help="keep the results here, and go on from them"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything measured")
    parser.add_argument("--plot", type=Path, metavar="FOLDER", help="draw the figures there (matplotlib)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
