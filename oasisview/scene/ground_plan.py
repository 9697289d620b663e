"""The place from above: level axes that world points are laid out on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from oasisview.scene.viewpoints import horizontal_axes
from pipeline.result import Result

LEVEL_COSINE = np.cos(np.radians(15))  # robots' z axes lean that much at most: then x and y are kept


@dataclass(frozen=True)
class GroundPlan:
    """Two level axes and one against gravity.

    Attributes:
        axes_world: (3, 3) rows east-like, north-like, up; right-handed unit vectors of the world frame.
        names: what the three axes are in terms of the world frame.
    """

    axes_world: NDArray[np.float64]
    names: tuple[str, str, str]

    @classmethod
    def of(cls, result: Result) -> GroundPlan:
        """World x and y where the world's z axis stands about upright, else level axes of our own."""
        up = np.asarray(result.sessions[-1].up_world, np.float64)
        if up[2] >= LEVEL_COSINE:
            return cls(np.eye(3), ("world x", "world y", "world z"))
        return cls(np.stack([*horizontal_axes(up), up]), ("level u", "level v", "up"))

    @property
    def is_world(self) -> bool:
        """Whether the plan's axes are those of the world frame."""
        return bool(np.array_equal(self.axes_world, np.eye(3)))

    def project(self, points_world: NDArray[np.floating]) -> NDArray[np.float64]:
        """(N, 3) or (3,) world points along the plan's axes, metres; the last column is height."""
        return np.asarray(points_world, np.float64) @ self.axes_world.T
