"""Change detection on synthetic scenes: generate, run, evaluate, and print the whole table.

    python benchmarks/evaluate_scenes.py
    python benchmarks/evaluate_scenes.py --scenes office --seeds 1 2 --frames 20 --set change.rule=paper

Generated pairs are kept in the cache folder and made again when the generator's code changes. Results go
to a temporary folder unless ``--keep`` names one. Markdown goes to stdout, progress to stderr, everything
that was measured to ``--json``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import tempfile
import time
from pathlib import Path

import pipeline.synthetic
from pipeline.errors import OasisError
from pipeline.evaluation import Report, evaluate_result
from pipeline.evaluation.summary import Summary
from pipeline.ply import read_ply
from pipeline.settings import Settings
from pipeline.synthetic import SCENES, generate


def main() -> int:
    """Run the benchmark; 1 when a pair failed, 2 when the call is wrong."""
    arguments = _arguments()
    try:
        settings = _settings(arguments.set)
    except OasisError as error:
        print(error, file=sys.stderr)
        return 2
    reports: dict[str, Report] = {}
    seconds: dict[str, float] = {}
    failures: dict[str, str] = {}
    with tempfile.TemporaryDirectory(prefix="oasisview-benchmark-") as temporary:
        results = arguments.keep or Path(temporary)
        for scene in arguments.scenes:
            for seed in arguments.seeds:
                name = f"{scene} {seed}"
                print(f"{name} ...", file=sys.stderr, flush=True)
                try:
                    pair = _generated(arguments.cache, scene, seed, arguments.frames)
                    output = results / f"{scene}-{seed}.oasis"
                    reports[name], seconds[name] = _evaluated(pair, output, settings)
                except OasisError as error:
                    failures[name] = str(error)
                    print(f"{name}: {error}", file=sys.stderr)
    summary = Summary(reports)
    print(f"{arguments.frames} keyframes a visit; processing took {sum(seconds.values()):.0f} s in all\n")
    print(summary.pair_table(), summary.class_table(), sep="\n\n")
    for name, message in failures.items():
        print(f"\n{name} failed: {message}")
    if arguments.json:
        content = {
            "frames": arguments.frames,
            "settings": settings.to_dict(),
            "seconds": seconds,
            "failures": failures,
            **summary.to_dict(),
        }
        arguments.json.write_text(json.dumps(content, indent=1) + "\n")
    return 1 if failures else 0


def _evaluated(pair: Path, output: Path, settings: Settings) -> tuple[Report, float]:
    from pipeline.system import run

    start = time.perf_counter()
    result = run(pair / "s0", pair / "s1", settings=settings, output=output)
    seconds = time.perf_counter() - start
    return evaluate_result(result, read_ply(pair / "gt.ply")), seconds


def _generated(cache: Path, scene: str, seed: int, frames: int) -> Path:
    """The pair's folder in the cache; its name changes with the generator's code."""
    digest = hashlib.sha256()
    for source in sorted(Path(pipeline.synthetic.__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    pair = cache / f"{scene}-{seed}-{frames}-{digest.hexdigest()[:10]}"
    if not (pair / "gt.ply").exists():
        generate(scene, pair, seed, frames)
    return pair


def _settings(overrides: list[str]) -> Settings:
    settings = Settings()
    for override in overrides:
        name, _, value = override.partition("=")
        settings = settings.override(name.strip(), value.strip())
    return settings


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES), metavar="SCENE")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3], metavar="N")
    parser.add_argument("--frames", type=int, default=40, metavar="N", help="keyframes of each visit")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.NAME=VALUE")
    parser.add_argument("--cache", type=Path, default=Path(".oasisview/scenes"), metavar="FOLDER")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the results here")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write everything measured")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
