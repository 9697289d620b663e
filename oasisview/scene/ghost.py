"""The other visit as a ghost in the map: its objects, thinned out and paled, so that the visit shown is seen
through them. Viser draws point clouds opaque; a loose veil of points stands for translucence."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from oasisview.scene.map_points import GROUND_RGB, VisitPoints

NODE = "/map/ghost"
STRIDE = 4
_PALED = 0.45
_SIZE = 0.8


class Ghost:
    """At most one veil of points in a tab.

    Args:
        scene: of the client; point_size_m: of the map.
    """

    def __init__(self, scene: viser.SceneApi, point_size_m: float) -> None:
        self._scene = scene
        self._point_size_m = point_size_m
        self._shown: VisitPoints | None = None

    def forget(self) -> None:
        """Colours or points changed: what is drawn next is sent anew."""
        self._shown = None

    def show(self, points: VisitPoints | None, colours: NDArray[np.uint8] | None, *, dark: bool) -> None:
        """Draw a visit's objects in (N, 3) colours, or nothing; free if that is drawn already."""
        if points is None or colours is None or not len(points.objects):
            self._shown = None
            handle = self._scene.get_handle_by_name(NODE)
            if handle is not None:
                handle.remove()
            return
        if self._shown is points:
            return
        self._shown = points
        self._scene.add_point_cloud(
            NODE,
            points.objects[::STRIDE],
            paled(colours[::STRIDE], dark=dark),
            point_size=_SIZE * self._point_size_m,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )


def paled(colours: NDArray[np.uint8], *, dark: bool) -> NDArray[np.uint8]:
    """Colours on their way to the ground of the page."""
    ground = np.array(GROUND_RGB[dark], np.float32)
    return np.round(colours * (1 - _PALED) + ground * _PALED).astype(np.uint8)
