"""Stage "observe": what each visit saw of the other's surface."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from pipeline.change.observation import Glimpse, Observation, glimpses
from pipeline.mapping.front_end import SessionGeometry
from pipeline.settings import Settings

VIEWING_THREADS = 2


@dataclass(frozen=True)
class MutualObservation:
    """Observations of both surfaces.

    Attributes:
        of_current: the current surface, seen by the whole previous visit.
        of_previous: the previous surface, seen by the whole current visit.
        is_noise0, is_noise1: voxels of the previous, current surface that their own visit sees through:
            flying pixels and the rims of depth edges, which would look vacated in any other visit.
        by_submap: (submaps of the current visit) what each submap alone saw of the previous surface, as
            sparse arrays: they are replayed to say what was believed when.
    """

    of_current: Observation
    of_previous: Observation
    is_noise0: NDArray[np.bool_]
    is_noise1: NDArray[np.bool_]
    by_submap: tuple[dict[str, NDArray[np.generic]], ...]


def observe(
    previous: SessionGeometry,
    current: SessionGeometry,
    settings: Settings,
    on_keyframe: Callable[[int], None],
) -> MutualObservation:
    """Let every keyframe of either visit look at both surfaces; the four views are independent threads."""
    numbers, lock = count(1), Lock()

    def views(observed: SessionGeometry, observer: SessionGeometry) -> Iterator[Glimpse]:
        for seen in glimpses(observed, observer, settings.observation, settings.image.max_depth_m):
            yield seen
            with lock:
                on_keyframe(next(numbers))

    def look(observed: SessionGeometry, observer: SessionGeometry) -> Observation:
        observation = Observation(len(observed.surface.points_world))
        for seen in views(observed, observer):
            observation.add(seen)
        return observation

    def look_by_submap() -> tuple[dict[str, NDArray[np.generic]], ...]:
        voxel_count = len(previous.surface.points_world)
        submap_view = Observation(voxel_count)
        by_submap = []
        for k, seen in enumerate(views(previous, current)):
            submap_view.add(seen)
            is_last = k + 1 == len(current.keyframes)
            if is_last or current.keyframes[k + 1].submap != current.keyframes[k].submap:
                by_submap.append(submap_view.to_sparse())
                submap_view = Observation(voxel_count)
        return tuple(by_submap)

    with ThreadPoolExecutor(VIEWING_THREADS) as threads:
        own = [threads.submit(look, visit, visit) for visit in (previous, current)]
        of_current = threads.submit(look, current, previous)
        by_submap = threads.submit(look_by_submap)
    of_previous = Observation(len(previous.surface.points_world))
    for sparse in by_submap.result():
        of_previous.add_sparse(sparse)
    is_noise = [view.result().is_contradicted(settings.observation) for view in own]
    return MutualObservation(of_current.result(), of_previous, is_noise[0], is_noise[1], by_submap.result())
