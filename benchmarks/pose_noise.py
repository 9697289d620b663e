"""How much of the change F1 is kept when the poses of the current visit are wrong.

    python benchmarks/pose_noise.py --scenes office --seeds 1 2

Every pair is run with its own poses, and with the current visit's poses changed in two ways, seeded:

- ``offset``: the whole visit is shifted by exactly --shift metres in a random direction and turned by exactly
  --turn degrees about a random axis through the middle of its camera path.
- ``jitter``: every frame on its own by the same amounts, in directions of its own.

The ground truth stays where it is in both: a run corrects the poses (settings ``registration``), and its
result is in the frame of the previous visit, whose poses are right. ``offset mm`` and ``offset deg`` are what
is left of the offset, at the middle of the camera path.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scene_pairs import DEFAULT_CACHE, generated_pair, settings_with

from pipeline.camera import rotation_angle_rad
from pipeline.evaluation import GroundTruth, evaluate_result, read_ground_truth
from pipeline.evaluation.counts import mean_defined
from pipeline.evaluation.motion_error import rotation_about
from pipeline.evaluation.tables import markdown, number
from pipeline.settings import Settings
from pipeline.store import read_manifest
from pipeline.synthetic import HELD_OUT_SCENES, SCENES
from pipeline.system import run

KINDS = ("offset", "jitter")


def main() -> None:
    """Print one row per pair and the means."""
    arguments = _arguments()
    settings = settings_with(arguments.set)
    rows = []
    with tempfile.TemporaryDirectory(prefix="oasisview-poses-") as temporary:
        for scene in arguments.scenes:
            for seed in arguments.seeds:
                print(f"{scene} {seed} ...", file=sys.stderr, flush=True)
                pair = generated_pair(arguments.cache, scene, seed, arguments.frames)
                row = measure(pair, arguments, settings, Path(temporary))
                rows.append({"scene": scene, "seed": seed, **row})
    means = {key: mean_defined(row[key] for row in rows) for key in rows[0] if key not in ("scene", "seed")}
    rows.append({"scene": "mean", "seed": "", **means})
    print(json.dumps(rows, indent=1) if arguments.json else table(rows))


def measure(
    pair: Path, arguments: argparse.Namespace, settings: Settings, folder: Path
) -> dict[str, float | None]:
    """Change F1 with right and with wrong poses, and the share that is kept."""
    truth = read_ground_truth(pair / "gt.ply")
    rng = np.random.default_rng(arguments.noise_seed)
    exact = _change_f1(pair / "s0", pair / "s1", truth, settings, folder / f"{pair.name}.oasis")
    row: dict[str, float | None] = {"exact": exact}
    for kind in KINDS:
        archive = folder / f"{pair.name}-{kind}"
        T_wrong_right = disturb(pair / "s1", archive, kind, arguments.shift, np.radians(arguments.turn), rng)
        output = archive.with_suffix(".oasis")
        f1 = _change_f1(pair / "s0", archive, truth, settings, output)
        row[kind] = f1
        row[f"{kind} kept"] = f1 / exact if f1 is not None and exact else None
        if kind == "offset":
            row["offset mm"], row["offset deg"] = left_over(read_manifest(output), T_wrong_right, archive)
    return row


def disturb(
    archive: Path, copy: Path, kind: str, shift_m: float, turn_rad: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Write an archive with wrong poses (images are linked); returns where its world went, (4, 4)."""
    meta = json.loads((archive / "transforms.json").read_text())
    poses = np.array([frame["transform_matrix"] for frame in meta["frames"]], dtype=np.float64)
    T_wrong_right = np.eye(4)
    if kind == "offset":
        error, middle = random_motion(shift_m, turn_rad, rng), poses[:, :3, 3].mean(axis=0)
        T_wrong_right[:3, :3] = error[:3, :3]
        T_wrong_right[:3, 3] = middle + error[:3, 3] - error[:3, :3] @ middle
        poses = T_wrong_right @ poses
    else:
        poses = np.array([pose @ random_motion(shift_m, turn_rad, rng) for pose in poses])
    for frame, pose in zip(meta["frames"], poses, strict=True):
        frame["transform_matrix"] = pose.tolist()
    copy.mkdir(parents=True)
    for name in ("images", "depth"):
        (copy / name).symlink_to((archive / name).resolve())
    (copy / "transforms.json").write_text(json.dumps(meta))
    return T_wrong_right


def left_over(
    manifest: Mapping[str, Any], T_wrong_right: NDArray[np.float64], archive: Path
) -> tuple[float, float]:
    """Millimetres and degrees that the run's correction leaves of an offset."""
    T_corrected_wrong = np.array(manifest["quality"]["registration"].get("T_previous_current", np.eye(4)))
    T_left = T_corrected_wrong @ T_wrong_right
    frames = json.loads((archive / "transforms.json").read_text())["frames"]
    wrong = np.array([frame["transform_matrix"] for frame in frames])[:, :3, 3].mean(axis=0)
    corrected = T_corrected_wrong[:3, :3] @ wrong + T_corrected_wrong[:3, 3]
    right = np.linalg.solve(T_wrong_right, [*wrong, 1])[:3]
    angle_rad = rotation_angle_rad(np.eye(3), T_left[:3, :3])
    return float(1000 * np.linalg.norm(corrected - right)), float(np.degrees(angle_rad))


def random_motion(shift_m: float, turn_rad: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """(4, 4) motion of exactly these amounts in random directions."""
    axis, direction = (vector / np.linalg.norm(vector) for vector in rng.normal(size=(2, 3)))
    motion = np.eye(4)
    motion[:3, :3] = rotation_about(axis, turn_rad)
    motion[:3, 3] = shift_m * direction
    return motion


def table(rows: list[dict]) -> str:
    """Markdown."""
    names = list(rows[0])[2:]
    cells = [
        [f"{row['scene']} {row['seed']}".strip(), *(number(row[name]) for name in names)] for row in rows
    ]
    return markdown(["pair", *names], cells)


def _change_f1(
    previous: Path, current: Path, truth: GroundTruth, settings: Settings, output: Path
) -> float | None:
    result = run(previous, current, settings=settings, output=output)
    return evaluate_result(result, truth).pointwise.mean_change_f1


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--scenes", nargs="+", choices=SCENES + HELD_OUT_SCENES, default=list(SCENES), metavar="SCENE"
    )
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3], metavar="N")
    parser.add_argument("--frames", type=int, default=40, metavar="N", help="keyframes of each visit")
    parser.add_argument("--shift", type=float, default=0.02, metavar="M", help="metres (default: 0.02)")
    parser.add_argument("--turn", type=float, default=1.0, metavar="DEG", help="degrees (default: 1)")
    parser.add_argument("--noise-seed", type=int, default=0, metavar="N")
    parser.add_argument("--set", action="append", default=[], metavar="SECTION.NAME=VALUE")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, metavar="FOLDER")
    parser.add_argument("--json", action="store_true", help="print the rows as JSON")
    return parser.parse_args()


if __name__ == "__main__":
    main()
