"""In which order objects are worth a person's look: how unsure the machine is, times what is at stake.

    priority = (1 - confidence) * size * (1 + coverage) / 2

- ``confidence`` in [0, 1] is the machine's chance that its label is right, so 1 - confidence is the chance
  that a look finds a mistake.
- ``size`` is the side of the cube that has the volume of the object's bounds, in metres (the larger visit's;
  sides below 1 cm count as 1 cm). The cube root keeps a car from outranking every cup whatever their doubt.
- ``coverage`` in [0, 1] is how much of the place the other visit looked at. A place that nobody looked at
  still counts by half: there the pictures can tell a person little more than they told the machine.

The unit is metres. A person's decision does not change it; decided objects are listed apart.
"""

from __future__ import annotations

import numpy as np

from pipeline.result import MapObject

LEAST_SIDE_M = 0.01


def size_m(item: MapObject) -> float:
    """Side of the cube of the same volume as the bounds of the larger sighting, metres."""
    volumes = [float(np.prod(np.maximum(s.extent_m, LEAST_SIDE_M))) for s in item.sightings]
    return max(volumes, default=LEAST_SIDE_M**3) ** (1 / 3)


def impact_m(item: MapObject) -> float:
    """What is at stake: size, weighed by how much of the place can be judged at all; metres."""
    return size_m(item) * (1.0 + item.coverage) / 2


def priority(item: MapObject) -> float:
    """How much a look at the object is worth; the larger, the sooner."""
    return (1.0 - item.confidence) * impact_m(item)
