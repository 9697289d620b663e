"""Compare the fine patterns of all keyframes with those of the best co-visible ones of the other visit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from pipeline.correspondence.compare import Covisibility, VisitImages
from pipeline.correspondence.pattern import PatternAgreement, compare_pattern
from pipeline.settings import PatternSettings

_THREADS = 2


def compare_patterns(
    previous: VisitImages, current: VisitImages, covisibility: Covisibility, settings: PatternSettings
) -> tuple[list[PatternAgreement], list[PatternAgreement]]:
    """Agreement of the previous and of the current objects, by submaps of the current visit."""
    visits = (previous, current)
    covisible = (covisibility.of_previous, covisibility.of_current)
    submaps = range(current.geometry.submap_count)
    sums = [[PatternAgreement.empty(visit.objects.count) for _ in submaps] for visit in visits]

    def compare(job: tuple[int, int]) -> list[tuple[int, PatternAgreement]]:
        visit, k = job
        own, other = visits[visit], visits[1 - visit]
        instances = own.objects.mask(own.geometry, k)
        found = []
        for pair in covisible[visit][k][: settings.pairs_per_keyframe]:
            in_current = k if visit == 1 else pair.other_keyframe
            agreement = compare_pattern(
                own.geometry, k, other.geometry, pair.other_keyframe, instances, own.objects.count, settings
            )
            found.append((current.geometry.keyframes[in_current].submap, agreement))
        return found

    jobs = [(visit, k) for visit in range(2) for k in range(len(visits[visit].geometry.keyframes))]
    with ThreadPoolExecutor(_THREADS) as threads:
        # In the order of the jobs, whichever was done first: sums of floats depend on it.
        for (visit, _), outcome in zip(jobs, threads.map(compare, jobs), strict=True):
            for submap, agreement in outcome:
                sums[visit][submap].add(agreement)
    return sums[0], sums[1]
