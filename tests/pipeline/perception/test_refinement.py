"""Change cuts objects out of segments, or completes them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.perception.embedded.refinement import refine_by_change
from pipeline.settings import DiscoverySettings


def refine(surface, segments, changed, proof=1.0, evident=None, **settings):
    """Refined segments where every changed voxel is evident and proves as much as ``proof``."""
    evident = changed if evident is None else evident
    return refine_by_change(
        surface, segments, changed, evident, changed * proof, DiscoverySettings(**settings)
    )


@pytest.fixture
def strip(make_surface):
    """A strip of 200 x 5 voxels; voxel i of the surface stands at column ``column[i]``."""
    x, y = np.meshgrid(np.arange(200), np.arange(5), indexing="ij")
    points = (np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1) + 0.5) * 0.02
    surface, _ = make_surface(points, np.tile([0.0, 0.0, 1.0], (1000, 1)), 0.02)
    return surface, np.floor(surface.points_world[:, 0] / 0.02 + 1e-3).astype(int)


def test_nothing_changed_changes_nothing(strip):
    surface, column = strip
    segments = (column // 50).astype(np.int32)
    refined = refine(surface, segments, np.zeros(1000, bool))
    assert refined.dtype == np.int32
    assert np.array_equal(refined, segments)


def test_a_mostly_changed_segment_stays_whole(strip):
    surface, column = strip
    segments = np.where((column >= 20) & (column < 60), 1, 0)
    changed = (column >= 20) & (column < 55)
    assert np.array_equal(refine(surface, segments, changed), segments)


def test_a_fair_unchanged_part_of_a_mostly_changed_segment_is_parted(strip):
    surface, column = strip
    segments = np.where((column >= 20) & (column < 60), 1, 0)
    changed = (column >= 20) & (column < 50)
    expected = np.where((column >= 50) & (column < 60), 2, segments)
    assert np.array_equal(refine(surface, segments, changed), expected)


def test_regions_of_little_proof_are_left_alone(strip):
    surface, column = strip
    segments = np.where(column < 100, 1, 0)
    changed = (column >= 40) & (column < 60)
    assert np.array_equal(refine(surface, segments, changed, proof=0.14), segments)
    assert refine(surface, segments, changed, proof=0.16).max() == 2


def test_only_what_is_evident_is_cut_out(strip):
    surface, column = strip
    segments = np.where(column < 100, 1, 0)
    changed = (column >= 40) & (column < 60)
    evident = (column >= 45) & (column < 60)
    refined = refine(surface, segments, changed, evident=evident)
    assert np.array_equal(refined, np.where(evident, 2, segments))


def test_a_changed_part_of_a_segment_becomes_an_object(strip):
    surface, column = strip
    segments = np.where(column < 100, 1, 0)
    changed = (column >= 40) & (column < 60)
    refined = refine(surface, segments, changed)
    assert np.array_equal(refined, np.where(changed, 2, segments))


def test_changed_background_becomes_objects_one_per_region(strip):
    surface, column = strip
    segments = np.zeros(1000, int)
    first, second = (column >= 10) & (column < 20), (column >= 30) & (column < 45)
    refined = refine(surface, segments, first | second)
    assert np.array_equal(refined, np.where(first, 1, np.where(second, 2, 0)))


def test_regions_link_over_one_missing_voxel_but_not_over_two(strip):
    surface, column = strip
    one_missing = ((column >= 10) & (column < 30)) & (column != 20)
    assert refine(surface, np.zeros(1000, int), one_missing).max() == 1
    two_missing = one_missing & (column != 21)
    assert refine(surface, np.zeros(1000, int), two_missing).max() == 2


def test_a_region_too_small_is_left_alone(strip):
    surface, column = strip
    changed = (column >= 10) & (column < 15)
    assert changed.sum() == 25
    assert refine(surface, np.zeros(1000, int), changed).max() == 0
    assert refine(surface, np.zeros(1000, int), changed, change_region_voxels=25).max() == 1


def test_a_region_beside_a_mostly_changed_segment_rejoins_it(strip):
    surface, column = strip
    segments = np.where((column >= 20) & (column < 60), 1, 0)
    changed = (column >= 20) & (column < 66)
    refined = refine(surface, segments, changed)
    assert np.array_equal(refined, np.where(changed, 1, 0))


def test_a_region_much_larger_than_its_neighbour_is_an_object_of_its_own(strip):
    surface, column = strip
    segments = np.where((column >= 20) & (column < 30), 1, 0)
    changed = (column >= 20) & (column < 80)
    refined = refine(surface, segments, changed)
    assert np.array_equal(refined, np.where((column >= 30) & changed, 2, segments))


def test_empty_surface(make_surface):
    surface, _ = make_surface(np.zeros((0, 3)), np.zeros((0, 3)), 0.02)
    assert refine(surface, np.zeros(0, int), np.zeros(0, bool)).shape == (0,)
