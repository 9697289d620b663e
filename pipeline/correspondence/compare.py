"""Stage "compare": co-visible keyframes are matched patch by patch (paper, Sec. III-C.1).

Every pair is matched once and serves both visits: links, heatmaps of either keyframe, and the evidence of
the submap of the current keyframe.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from pipeline.association.aggregation import MatchEvidence, PatchShares, patch_owners, patch_shares
from pipeline.correspondence.covisibility import CovisibilityIndex, PatchView, patch_view, patch_warp
from pipeline.correspondence.heatmaps import geometric_heatmap, semantic_heatmap
from pipeline.correspondence.matching import best_of_both, match, nearby
from pipeline.correspondence.place_similarity import PlaceSimilarity
from pipeline.errors import SceneMismatchError
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects
from pipeline.perception.protocols import FeatureExtractor
from pipeline.result import CovisiblePair, PatchLinks
from pipeline.settings import CorrespondenceSettings, Settings

GEOMETRIC_HEATMAP_STRIDE = 4

COMPARING_THREADS = 2
# Outcomes wait in order; a few at once keep memory small.
_PAIRS_AT_ONCE = 16


@dataclass(frozen=True)
class _PairOutcome:
    """What comparing one pair of keyframes gave; see ``DenseMatches`` and ``Nearby``.

    ``relit0`` and ``relit1`` are those of the heatmaps, after ``FeatureExtractor.relit``.
    """

    links: PatchLinks
    correspondences: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]
    nearby0: NDArray[np.float32]
    nearby1: NDArray[np.float32]
    relit0: NDArray[np.float32]
    relit1: NDArray[np.float32]
    light: NDArray[np.float64]


@dataclass(frozen=True)
class VisitImages:
    """One visit as the comparison needs it.

    Attributes:
        geometry: its front-end output.
        objects: its object map.
        features: stored feature map of a keyframe.
        image: stored image of a keyframe, (H, W, 3) RGB at processing size.
    """

    geometry: SessionGeometry
    objects: SessionObjects
    features: Callable[[int], NDArray[np.float16]]
    image: Callable[[int], NDArray[np.uint8]]


@dataclass(frozen=True)
class Covisibility:
    """Which keyframes see the same place.

    Attributes:
        of_previous, of_current: best co-visible keyframes of the other visit, for each keyframe.
        views0, views1: the keyframes on their patch grids.
    """

    of_previous: tuple[tuple[CovisiblePair, ...], ...]
    of_current: tuple[tuple[CovisiblePair, ...], ...]
    views0: list[PatchView]
    views1: list[PatchView]

    def pairs(self) -> list[tuple[int, int]]:
        """All (previous, current) pairs to compare, in the order of the current visit."""
        forward = {(pair.other_keyframe, k) for k, found in enumerate(self.of_current) for pair in found}
        backward = {(k, pair.other_keyframe) for k, found in enumerate(self.of_previous) for pair in found}
        return sorted(forward | backward, key=lambda pair: (pair[1], pair[0]))


def find_covisible(
    previous: SessionGeometry,
    current: SessionGeometry,
    grids: tuple[tuple[int, int], tuple[int, int]],
    settings: CorrespondenceSettings,
) -> Covisibility:
    """Co-visible keyframes of two visits.

    Raises:
        SceneMismatchError: no keyframe of one visit sees anything that the other one saw.
    """
    views0 = [patch_view(previous, k, grids[0]) for k in range(len(previous.keyframes))]
    views1 = [patch_view(current, k, grids[1]) for k in range(len(current.keyframes))]
    index0, index1 = CovisibilityIndex(views0), CovisibilityIndex(views1)
    of_current = tuple(index0.best(view, settings) for view in views1)
    of_previous = tuple(index1.best(view, settings) for view in views0)
    if not any(of_current) and not any(of_previous):
        raise SceneMismatchError(
            "the two sessions never look at the same place",
            "check that they show one site and that their poses share one world frame",
        )
    return Covisibility(of_previous, of_current, views0, views1)


@dataclass(frozen=True)
class Comparison:
    """What comparing all pairs gave.

    Attributes:
        evidence: (submaps of the current visit) match evidence of each.
        similarity0, similarity1: (submaps) how alike the places of the previous, current objects look.
        light: mean lighting difference of the visits, as the extractor gives it; None without any.
    """

    evidence: tuple[MatchEvidence, ...]
    similarity0: tuple[PlaceSimilarity, ...]
    similarity1: tuple[PlaceSimilarity, ...]
    light: NDArray[np.float64] | None


def compare(
    previous: VisitImages,
    current: VisitImages,
    covisibility: Covisibility,
    extractor: FeatureExtractor,
    settings: Settings,
    *,
    write_links: Callable[[int, int, PatchLinks], None],
    write_heatmaps: Callable[[int, int, NDArray[np.float32], NDArray[np.float32]], None],
    on_step: Callable[[int, int], None],
) -> Comparison:
    """Match all co-visible pairs and draw the heatmaps of both visits.

    Args:
        previous, current: the visits.
        covisibility: which keyframes to compare.
        extractor: made the features.
        write_links: takes (previous keyframe, current keyframe, links).
        write_heatmaps: takes (visit, keyframe, semantic, geometric).
        on_step: takes steps done and steps in all.
    """
    radius = settings.correspondence.search_radius_patches
    pairs = covisibility.pairs()
    best = (_BestSimilarity(covisibility.views0), _BestSimilarity(covisibility.views1))
    shown = (_ShownObjects(previous), _ShownObjects(current))
    counts = (previous.objects.count, current.objects.count)
    submaps = range(current.geometry.submap_count)
    evidence = [MatchEvidence.empty(*counts) for _ in submaps]
    similarity = [[PlaceSimilarity.empty(count) for _ in submaps] for count in counts]
    lights = []
    steps = len(pairs) + len(previous.geometry.keyframes) + len(current.geometry.keyframes)

    def compare_pair(pair: tuple[int, int]) -> _PairOutcome:
        k0, k1 = pair
        view0, view1 = covisibility.views0[k0], covisibility.views1[k1]
        stored0, stored1 = previous.features(k0), current.features(k1)
        into_previous = patch_warp(view1, view0)
        light = extractor.light(stored0, stored1, into_previous)
        matches = match(*extractor.comparable(stored0, stored1, light))
        shape0 = (stored0.shape[0], stored0.shape[1])
        shape1 = (stored1.shape[0], stored1.shape[1])
        nearby0 = nearby(patch_warp(view0, view1), shape1, radius)
        nearby1 = nearby(into_previous, shape0, radius)
        relit0, relit1 = best_of_both(*extractor.relit(stored0, stored1, into_previous), nearby0, nearby1)
        return _PairOutcome(
            links=matches.links(shape0, shape1),
            correspondences=matches.correspondences(),
            nearby0=nearby0.best(matches.correlation),
            nearby1=nearby1.best(matches.correlation.T),
            relit0=relit0,
            relit1=relit1,
            light=light,
        )

    with ThreadPoolExecutor(COMPARING_THREADS) as threads:
        for begin in range(0, len(pairs), _PAIRS_AT_ONCE):
            some = pairs[begin : begin + _PAIRS_AT_ONCE]
            for (k0, k1), outcome in zip(some, threads.map(compare_pair, some), strict=True):
                write_links(k0, k1, outcome.links)
                (shares0, owners0), (shares1, owners1) = shown[0](k0), shown[1](k1)
                p, q, score = outcome.correspondences
                submap = current.geometry.keyframes[k1].submap
                evidence[submap].add(owners0[p], owners1[q], score)
                best[0].add(k0, outcome.relit0)
                best[1].add(k1, outcome.relit1)
                for visit, (similar, shares) in enumerate(
                    ((outcome.nearby0, shares0), (outcome.nearby1, shares1))
                ):
                    similarity[visit][submap].add(shares, similar.reshape(-1))
                lights.append(outcome.light)
            on_step(begin + len(some), steps)
    covisible = (covisibility.of_previous, covisibility.of_current)
    visits, numbers, lock = (previous, current), count(len(pairs) + 1), Lock()

    def draw_heatmaps(visit: int) -> None:
        own, other = visits[visit].geometry, visits[1 - visit].geometry
        for k in range(len(own.keyframes)):
            semantic = semantic_heatmap(
                best[visit].of(k), extractor.similarity, settings.correspondence.heatmap_sigma_patches
            )
            write_heatmaps(visit, k, semantic, _geometric(own, other, k, covisible[visit][k], visit == 1))
            with lock:
                on_step(next(numbers), steps)
        # The surfaces of the other visit were needed for this only.
        other.submaps.forget()

    with ThreadPoolExecutor(COMPARING_THREADS) as threads:
        list(threads.map(draw_heatmaps, range(2)))
    mean_light = np.mean(lights, axis=0) if lights and lights[0].size else None
    return Comparison(tuple(evidence), tuple(similarity[0]), tuple(similarity[1]), mean_light)


def _geometric(
    own: SessionGeometry,
    other: SessionGeometry,
    k: int,
    covisible: tuple[CovisiblePair, ...],
    own_is_current: bool,
) -> NDArray[np.float32]:
    step = max(1, GEOMETRIC_HEATMAP_STRIDE // own.stride)
    depth = own.store.depth(k)[::step, ::step]
    camera = own.strided_camera(k).strided(step)
    submaps = tuple(sorted({other.keyframes[pair.other_keyframe].submap for pair in covisible}))
    other_depth = other.submaps.render_depth(submaps, camera, own.keyframes[k].T_world_camera)
    return geometric_heatmap(depth, other_depth, own_is_current)


class _BestSimilarity:
    """The best correlation of each patch over all keyframes it was compared with."""

    def __init__(self, views: list[PatchView]) -> None:
        self._best = [np.full(view.depth.shape, np.nan, np.float32) for view in views]

    def add(self, k: int, similarity: NDArray[np.float32]) -> None:
        self._best[k] = np.fmax(self._best[k], similarity)

    def of(self, k: int) -> NDArray[np.float32]:
        return self._best[k]


class _ShownObjects:
    """Objects shown by the patches of keyframes; recent ones are remembered, as pairs come in order."""

    _REMEMBERED = 64

    def __init__(self, visit: VisitImages) -> None:
        self._visit = visit
        self._known: dict[int, tuple[PatchShares, NDArray[np.int32]]] = {}

    def __call__(self, k: int) -> tuple[PatchShares, NDArray[np.int32]]:
        """Shares of all objects in all patches, and the owner of each patch."""
        if k not in self._known:
            if len(self._known) >= self._REMEMBERED:
                self._known.pop(next(iter(self._known)))
            rows, columns = self._visit.features(k).shape[:2]
            shares = patch_shares(self._visit.objects.mask(self._visit.geometry, k), (rows, columns))
            self._known[k] = (shares, patch_owners(shares, rows * columns))
        return self._known[k]
