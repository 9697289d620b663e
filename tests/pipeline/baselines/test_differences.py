"""Nearest-neighbour differences, their strong and weak parts, and clusters."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from pipeline.baselines.differences import Differences, find_differences, knn_distance_m, lacks_neighbours
from pipeline.baselines.geometric import CHANGED, SAME, UNJUDGED, clusters, judged
from pipeline.mapping.front_end import SessionGeometry
from pipeline.settings import BaselineSettings, Settings


def chain(codes: list[int]) -> SimpleNamespace:
    """A surface whose voxels neighbour the next one."""
    n = len(codes)
    rows = np.arange(n - 1)
    links = csr_matrix((np.ones(n - 1), (rows, rows + 1)), shape=(n, n))
    return SimpleNamespace(neighbours=links + links.T)


def test_point_differs_by_the_mean_of_squared_distances() -> None:
    points = np.zeros((1, 3))
    # Mean distance 0.1, but mean square 0.0125: PCL's squared distances make the farther one count more.
    assert lacks_neighbours(points, np.array([[0.05, 0, 0], [0.15, 0, 0]]), 2, 0.1).tolist() == [True]
    assert lacks_neighbours(points, np.array([[0.05, 0, 0], [0.12, 0, 0]]), 2, 0.1).tolist() == [False]


def test_everything_differs_from_an_empty_map_and_one_point_is_enough_to_compare() -> None:
    points = np.array([[0.0, 0, 0], [1.0, 0, 0]])
    assert lacks_neighbours(points, np.zeros((0, 3)), 2, 0.1).tolist() == [True, True]
    assert lacks_neighbours(points, np.array([[1.02, 0, 0]]), 2, 0.1).tolist() == [True, False]


@pytest.mark.parametrize(("voxel_m", "distance_m"), [(0.02, 0.1), (0.05, 0.1), (0.08, 0.16)])
def test_distance_grows_with_voxels_coarser_than_the_published(voxel_m: float, distance_m: float) -> None:
    assert knn_distance_m(BaselineSettings(), voxel_m) == pytest.approx(distance_m)


def test_weak_negative_and_unseen_differences_are_not_judged() -> None:
    flags = np.array([[0, 0, 0], [1, 1, 1], [1, 0, 1], [1, 1, 0]], bool)
    differences = Differences(flags[:, 0], flags[:, 1], flags[:, 2])
    assert judged(differences, 0).tolist() == [SAME, CHANGED, UNJUDGED, UNJUDGED]
    assert judged(differences, 1).tolist() == [SAME, CHANGED, CHANGED, UNJUDGED]


def test_connected_differences_are_clusters_and_specks_share_one_number_per_code() -> None:
    codes = [1, 1, 1, 0, 1, 0, 2, 2, 2, 1, 0, 1]
    numbers = clusters(chain(codes), np.array(codes), 3)
    assert numbers[0] == numbers[1] == numbers[2] > 2
    assert numbers[6] == numbers[7] == numbers[8] > 2
    assert numbers[0] != numbers[6]
    assert numbers[[4, 9, 11]].tolist() == [1, 1, 1]
    assert numbers[[3, 5, 10]].tolist() == [0, 0, 0]


def test_same_map_twice_has_no_differences(hall: tuple[SessionGeometry, SessionGeometry]) -> None:
    for of_visit in find_differences(hall[0], hall[0], Settings()):
        assert of_visit.is_different.mean() < 0.01  # the second neighbour of a lone point is far


def inside(geometry: SessionGeometry, low: tuple[float, ...], high: tuple[float, ...]) -> np.ndarray:
    points = geometry.surface.points_world
    return ((points > np.array(low)) & (points < np.array(high))).all(axis=1)


def test_crate_that_left_the_hall_is_a_strong_negative_difference(
    hall: tuple[SessionGeometry, SessionGeometry],
) -> None:
    negative, positive = find_differences(*hall, Settings())
    gone = inside(hall[0], (3.4, 1.05, 0.15), (4.0, 1.55, 0.6))
    new = inside(hall[1], (2.15, 1.95, 0.15), (2.65, 2.45, 1.3))
    assert gone.sum() > 50
    assert new.sum() > 50
    assert negative.is_strong[gone].mean() > 0.8
    assert positive.is_different[new].mean() > 0.8
    assert not positive.is_strong[new].all()  # it stands where the previous visit saw free space
    kept = inside(hall[0], (1.25, 1.3, 0.0), (1.95, 1.9, 0.6))
    assert negative.is_different[kept].mean() < 0.25  # one side of it was seen by one visit only
