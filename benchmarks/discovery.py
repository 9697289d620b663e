"""Objects found without weights against ground truth, and what that costs.

    python benchmarks/discovery.py SESSION [SESSION ...] [--ground-truth gt.ply]
    python benchmarks/discovery.py --generate office carpark --seeds 1 2

Prints a Markdown table: recall of true objects at IoU .25 and .5 (on voxels; true objects are mapped from the
ground truth by nearest neighbour), precision at .25, objects predicted, and seconds for the discovery alone.
Both visits of a generated scene are added up. True objects of fewer than ``min_voxels`` voxels do not count.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from pipeline.mapping.depth_geometry import depth_geometry
from pipeline.mapping.fusion import VoxelFusion
from pipeline.mapping.scale import voxel_size_m
from pipeline.mapping.surface import FusedSurface
from pipeline.perception.embedded.discovery import discover_objects
from pipeline.ply import read_ply
from pipeline.readers import open_session
from pipeline.settings import Settings


@dataclass
class Score:
    """Counts over the visits of a scene."""

    true: int = 0
    predicted: int = 0
    found_25: int = 0
    found_50: int = 0
    voxels: int = 0
    seconds: float = 0.0
    missed: list[str] = field(default_factory=list)

    def row(self, name: str) -> str:
        """One row of the table."""
        recall = (
            f"{self.found_25 / self.true:.2f} | {self.found_50 / self.true:.2f}" if self.true else "- | -"
        )
        precision = f"{self.found_25 / self.predicted:.2f}" if self.true and self.predicted else "-"
        return (
            f"| {name} | {recall} | {precision} | {self.predicted} | {self.true} "
            f"| {self.voxels} | {self.seconds:.2f} |"
        )


def fuse(path: Path, settings: Settings) -> tuple[FusedSurface, list[NDArray[np.int32]]]:
    """Surface of a whole session, every frame a keyframe, and the voxels of each keyframe's pixels."""
    session = open_session(path)
    keyframes = tuple(range(len(session.frames)))
    fusion = VoxelFusion(voxel_size_m(session, keyframes, settings))
    stride = settings.image.geometry_stride
    voxels = []
    for frame in session.frames:
        depth = frame.load_depth()
        depth = np.where(depth <= settings.image.max_depth_m, depth, 0)[::stride, ::stride]
        geometry = depth_geometry(
            depth.astype(np.float32), frame.camera.strided(stride), settings.surface.min_incidence_cosine
        )
        rgb = frame.load_rgb()[::stride, ::stride]
        lab = cv2.cvtColor(rgb.astype(np.float32) / 255, cv2.COLOR_RGB2Lab)
        good = geometry.is_reliable
        rotation = frame.T_world_camera[:3, :3].astype(np.float32)
        points = geometry.points_camera[good] @ rotation.T + frame.T_world_camera[:3, 3].astype(np.float32)
        normals = geometry.normals_camera[good] @ rotation.T
        voxels.append(fusion.add(points, normals, lab[good], frame.T_world_camera))
    surface, remap, _ = fusion.finish(settings.surface.min_samples)
    return surface, [remap[one] for one in voxels]


def seen_often(segments: NDArray[np.int32], views: list[NDArray[np.int32]], min_views: int) -> NDArray:
    """Segments that cover at least 30 pixels in too few keyframes become background."""
    count = int(segments.max(initial=0)) + 1
    seen = np.zeros(count, np.int64)
    for voxels in views:
        seen += np.bincount(segments[voxels[voxels >= 0]], minlength=count) >= 30
    return np.where(seen[segments] >= min_views, segments, 0)


def add_visit(score: Score, path: Path, truth: Path | None, visit: int, settings: Settings) -> None:
    """Fuse and segment one visit and add it to the score."""
    surface, views = fuse(path, settings)
    start = time.perf_counter()
    segments = discover_objects(surface, settings.discovery)
    score.seconds += time.perf_counter() - start
    segments = seen_often(segments, views, settings.discovery.min_views)
    _, segments = np.unique(np.append(segments, 0), return_inverse=True)
    segments = segments[:-1]
    score.voxels += len(segments)
    score.predicted += int(segments.max(initial=0))
    if truth is None:
        return
    points = read_ply(truth)
    points = points.select(points.session == visit)
    distance, nearest = cKDTree(points.points_world).query(surface.points_world)
    owner = np.where(distance < 3 * surface.voxel_size_m, points.object_id[nearest], 0)
    ids, owner = np.unique(np.append(owner, 0), return_inverse=True)
    owner = owner[:-1]
    shared = np.zeros((len(ids), segments.max() + 1))
    np.add.at(shared, (owner, segments), 1)
    sizes = shared.sum(axis=1)
    overlap = shared / (sizes[:, None] + shared.sum(axis=0)[None] - shared)
    large = [i for i in range(1, len(ids)) if ids[i] > 0 and sizes[i] >= settings.discovery.min_voxels]
    overlap = overlap[large][:, 1:]
    rows, columns = linear_sum_assignment(-overlap)
    best = np.zeros(len(large))
    best[rows] = overlap[rows, columns]
    score.true += len(large)
    score.found_25 += int((best > 0.25).sum())
    score.found_50 += int((best > 0.5).sum())
    for i in np.flatnonzero(best <= 0.5):
        where = surface.points_world[owner == large[i]]
        inside = segments[owner == large[i]]
        score.missed.append(
            f"{path.name} object {ids[large[i]]}: IoU {best[i]:.2f}, {len(where)} voxels of "
            f"{surface.voxel_size_m:.3f} m about {np.round(where.mean(axis=0), 2).tolist()}, extent "
            f"{np.round(np.ptp(where, axis=0), 2).tolist()}, "
            f"{(inside == 0).mean():.0%} background, {len(np.unique(inside))} segments"
        )


def main() -> None:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("sessions", nargs="*", type=Path)
    parser.add_argument("--ground-truth", type=Path, help="gt.ply of the sessions, in their order")
    parser.add_argument("--generate", nargs="*", default=[], help="kinds of synthetic scene")
    parser.add_argument("--seeds", nargs="*", type=int, default=[1, 2])
    parser.add_argument("--frames", type=int, default=40, help="frames per generated visit")
    parser.add_argument("--missed", action="store_true", help="list true objects below IoU .5")
    arguments = parser.parse_args()
    settings = Settings()
    print(
        "| scene | R@.25 | R@.5 | P@.25 | predicted | true | voxels | s |\n|---|---|---|---|---|---|---|---|"
    )
    score = Score()
    for visit, path in enumerate(arguments.sessions):
        if arguments.ground_truth is None:
            score = Score()
        add_visit(score, path, arguments.ground_truth, visit, settings)
        if arguments.ground_truth is None:
            print(score.row(str(path)), flush=True)
    report = [score] if arguments.ground_truth else []
    if report:
        print(score.row(str(arguments.ground_truth)))
    for kind in arguments.generate:
        from pipeline.synthetic import generate

        for seed in arguments.seeds:
            score = Score()
            with tempfile.TemporaryDirectory() as folder:
                generate(kind, Path(folder), seed, arguments.frames)
                for visit in (0, 1):
                    add_visit(score, Path(folder) / f"s{visit}", Path(folder) / "gt.ply", visit, settings)
            print(score.row(f"{kind} {seed}"), flush=True)
            report.append(score)
    if arguments.missed:
        print("\n".join(line for score in report for line in score.missed))
    print(f"\npeak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
