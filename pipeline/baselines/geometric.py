"""``geometric``: differences of point maps, after LT-Mapper (Kim and Kim, ICRA 2022).

Taken from the publication and its code (LT-removert): each map is first cleaned of what its own scans see
through (highly dynamic points, range images of 0.4 deg, 0.1 m); a point differs when its two nearest points
of the other map are farther than 0.1 m (effective: PCL returns squared distances); negative differences
(previous map) are split by range images, in three rounds, into weak ones, which the current visit cannot see
for occlusion and which therefore stay in the map, and strong ones, to which weak ones within 1 m return;
positive differences (current map) are split in the same way.

What it cannot: it has no objects and no identity, so nothing is ever moved, and connected clusters of
differences stand where a result wants objects (specks share one entry per visit and label). Detection and
identity scores of this method mean nothing. It does not see changes that leave no trace in geometry.

Where it differs: visits share a world frame already, so LT-SLAM's alignment is left out; a LiDAR sees all
around, a camera does not, so differences in whose direction the other visit never looked are unknown here
and not changes; weak negative differences are unknown, as LT-Mapper keeps them without having seen them;
the 0.1 m grows with voxels coarser than 0.05 m; points are fused voxels, the same as for all methods.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pipeline.baselines.differences import Differences, find_differences
from pipeline.baselines.findings import Findings, outcome, undecided_until_the_end
from pipeline.baselines.instances import numbered
from pipeline.correspondence.compare import Comparison, VisitImages
from pipeline.mapping.objects import SessionObjects
from pipeline.mapping.surface import FusedSurface
from pipeline.methods import MappedVisits, Outcome
from pipeline.result import ChangeLabel

# Codes of ``judged``: what a point is.
SAME, CHANGED, UNJUDGED = 0, 1, 2


class GeometricMethod:
    """See the module's docstring."""

    name = "geometric"

    def __init__(self) -> None:
        self._found: tuple[MappedVisits, tuple[Differences, Differences]] | None = None

    def find_objects(self, mapped: MappedVisits) -> tuple[SessionObjects, SessionObjects]:
        """Connected clusters of differences."""
        smallest = mapped.settings.baseline.cluster_voxels
        found = [
            numbered(geometry, clusters(geometry.surface, judged(differences, visit), smallest))
            for visit, (geometry, differences) in enumerate(
                zip(mapped.geometries, self._differences(mapped), strict=True)
            )
        ]
        return found[0], found[1]

    def conclude(
        self,
        mapped: MappedVisits,
        visits: tuple[VisitImages, VisitImages],
        comparison: Comparison,
        on_submap: Callable[[int], None],
    ) -> Outcome:
        """Disappeared and appeared clusters; nothing is known before the current visit is over."""
        labels, confidences, evidence, collections = [], [], [], []
        codes = (ChangeLabel.DISAPPEARED, ChangeLabel.APPEARED)
        for visit, differences in enumerate(self._differences(mapped)):
            objects = visits[visit].objects
            owner, size = objects.instance_of_voxel, objects.count + 1
            code = np.zeros(size, np.int64)
            code[owner] = judged(differences, visit)
            strong = np.bincount(owner, differences.is_strong, size) / np.maximum(
                np.bincount(owner, minlength=size), 1
            )
            is_changed = code == CHANGED
            label = np.where(is_changed, int(codes[visit]), int(ChangeLabel.UNKNOWN))
            label[0] = ChangeLabel.STATIC
            labels.append(label)
            decisive = strong if visit == 0 else 1.0 - strong
            confidences.append(np.where(is_changed, 0.5 + 0.5 * decisive, 0.5))
            evidence.append({"strong_share": strong})
            collections.append(_collections(mapped.geometries[visit].surface, objects))
        on_submap(len(comparison.evidence))
        findings = Findings(
            identities=(),
            labels=(labels[0], labels[1]),
            confidences=(confidences[0], confidences[1]),
            beliefs=undecided_until_the_end(mapped, visits),
            evidence=(evidence[0], evidence[1]),
            collections=(collections[0], collections[1]),
        )
        return outcome(mapped, visits, comparison, findings)

    def _differences(self, mapped: MappedVisits) -> tuple[Differences, Differences]:
        if self._found is None or self._found[0] is not mapped:
            self._found = (mapped, find_differences(*mapped.geometries, mapped.settings))
        return self._found[1]


def judged(differences: Differences, visit: int) -> NDArray[np.int64]:
    """(M,) code of each point: strong negative and all positive differences changed, as far as the other
    visit looked in their direction at all; the other differences are unjudged."""
    changed = differences.is_different & differences.is_covered
    if visit == 0:
        changed &= differences.is_strong
    return np.where(changed, CHANGED, np.where(differences.is_different, UNJUDGED, SAME))


def clusters(surface: FusedSurface, codes: NDArray[np.integer], min_voxels: int) -> NDArray[np.int64]:
    """Connected points of one code; smaller ones share one number per code.

    Args:
        surface: of M voxels.
        codes: (M,) 0 = in no cluster.
        min_voxels: clusters from this size on have a number of their own.

    Returns:
        (M,) cluster numbers, 0 = none.
    """
    piece = _pieces(surface, codes)
    large = np.bincount(piece)[piece] >= min_voxels
    own = piece + 1 + int(codes.max(initial=0))
    return np.where(codes > 0, np.where(large, own, codes), 0)


def _pieces(surface: FusedSurface, codes: NDArray[np.integer]) -> NDArray[np.int64]:
    """(M,) number of the connected piece of equal code that each voxel belongs to."""
    rows, columns = surface.neighbours.nonzero()
    linked = (codes[rows] > 0) & (codes[rows] == codes[columns])
    links = coo_matrix(
        (np.ones(int(linked.sum()), np.int8), (rows[linked], columns[linked])), shape=surface.neighbours.shape
    )
    return np.asarray(connected_components(links, directed=False)[1], np.int64)


def _collections(surface: FusedSurface, objects: SessionObjects) -> frozenset[int]:
    """Instances of more than one piece: the shared entries of specks."""
    piece = _pieces(surface, objects.instance_of_voxel)
    first = np.full(objects.count + 1, len(piece), np.int64)
    last = np.full(objects.count + 1, -1, np.int64)
    np.minimum.at(first, objects.instance_of_voxel, piece)
    np.maximum.at(last, objects.instance_of_voxel, piece)
    return frozenset((np.flatnonzero(last[1:] > first[1:]) + 1).tolist())
