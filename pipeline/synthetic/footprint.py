"""Whether things that stand somewhere would cut into each other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.synthetic.shapes import Mesh


@dataclass(frozen=True)
class Footprint:
    """An upright box: the bounds of a mesh, turned about the vertical and shifted.

    Attributes:
        corners: (4, 2) world x and y, metres, in order around.
        low_m: least height.
        high_m: greatest height.
    """

    corners: NDArray[np.float64]
    low_m: float
    high_m: float

    def overlaps(self, other: Footprint, slack_m: float = 0.0) -> bool:
        """Whether two boxes share more than ``slack_m`` of depth in every direction."""
        if min(self.high_m, other.high_m) - max(self.low_m, other.low_m) <= 0.005:
            return False
        for one in (self, other):
            for edge in (one.corners[1] - one.corners[0], one.corners[2] - one.corners[1]):
                axis = np.array([-edge[1], edge[0]]) / max(float(np.hypot(*edge)), 1e-9)
                mine, theirs = self.corners @ axis, other.corners @ axis
                if min(mine.max(), theirs.max()) - max(mine.min(), theirs.min()) <= slack_m:
                    return False
        return True


@dataclass(frozen=True)
class Area:
    """A rectangle to stand in, centred on the origin of its frame.

    Attributes:
        T_world_area: (4, 4), z up.
        half_width_m: along x.
        half_depth_m: along y.
    """

    T_world_area: NDArray[np.float64]
    half_width_m: float
    half_depth_m: float

    def contains(self, footprint: Footprint, slack_m: float = 0.0) -> bool:
        """Whether the box stands wholly within, but for ``slack_m``."""
        local = (footprint.corners - self.T_world_area[:2, 3]) @ self.T_world_area[:2, :2]
        reach = np.abs(local).max(axis=0)
        return bool((reach <= [self.half_width_m + slack_m, self.half_depth_m + slack_m]).all())


def footprint(mesh: Mesh, T_world_object: NDArray[np.float64], scale: float = 1.0) -> Footprint:
    """The box of a mesh at an upright pose; ``scale`` shrinks it sideways (crowns, awnings)."""
    (x0, y0, z0), (x1, y1, z1) = mesh.bounds.astype(np.float64)
    square = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) * scale
    corners = square @ T_world_object[:2, :2].T + T_world_object[:2, 3]
    height = float(T_world_object[2, 3])
    return Footprint(corners, z0 + height, z1 + height)


def is_free(box: Footprint, others: Iterable[Footprint], slack_m: float) -> bool:
    """Whether none of the others is cut into by more than ``slack_m``."""
    return not any(box.overlaps(other, slack_m) for other in others)
