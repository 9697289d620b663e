"""Stage "observe": what each visit saw of the other's surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.change.observation import Observation, glimpses
from pipeline.mapping.front_end import SessionGeometry
from pipeline.settings import Settings


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
    """Let every keyframe of either visit look at both surfaces."""
    done = 0

    def look(observed: SessionGeometry, observer: SessionGeometry) -> Observation:
        nonlocal done
        observation = Observation(len(observed.surface.points_world))
        for seen in glimpses(observed, observer, settings.observation, settings.image.max_depth_m):
            observation.add(seen)
            done += 1
            on_keyframe(done)
        return observation

    is_noise = [look(visit, visit).is_contradicted(settings.observation) for visit in (previous, current)]
    of_current = look(current, previous)
    voxel_count = len(previous.surface.points_world)
    of_previous, submap_view = Observation(voxel_count), Observation(voxel_count)
    by_submap: list[dict[str, NDArray[np.generic]]] = []
    views = glimpses(previous, current, settings.observation, settings.image.max_depth_m)
    for k, seen in enumerate(views):
        submap_view.add(seen)
        done += 1
        on_keyframe(done)
        is_last = k + 1 == len(current.keyframes)
        if is_last or current.keyframes[k + 1].submap != current.keyframes[k].submap:
            sparse = submap_view.to_sparse()
            of_previous.add_sparse(sparse)
            by_submap.append(sparse)
            submap_view = Observation(voxel_count)
    return MutualObservation(of_current, of_previous, is_noise[0], is_noise[1], tuple(by_submap))
