"""What a click in the map means: the object, or the point, that is drawn under it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser
from numpy.typing import NDArray

from oasisview.catalogue import Catalogue
from oasisview.scene import outlines
from oasisview.scene.map_points import MapPoints
from oasisview.scene.picking import pick_object
from oasisview.scene.tape import point_on_ray

NEAR_M = 0.1  # of a box: the camera's near plane cuts into it
NO_SIZE = np.float32(1e-5)


@dataclass(frozen=True)
class Drawn:
    """The points that a tab shows now, (N, 3) around the map's origin, of all visits that it shows.

    ``object_ids`` belong to ``objects``.
    """

    objects: NDArray[np.float32]
    object_ids: NDArray[np.int32]
    background: NDArray[np.float32]
    ceiling: NDArray[np.float32]


@dataclass
class _Boxes:
    """Boxes of one visit: (N, 3) centres around the map's origin and sizes; which the camera is in."""

    handle: viser.BatchedMeshHandle
    ids: NDArray[np.int64]
    centres: NDArray[np.float64]
    scales: NDArray[np.float32]
    hidden: NDArray[np.bool_]


class MapClicks:
    """Finds objects and points under clicks; its searches run over all drawn points, so off the event loop.

    Args:
        scene: of the tab; catalogue, points: what there is to show.
        drawn: what is shown at the time of a click.
        on_object: called with an object id that was clicked.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        catalogue: Catalogue,
        points: MapPoints,
        drawn: Callable[[], Drawn],
        on_object: Callable[[int], None],
    ) -> None:
        self._scene = scene
        self._catalogue = catalogue
        self._origin = np.asarray(points.origin, np.float64)
        self._point_size_m = points.point_size_m
        self._drawn = drawn
        self._on_object = on_object
        self._boxes: dict[int, _Boxes] = {}

    def add_boxes(self, visit: int) -> None:
        """Invisible boxes that catch clicks; which object was meant is decided by the points."""
        found = [
            (item.object_id, sighting)
            for item in self._catalogue.objects.values()
            if (sighting := item.sighting(visit)) is not None
        ]
        if not found:
            return
        low = np.array([s.box_min_world_m for _, s in found]) - self._origin
        high = np.array([s.box_max_world_m for _, s in found]) - self._origin
        scales = (1.05 * (high - low) + 0.02).astype(np.float32)
        vertices, faces = outlines.box_mesh()
        handle = self._scene.add_batched_meshes_simple(
            f"/map/pick/{visit}",
            vertices,
            faces,
            np.tile(np.array([1.0, 0, 0, 0], np.float32), (len(found), 1)),
            ((low + high) / 2).astype(np.float32),
            batched_scales=scales,
            opacity=0.0,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        ids = np.array([object_id for object_id, _ in found])
        self._boxes[visit] = _Boxes(handle, ids, (low + high) / 2, scales, np.zeros(len(found), bool))

        @handle.on_click
        def _(event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
            if event.ray_origin is None or event.ray_direction is None:
                return
            hit = self.object_under(np.array(event.ray_origin), np.array(event.ray_direction))
            if hit is not None:
                self._on_object(hit)

    def listen(self) -> None:
        """Hear of clicks on objects whose box the camera stands in, too."""
        self._scene.on_click()(self._clicked_anywhere)

    def follow_camera(self, position_world: NDArray[np.floating]) -> None:
        """Take boxes away from around the camera: viser would outline them over the whole view."""
        place = np.asarray(position_world, np.float64) - self._origin
        for boxes in self._boxes.values():
            reach = boxes.scales / 2 + NEAR_M
            inside = np.all(np.abs(place - boxes.centres) < reach, axis=1)
            if not np.array_equal(inside, boxes.hidden):
                boxes.hidden = inside
                boxes.handle.batched_scales = np.where(inside[:, None], NO_SIZE, boxes.scales)

    def _clicked_anywhere(self, event: viser.SceneClickEvent) -> None:
        hidden = {i for boxes in self._boxes.values() for i in boxes.ids[boxes.hidden].tolist()}
        if hidden:
            hit = self.object_under(np.array(event.ray_origin), np.array(event.ray_direction))
            if hit is not None and hit in hidden:
                self._on_object(hit)

    def show_boxes(self, visit: int, on: bool) -> None:
        """Whether objects of a visit answer to clicks, and are outlined under the pointer."""
        if visit in self._boxes:
            self._boxes[visit].handle.visible = on

    def object_under(self, origin: NDArray[np.floating], direction: NDArray[np.floating]) -> int | None:
        """The object that a click along a ray (world) means."""
        drawn, size = self._drawn(), self._point_size_m
        found = pick_object(
            np.asarray(origin, np.float64) - self._origin,
            np.asarray(direction, np.float64),
            drawn.objects,
            drawn.object_ids,
            drawn.background,
            radius_m=max(0.03, 1.2 * size),
            point_size_m=size,
        )
        return found if found in self._catalogue.objects else None

    def point_under(
        self, origin: NDArray[np.floating], direction: NDArray[np.floating]
    ) -> NDArray[np.float64] | None:
        """The drawn point (3,) under a click along a ray, all world, metres."""
        drawn = self._drawn()
        cloud = np.concatenate([drawn.objects, drawn.background, drawn.ceiling])
        local = np.asarray(origin, np.float64) - self._origin
        size = max(0.01, self._point_size_m)
        for radius_m in (size, 2.5 * size, 6 * size):  # the wider ones for gaps between sparse points
            found = point_on_ray(local, direction, cloud, radius_m)
            if found is not None:
                return np.asarray(found + self._origin)
        return None
