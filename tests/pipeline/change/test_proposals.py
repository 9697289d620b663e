"""Changes are proposed where the other visit saw through a surface or saw other colours, up to its edges."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.spatial import cKDTree

from pipeline.change.observation import Observation
from pipeline.change.proposals import propose_changes
from pipeline.mapping.surface import FusedSurface
from pipeline.settings import ObservationSettings, ProposalSettings

WIDTH, DEPTH, VOXEL_M = 200, 20, 0.02
COUNT = WIDTH * DEPTH


@pytest.fixture
def floor():
    """A flat grid of voxels; from column 100 on its colour is another. Gives the visit and the columns."""
    column, row = np.divmod(np.arange(COUNT), DEPTH)
    points = np.stack([column, row, np.zeros(COUNT)], 1) * VOXEL_M
    pairs = cKDTree(points).query_pairs(1.9 * VOXEL_M, output_type="ndarray")
    ends = np.r_[pairs, pairs[:, ::-1]].T
    lab = np.zeros((COUNT, 3), np.float32)
    lab[:, 0] = np.where(column < 100, 40, 80)
    surface = FusedSurface(
        voxel_size_m=VOXEL_M,
        points_world=points.astype(np.float32),
        normals_world=np.tile(np.float32([0, 0, 1]), (COUNT, 1)),
        lab=lab,
        sample_count=np.full(COUNT, 9, np.int32),
        neighbours=coo_matrix((np.ones(ends.shape[1], np.float32), ends), shape=(COUNT, COUNT)).tocsr(),
        up_world=np.array([0.0, 0, 1]),
        camera_positions_world=np.zeros((1, 3)),
    )
    log_colours = np.random.default_rng(0).normal(4.0, 0.01, (COUNT, 3)).astype(np.float32)
    return SimpleNamespace(surface=surface, log_colours=log_colours), column


def seen_by_other(through: np.ndarray, hit: np.ndarray, log_colours: np.ndarray) -> Observation:
    seen = Observation(COUNT)
    coloured = np.flatnonzero(hit)
    seen.add_sparse(
        {
            "voxels": np.arange(COUNT),
            "free_count": np.where(through, 5, 0).astype(np.uint16),
            "hit_count": np.where(hit, 5, 0).astype(np.uint16),
            "colour_sum": np.where(hit[:, None], log_colours, 0),
            "colour_count": np.isin(np.arange(COUNT), coloured).astype(np.uint16),
        }
    )
    return seen


def propose(visit, seen, noise=None):
    noise = np.zeros(COUNT, bool) if noise is None else noise
    return propose_changes(visit, seen, noise, ObservationSettings(), ProposalSettings())


def test_nothing_is_proposed_where_everything_is_found_again(floor):
    visit, _ = floor
    everywhere = np.ones(COUNT, bool)
    proposals = propose(visit, seen_by_other(~everywhere, everywhere, visit.log_colours))
    assert not proposals.is_changed.any()


def test_what_was_seen_through_is_proof_unless_it_is_noise(floor):
    visit, column = floor
    through = (column >= 40) & (column < 60)
    seen = seen_by_other(through, ~through, visit.log_colours)
    proposals = propose(visit, seen)
    assert np.array_equal(proposals.is_evident, through)
    assert np.array_equal(proposals.proof >= 1, through)
    assert propose(visit, seen, noise=through).proof.max() < 1


def test_a_tint_that_is_rare_is_unlike_and_light_that_changed_everywhere_is_not(floor):
    visit, column = floor
    everywhere = np.ones(COUNT, bool)
    row = np.arange(COUNT) % DEPTH
    tinted = (column >= 50) & (column < 55) & (row >= 8) & (row < 13)
    visit.surface.lab[tinted, 0] = 90  # a sign on the floor, of another colour than around it
    colours = visit.log_colours - np.float32([0.3, 0.3, 0.3])
    colours[tinted] += np.float32([0.5, -0.2, 0.0])
    proposals = propose(visit, seen_by_other(~everywhere, everywhere, colours))
    assert proposals.is_changed[tinted].all()
    assert not proposals.is_changed[(column < 48) | (column > 56)].any()
    assert 0 < proposals.proof[tinted].min() <= proposals.proof[tinted].max() < 1


def test_changes_spread_over_the_unseen_up_to_an_edge_of_colour(floor):
    visit, column = floor
    through, unseen = (column >= 90) & (column < 96), (column >= 96) & (column < 105)
    proposals = propose(visit, seen_by_other(through, ~through & ~unseen, visit.log_colours))
    assert proposals.is_changed[(column >= 90) & (column < 100)].all()
    assert not proposals.is_changed[column >= 101].any()
