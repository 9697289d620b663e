"""Where the print of each object was found again: at its place, or elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.association.keypoint_registration import (
    KeypointRegistration,
    print_places,
    register_by_keypoints,
)
from pipeline.association.object_keypoints import ObjectKeypoints, no_keypoints, object_keypoints
from pipeline.correspondence.compare import VisitImages
from pipeline.settings import Settings

_IMAGES_KEPT = 24


@dataclass(frozen=True)
class PrintSupport:
    """Greatest support (``KeypointRegistration``) that each object of a visit has, (K + 1,) each.

    Attributes:
        here: by the motion that leaves it where it was.
        elsewhere: by a motion that carries it away.
    """

    here: NDArray[np.float64]
    elsewhere: NDArray[np.float64]


@dataclass(frozen=True)
class Prints:
    """What carries the same print.

    Attributes:
        registrations: by previous and current instance, counted from 1.
        counts: K of either visit.
        places: of every instance of either visit, (p, 3) where it has keypoints; entry 0 is background.
        is_still: by the same keys, whether the print stayed where it was.
    """

    registrations: Mapping[tuple[int, int], KeypointRegistration]
    is_still: Mapping[tuple[int, int], bool]
    counts: tuple[int, int]
    places: tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]

    def support(self, is_met: NDArray[np.bool_]) -> tuple[PrintSupport, PrintSupport]:
        """Of the objects of both visits, by the current objects that have been met, (K1 + 1,)."""
        sums = [PrintSupport(np.zeros(count + 1), np.zeros(count + 1)) for count in self.counts]
        for pair, found in self.registrations.items():
            if is_met[pair[1]]:
                for of_visit, instance in zip(sums, pair, strict=True):
                    support = of_visit.here if self.is_still[pair] else of_visit.elsewhere
                    support[instance] = max(support[instance], found.support)
        return sums[0], sums[1]


def find_prints(previous: VisitImages, current: VisitImages, spacing_m: float, settings: Settings) -> Prints:
    """Compare the prints of all objects of two visits.

    Args:
        spacing_m: distance of neighbouring points of the objects' clouds.
    """
    keypoints = [_keypoints_of(visit) for visit in (previous, current)]
    registrations = register_by_keypoints(keypoints[0], keypoints[1], spacing_m)
    limits = (settings.change.tau_d_m, settings.moves.min_rotation_deg)
    is_still = {pair: found.is_still(*limits) for pair, found in registrations.items()}
    places = [[print_places(of_object, spacing_m) for of_object in of_visit] for of_visit in keypoints]
    counts = (previous.objects.count, current.objects.count)
    return Prints(registrations, is_still, counts, (places[0], places[1]))


def _keypoints_of(visit: VisitImages) -> list[ObjectKeypoints]:
    """By instance, background first."""
    # Neighbouring objects are seen by the same keyframes: each image is decoded once for all of them.
    image = lru_cache(_IMAGES_KEPT)(visit.image)
    instances = range(1, visit.objects.count + 1)
    found = [object_keypoints(visit.geometry, visit.objects, image, instance) for instance in instances]
    return [no_keypoints(), *found]
