"""Positive and negative differences between two point maps, strong and weak (LT-Mapper's LT-removert).

Sets are boolean arrays over the fused voxels of a visit, which stand for the map's points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pipeline.baselines.range_images import RangeImage, disagreeing_points, points_in_view, scan_image
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.voxel_blocks import VoxelBlocks
from pipeline.settings import BaselineSettings, Settings

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Differences:
    """What one map holds that the other does not; arrays are (M,) over its points.

    Attributes:
        is_different: farther from the other map than its own points lie apart.
        is_strong: of the previous map: negative differences that no scan of the current visit explains by
            occlusion, and what lies near them. Of the current map: positive differences that lie outside of
            what the previous visit saw to be empty.
        is_covered: some keyframe of the other visit measured in this direction.
    """

    is_different: Mask
    is_strong: Mask
    is_covered: Mask


def knn_distance_m(settings: BaselineSettings, voxel_size_m: float) -> float:
    """Distance from which a point differs: the published one, or more where voxels are too coarse for it."""
    return max(settings.knn_distance_m, settings.knn_distance_voxels * voxel_size_m)


def lacks_neighbours(
    points: NDArray[np.floating], other_points: NDArray[np.floating], count: int, distance_m: float
) -> Mask:
    """(N,) points whose ``count`` nearest other points are too far: the mean of the squared distances, as PCL
    returns them, is not below the squared limit. Everything differs from an empty map."""
    if not len(other_points) or not len(points):
        return np.ones(len(points), bool)
    count = min(count, len(other_points))
    distances, _ = cKDTree(other_points).query(points, k=list(range(1, count + 1)), workers=-1)
    return np.mean(distances**2, axis=1) >= distance_m**2


def highly_dynamic(geometry: SessionGeometry, settings: Settings) -> Mask:
    """Points that a scan of their own visit saw through: they moved during the visit, or are noise."""
    every = np.ones(len(geometry.surface.points_world), bool)
    front, _ = _disagreeing(geometry, every, geometry, _scans(geometry, settings), settings)
    return front


def find_differences(
    previous: SessionGeometry, current: SessionGeometry, settings: Settings
) -> tuple[Differences, Differences]:
    """Negative differences of the previous map and positive differences of the current one."""
    baseline = settings.baseline
    visits = (previous, current)
    points = [visit.surface.points_world for visit in visits]
    scans = [_scans(visit, settings) for visit in visits]
    is_static = [
        ~_disagreeing(visit, np.ones(len(cloud), bool), visit, of_visit, settings)[0]
        for visit, cloud, of_visit in zip(visits, points, scans, strict=True)
    ]
    distance_m = knn_distance_m(baseline, previous.surface.voxel_size_m)
    found = []
    for visit in range(2):
        other = 1 - visit
        different = is_static[visit].copy()
        different[different] = lacks_neighbours(
            points[visit][different], points[other][is_static[other]], baseline.knn_count, distance_m
        )
        strong = different.copy()
        for _ in range(baseline.peeling_rounds):
            front, behind = _disagreeing(visits[visit], strong, visits[other], scans[other], settings)
            strong &= ~(behind if visit == 0 else front)
        if visit == 0:
            strong |= _near(points[0], different & ~strong, strong, baseline)
        covered = _covered(visits[visit], different, visits[other], settings)
        found.append(Differences(different, strong, covered))
    return found[0], found[1]


def _near(points: NDArray[np.float32], weak: Mask, strong: Mask, settings: BaselineSettings) -> Mask:
    """Weak points with strong ones around them."""
    near = weak.copy()
    if strong.any():
        near[weak] = ~lacks_neighbours(
            points[weak], points[strong], settings.knn_count, settings.propagation_m
        )
    else:
        near[:] = False
    return near


def _scans(geometry: SessionGeometry, settings: Settings) -> list[RangeImage]:
    return [
        scan_image(geometry.store.depth(k), geometry.strided_camera(k), settings.baseline.range_cell_deg)
        for k in range(len(geometry.keyframes))
    ]


def _disagreeing(
    observed: SessionGeometry,
    subset: Mask,
    observer: SessionGeometry,
    scans: list[RangeImage],
    settings: Settings,
) -> tuple[Mask, Mask]:
    """Points of a subset that some scan of ``observer`` finds in front of, or behind, what it measured."""
    front, behind = np.zeros(len(subset), bool), np.zeros(len(subset), bool)
    numbers = np.flatnonzero(subset)
    points = observed.surface.points_world
    if not len(numbers):
        return front, behind
    blocks = VoxelBlocks(points[numbers], observed.surface.voxel_size_m)
    baseline = settings.baseline
    for k, keyframe in enumerate(observer.keyframes):
        camera = observer.strided_camera(k)
        candidates = numbers[blocks.in_view(camera, keyframe.T_world_camera, settings.image.max_depth_m)]
        in_front, hidden = disagreeing_points(
            points,
            candidates,
            scans[k],
            camera,
            keyframe.T_world_camera,
            baseline.range_cell_deg,
            baseline.range_difference_m,
        )
        front[in_front] = True
        behind[hidden] = True
    return front, behind


def _covered(observed: SessionGeometry, subset: Mask, observer: SessionGeometry, settings: Settings) -> Mask:
    """Points of a subset in whose direction some keyframe of ``observer`` measured anything."""
    covered = np.zeros(len(subset), bool)
    numbers = np.flatnonzero(subset)
    points = observed.surface.points_world
    for k, keyframe in enumerate(observer.keyframes):
        depth, camera = observer.store.depth(k), observer.strided_camera(k)
        covered[points_in_view(points, numbers, depth, camera, keyframe.T_world_camera, np.inf)] = True
    return covered
