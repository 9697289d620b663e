"""Speed and memory of a whole run, in a process of its own: keyframes a second, time per stage, peak memory.

    python benchmarks/speed.py                         # 276 keyframes a visit, and four times as many
    python benchmarks/speed.py --frames 40 --rounds 1

A synthetic pair is generated once (and kept in --cache). More rounds walk the same recording again, so that
the place stays the same while the number of keyframes grows: time should grow in proportion, memory hardly.
Machines are noisy: compare the rows of one table, not tables of two days.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pipeline.progress import STAGES


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", default="office", help="synthetic scene (default: office)")
    parser.add_argument("--frames", type=int, default=276, help="keyframes a visit (default: 276)")
    parser.add_argument("--rounds", type=int, nargs="+", default=[1, 4], help="walks of the recording (1 4)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cache", type=Path, default=Path(tempfile.gettempdir()) / "oasisview-speed")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    parser.add_argument("--one", nargs=3, metavar=("S0", "S1", "OUT"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        measure_here(*map(Path, arguments.one))
        return
    pair = arguments.cache / f"{arguments.scene}-{arguments.seed}-{arguments.frames}"
    if not (pair / "gt.ply").exists():
        from pipeline.synthetic import generate

        pair.parent.mkdir(parents=True, exist_ok=True)
        generate(arguments.scene, pair, arguments.seed, arguments.frames)
    rows = [measure(pair, rounds) for rounds in arguments.rounds]
    print(json.dumps(rows, indent=1) if arguments.json else table(rows))


def measure(pair: Path, rounds: int) -> dict[str, float]:
    """Run the engine on a pair, walked a number of times, in a child process."""
    folder = Path(tempfile.mkdtemp(prefix="oasisview-speed-", dir=pair.parent))
    try:
        visits = [walk_again(pair / visit, folder / visit, rounds) for visit in ("s0", "s1")]
        command = [sys.executable, __file__, "--one", *map(str, visits), str(folder / "changes.oasis")]
        output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        return {"rounds": rounds, **json.loads(output.splitlines()[-1])}
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def walk_again(archive: Path, copy: Path, rounds: int) -> Path:
    """An archive whose frames come several times; the images are linked, not copied."""
    meta = json.loads((archive / "transforms.json").read_text())
    meta["frames"] = meta["frames"] * rounds
    copy.mkdir(parents=True)
    for name in ("images", "depth"):
        (copy / name).symlink_to((archive / name).resolve())
    (copy / "transforms.json").write_text(json.dumps(meta))
    return copy


def measure_here(previous: Path, current: Path, out: Path) -> None:
    """Run the engine in this process and print what it took as one line of JSON."""
    from pipeline.settings import Settings
    from pipeline.system import run

    started = time.perf_counter()
    settings = Settings().override("keyframes.select", False)
    result = run(previous, current, settings=settings, output=out)
    seconds = time.perf_counter() - started
    keyframes = sum(len(session.keyframes) for session in result.sessions)
    stages = {stage: 1000 * s / keyframes for stage, s in result.manifest["timings_s"].items()}
    row = {
        "keyframes": keyframes,
        "objects": len(result.objects),
        "map_points": sum(len(session.points_world) for session in result.sessions),
        "seconds": seconds,
        "keyframes_per_s": keyframes / seconds,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        **{f"{stage}_ms": milliseconds for stage, milliseconds in stages.items()},
    }
    print(json.dumps(row))


def table(rows: list[dict[str, float]]) -> str:
    """Markdown table of the rows, and the ratios to the first."""
    stages = [stage for stage, _ in STAGES if f"{stage}_ms" in rows[0]]
    head = ["keyframes", "objects", "points", "s", "keyframes/s", "peak MB", *(f"{s} ms/kf" for s in stages)]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows:
        cells = [
            f"{row['keyframes']:.0f}", f"{row['objects']:.0f}", f"{row['map_points']:.0f}",
            f"{row['seconds']:.1f}", f"{row['keyframes_per_s']:.2f}", f"{row['peak_mb']:.0f}",
            *(f"{row[f'{stage}_ms']:.1f}" for stage in stages),
        ]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    first = rows[0]
    lines += [
        f"{row['keyframes'] / first['keyframes']:.1f}x the keyframes: "
        f"{row['seconds'] / first['seconds']:.2f}x the time, "
        f"{row['peak_mb'] / first['peak_mb']:.2f}x the memory"
        for row in rows[1:]
    ]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
