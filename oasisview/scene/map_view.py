"""What stands in the 3D view of one browser: nodes of viser, kept in step with the inspector's choices.

Background and objects are separate nodes, so that a new label resends objects only. Everything lives
under ``/map``, which is shifted by the map's origin.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import viser
import viser.transforms as vtf
from numpy.typing import NDArray

from oasisview import wording
from oasisview.catalogue import Catalogue
from oasisview.panels.hud import Layers
from oasisview.panels.markup import GLYPHS
from oasisview.scene import outlines
from oasisview.scene.map_points import GROUND_RGB, REPLACED_RGB, MapPoints, Rgb, muted, object_colours
from oasisview.scene.names import readable
from oasisview.scene.picking import pick_object
from oasisview.wording import LABEL_NAMES
from pipeline.result import ChangeLabel, MapObject, Sighting

# More names than this cannot be read in a map anyway; the most doubtful ones stay.
MAX_NAMES = 30
NAMES_AFTER_S = 0.2
PAST_LABELS = (ChangeLabel.DISAPPEARED, ChangeLabel.MOVED)
LabelOf = Callable[[int], ChangeLabel]


class MapView:
    """The map as one browser shows it.

    Args:
        client: the tab.
        catalogue, points: what there is to show, shared by all tabs.
        label_of: final label of an object.
        label_rgb: colour of each label on a light and on a dark page.
        on_object, on_keyframe: called with an object id, or with a visit and a keyframe, that was clicked.
    """

    def __init__(
        self,
        client: viser.ClientHandle,
        catalogue: Catalogue,
        points: MapPoints,
        label_of: LabelOf,
        label_rgb: Mapping[bool, Mapping[ChangeLabel, Rgb]],
        *,
        on_object: Callable[[int], None],
        on_keyframe: Callable[[int, int], None],
    ) -> None:
        self._client = client
        self._scene = client.scene
        self._catalogue = catalogue
        self._points = points
        self._label_of = label_of
        self._label_rgb = label_rgb
        self._on_object = on_object
        self._on_keyframe = on_keyframe
        self._mode, self._colours, self._layers, self._dark = "after", "label", Layers(), False
        self._clouds: dict[str, viser.PointCloudHandle] = {}
        self._picks: dict[int, viser.BatchedMeshHandle] = {}
        self._names: dict[int, viser.LabelHandle] = {}
        self._name_timer: threading.Timer | None = None
        self._keyframe_centre: NDArray[np.float64] | None = None
        self._selected: int | None = None

    def build(self, mode: str, colours: str, layers: Layers, *, dark: bool) -> None:
        """Send everything once."""
        self._mode, self._colours, self._layers, self._dark = mode, colours, layers, dark
        self._scene.set_up_direction(tuple(self._points.up_world))
        self._scene.add_frame("/map", show_axes=False, position=self._points.origin)
        self._ground()
        for visit, points in enumerate(self._points.visits):
            self._cloud(f"{visit}/background", points.background, points.background_rgb)
            self._cloud(f"{visit}/ceiling", points.ceiling, points.ceiling_rgb)
            self._cloud(f"{visit}/objects", points.objects, self._object_colours(visit))
            self._add_picks(visit)
            self._add_keyframes(visit)
        self._add_gone()
        self._boxes()
        self._apply_visibility()
        self._sort_names()
        self._client.camera.on_update(lambda _: self._sort_names_soon())

    def close(self) -> None:
        """The tab is gone: nothing more is sent."""
        if self._name_timer is not None:
            self._name_timer.cancel()

    # Choices of the inspector

    def set_mode(self, mode: str) -> None:
        """Which visits' maps are shown: before, after or both."""
        self._mode = mode
        with self._client.atomic():
            self._apply_visibility()
            self._boxes()

    def set_colours(self, colours: str) -> None:
        """Colour objects by label, by identity or as recorded."""
        self._colours = colours
        for visit, points in enumerate(self._points.visits):
            for part, true in (("background", points.background_rgb), ("ceiling", points.ceiling_rgb)):
                cloud = self._clouds.get(f"{visit}/{part}")
                if cloud is not None:
                    cloud.colors = self._ground_colours(true)
        self.recolour()

    def set_layers(self, layers: Layers) -> None:
        """Which further layers are shown."""
        self._layers = layers
        with self._client.atomic():
            self._apply_visibility()

    def set_theme(self, dark: bool) -> None:
        """Light or dark ground and palette."""
        self._dark = dark
        self._ground()
        self.set_colours(self._colours)

    def recolour(self) -> None:
        """Follow changed labels: objects, their boxes, and what is shown of the earlier visit."""
        with self._client.atomic():
            for visit in range(len(self._points.visits)):
                cloud = self._clouds.get(f"{visit}/objects")
                if cloud is not None:
                    cloud.colors = self._object_colours(visit)
            self._add_gone()
            self._boxes()
            self._apply_visibility()

    def select(self, item: MapObject | None) -> None:
        """Mark an object: a thick box with its name, where it was, and how it moved."""
        with self._client.atomic():
            for name in ("box", "ghost", "way", "name", "points"):
                self._remove(f"/map/selected/{name}")
            self._selected = item.object_id if item is not None else None
            if item is not None and item.sightings:
                self._mark(item)
        self._sort_names()

    def show_keyframe(self, session: int, keyframe: int) -> None:
        """Mark the camera of the keyframe in the band."""
        record = self._catalogue.session(session).keyframes[keyframe]
        segments = outlines.frustum_segments(
            record.camera, self._local_pose(record.T_world_camera), self._frustum_depth * 1.6
        )
        accent = (125, 167, 255) if self._dark else (36, 86, 200)
        self._scene.add_line_segments(
            "/map/current_keyframe", segments, accent, thickness=3.0, thickness_units="screen"
        )
        self._keyframe_centre = np.asarray(record.T_world_camera[:3, 3], np.float64)
        self._sort_names_soon()

    # Clicks

    def object_under(
        self, origin: NDArray[np.floating], direction: NDArray[np.floating], fallback: int | None
    ) -> int | None:
        """The object that a click along a ray (world) means; runs over all drawn points, so off the loop."""
        objects, ids, background = [], [], []
        for visit, points in enumerate(self._points.visits):
            if not self._shows(visit):
                continue
            keep = slice(None) if self._whole(visit) else self._past(points.object_ids)
            objects.append(points.objects[keep])
            ids.append(points.object_ids[keep])
            if self._whole(visit) and self._layers.background:
                background.append(points.background)
        local = np.asarray(origin, np.float64) - self._points.origin
        size = self._points.point_size_m
        found = pick_object(
            local,
            np.asarray(direction, np.float64),
            np.concatenate(objects) if objects else np.zeros((0, 3), np.float32),
            np.concatenate(ids) if ids else np.zeros(0, np.int32),
            np.concatenate(background) if background else np.zeros((0, 3), np.float32),
            radius_m=max(0.03, 1.2 * size),
            point_size_m=size,
        )
        return found if found in self._catalogue.objects else fallback

    def _add_picks(self, visit: int) -> None:
        """Invisible boxes that catch clicks; which object was meant is decided by the points."""
        found = [
            (item.object_id, sighting)
            for item in self._catalogue.objects.values()
            if (sighting := item.sighting(visit)) is not None
        ]
        if not found:
            return
        low = np.array([s.box_min_world_m for _, s in found]) - self._points.origin
        high = np.array([s.box_max_world_m for _, s in found]) - self._points.origin
        vertices, faces = outlines.box_mesh()
        handle = self._scene.add_batched_meshes_simple(
            f"/map/pick/{visit}",
            vertices,
            faces,
            np.tile(np.array([1.0, 0, 0, 0], np.float32), (len(found), 1)),
            ((low + high) / 2).astype(np.float32),
            batched_scales=(1.05 * (high - low) + 0.02).astype(np.float32),
            opacity=0.0,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._picks[visit] = handle

        @handle.on_click
        def _(event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
            if event.ray_origin is None or event.ray_direction is None:
                return
            hit = self.object_under(np.array(event.ray_origin), np.array(event.ray_direction), None)
            if hit is not None:
                self._on_object(hit)

    # Nodes

    def _ground(self) -> None:
        self._scene.set_background_image(np.full((2, 2, 3), GROUND_RGB[self._dark], np.uint8))

    def _cloud(self, name: str, points: NDArray[np.float32], true_rgb: NDArray[np.uint8]) -> None:
        if len(points) == 0:
            return
        colours = true_rgb if name.endswith("objects") else self._ground_colours(true_rgb)
        self._clouds[name] = self._scene.add_point_cloud(
            f"/map/{name}",
            points,
            colours,
            point_size=self._points.point_size_m,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _ground_colours(self, true_rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        return true_rgb if self._colours == "true" else muted(true_rgb, dark=self._dark)

    def _object_colours(self, visit: int) -> NDArray[np.uint8]:
        points = self._points.visits[visit]
        return object_colours(
            points.objects_rgb,
            points.object_ids,
            self._colours,
            self._label_of,
            self._label_rgb[self._dark],
            dark=self._dark,
        )

    def _add_gone(self) -> None:
        """What Both adds to the later map: the earlier visit's points of what is gone or moved."""
        points = self._points.visits[0]
        keep = self._past(points.object_ids)
        self._remove("/map/0/gone")
        self._clouds.pop("0/gone", None)
        if keep.any():
            self._clouds["0/gone"] = self._scene.add_point_cloud(
                "/map/0/gone",
                points.objects[keep],
                self._object_colours(0)[keep],
                point_size=self._points.point_size_m,
                point_shape="diamond",
                point_shading="flat",
                precision="float32",
            )

    def _past(self, object_ids: NDArray[np.int32]) -> NDArray[np.bool_]:
        past = [i for i in np.unique(object_ids).tolist() if self._label_of(i) in PAST_LABELS]
        return np.isin(object_ids, past)

    def _shows(self, visit: int) -> bool:
        return self._mode == "both" or (visit == 0) == (self._mode == "before")

    def _whole(self, visit: int) -> bool:
        return self._shows(visit) and not (visit == 0 and self._mode == "both")

    def _apply_visibility(self) -> None:
        for visit in range(len(self._points.visits)):
            whole = self._whole(visit)
            wanted = {
                f"{visit}/background": whole and self._layers.background,
                f"{visit}/ceiling": whole and self._layers.background and self._layers.ceiling,
                f"{visit}/objects": whole,
            }
            if visit == 0:
                wanted["0/gone"] = self._mode == "both"
            for name, on in wanted.items():
                cloud = self._clouds.get(name)
                if cloud is not None and cloud.visible != on:
                    cloud.visible = on
            if visit in self._picks:
                self._picks[visit].visible = self._shows(visit)
            for kind, on in (("keyframes", self._layers.keyframes), ("path", self._layers.path)):
                for suffix in ("", "_pick"):
                    handle = self._scene.get_handle_by_name(f"/map/{kind}{suffix}/{visit}")
                    if handle is not None:
                        handle.visible = on and self._shows(visit)
        for name, on in (("boxes", self._layers.boxes), ("names", self._layers.names)):
            handle = self._scene.get_handle_by_name(f"/map/{name}")
            if handle is not None:
                handle.visible = on

    def _boxes(self) -> None:
        """Thin boxes around everything that is not static, dashed where it is no more."""
        segments: dict[ChangeLabel, list[NDArray[np.float32]]] = {}
        names = []
        for item in self._catalogue.by_doubt():
            label = self._label_of(item.object_id)
            sighting = self._shown_sighting(item)
            if label is ChangeLabel.STATIC or sighting is None:
                continue
            edges = self._box(sighting)
            if sighting.session == 0 and self._mode == "both":
                edges = outlines.dashed(edges, max(0.03, 2 * self._points.point_size_m))
            segments.setdefault(label, []).append(edges)
            names.append((item.object_id, label, sighting))
        self._scene.add_frame("/map/boxes", show_axes=False, visible=self._layers.boxes)
        for label in ChangeLabel:
            self._remove(f"/map/boxes/{LABEL_NAMES[label]}")
            if label in segments:
                # One colour a node: viser draws per-segment colours white once a node is replaced.
                self._scene.add_line_segments(
                    f"/map/boxes/{LABEL_NAMES[label]}",
                    np.concatenate(segments[label]),
                    self._label_rgb[self._dark][label],
                    thickness=1.6,
                    thickness_units="screen",
                )
        self._replaced_boxes()
        self._name(names)

    def _replaced_boxes(self) -> None:
        """One box around both objects of every *replaced* event that nobody has overruled."""
        self._remove("/map/boxes/replaced")
        edges = []
        for event in self._catalogue.result.replaced:
            gone, new = (self._catalogue.objects.get(i) for i in (event.disappeared_id, event.appeared_id))
            if gone is None or new is None or self._mode == "before":
                continue
            stands = [self._label_of(item.object_id) is item.label for item in (gone, new)]
            first, second = gone.sighting(0), new.sighting(1)
            if all(stands) and first is not None and second is not None:
                low = np.minimum(first.box_min_world_m, second.box_min_world_m) - self._points.origin
                high = np.maximum(first.box_max_world_m, second.box_max_world_m) - self._points.origin
                edges.append(outlines.dashed(outlines.box_segments(low, high, 0.03), 0.06))
        if edges:
            self._scene.add_line_segments(
                "/map/boxes/replaced",
                np.concatenate(edges),
                REPLACED_RGB[self._dark],
                thickness=2.0,
                thickness_units="screen",
            )

    def _name(self, shown: Sequence[tuple[int, ChangeLabel, Sighting]]) -> None:
        self._remove("/map/names")
        self._scene.add_frame("/map/names", show_axes=False, visible=self._layers.names)
        up = self._points.up_world
        self._names = {
            object_id: self._scene.add_label(
                f"/map/names/{object_id}",
                f"{GLYPHS[LABEL_NAMES[label]]} {object_id}",
                position=self._top(sighting) + 0.04 * up,
                anchor="bottom-center",
                font_screen_scale=0.8,
                visible=False,
            )
            for object_id, label, sighting in shown[:MAX_NAMES]
        }
        self._sort_names_soon()

    def _sort_names_soon(self) -> None:
        """Once the camera rests: every move of it is reported."""
        if self._name_timer is not None:
            self._name_timer.cancel()
        self._name_timer = threading.Timer(NAMES_AFTER_S, self._sort_names)
        self._name_timer.daemon = True
        self._name_timer.start()

    def _sort_names(self) -> None:
        """Show the names that can be read from here; the selected object has a larger one of its own."""
        names, camera = dict(self._names), self._client.camera
        try:
            rotation = vtf.SO3(np.asarray(camera.wxyz)).as_matrix()
            position, fov, height = np.asarray(camera.position), camera.fov, camera.image_height
            width = camera.image_width
        except AssertionError:  # the page has not told yet where its camera is
            return
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation, position
        if self._keyframe_centre is not None:
            # A frustum right before the eye would cross out what one flew here to see.
            frustum = self._scene.get_handle_by_name("/map/current_keyframe")
            away = float(np.linalg.norm(position - self._keyframe_centre)) > 8 * self._frustum_depth
            if frustum is not None and frustum.visible != away:
                frustum.visible = away
        if not names:
            return
        own = [i for i in names if i == self._selected]
        order = own + [i for i in names if i != self._selected]
        places = np.array([names[i].position for i in order]) + self._points.origin
        shown = readable(places, T, fov, width, height)
        with self._client.atomic():
            for object_id, visible in zip(order, shown.tolist(), strict=True):
                wanted = visible and object_id != self._selected
                if names[object_id].visible != wanted:
                    names[object_id].visible = wanted

    def _shown_sighting(self, item: MapObject) -> Sighting | None:
        if self._mode == "before":
            return item.sighting(0)
        if self._mode == "after":
            return item.sighting(1)
        return item.sighting(1) or item.sighting(0)

    def _mark(self, item: MapObject) -> None:
        label = self._label_of(item.object_id)
        colour = self._label_rgb[self._dark][label]
        sighting = self._shown_sighting(item) or item.sightings[-1]
        self._scene.add_line_segments(
            "/map/selected/box", self._box(sighting, 0.02), colour, thickness=4.0, thickness_units="screen"
        )
        self._scene.add_label(
            "/map/selected/name",
            f"{GLYPHS[LABEL_NAMES[label]]} {wording.object_name(item.object_id)}",
            position=self._top(sighting) + 0.1 * self._points.up_world,
            anchor="bottom-center",
            font_screen_scale=1.2,
        )
        before, after = item.sighting(0), item.sighting(1)
        moved = item.displacement_m is not None and item.displacement_m > self._catalogue.limits.tau_d_m
        if before is not None and after is not None and moved:
            other = before if sighting is after else after
            edges = outlines.dashed(self._box(other), max(0.03, 2 * self._points.point_size_m))
            self._scene.add_line_segments(
                "/map/selected/ghost", edges, colour, thickness=2.0, thickness_units="screen"
            )
            way = np.array([[before.centroid_world_m, after.centroid_world_m]]) - self._points.origin
            self._scene.add_line_segments(
                "/map/selected/way", way.astype(np.float32), colour, thickness=3.0, thickness_units="screen"
            )

    def _add_keyframes(self, visit: int) -> None:
        session = self._catalogue.session(visit)
        if not session.keyframes:
            return
        grey = (150, 156, 166) if visit == 0 else (88, 96, 108)
        corners = np.stack(
            [
                outlines.frustum_corners(k.camera, self._local_pose(k.T_world_camera), self._frustum_depth)
                for k in session.keyframes
            ]
        )
        segments = np.concatenate([c[outlines.FRUSTUM_EDGES] for c in corners])
        self._scene.add_line_segments(
            f"/map/keyframes/{visit}", segments, grey, thickness=1.2, thickness_units="screen"
        )
        if len(session.keyframes) > 1:
            self._scene.add_line_segments(
                f"/map/path/{visit}",
                outlines.path_segments(corners[:, 0]),
                grey,
                thickness=2.5,
                thickness_units="screen",
            )
        vertices, faces = outlines.box_mesh()
        size = np.maximum(np.ptp(corners, axis=1), 0.02).astype(np.float32)
        middle = ((corners.min(axis=1) + corners.max(axis=1)) / 2).astype(np.float32)
        handle = self._scene.add_batched_meshes_simple(
            f"/map/keyframes_pick/{visit}",
            vertices,
            faces,
            np.tile(np.array([1.0, 0, 0, 0], np.float32), (len(middle), 1)),
            middle,
            batched_scales=size,
            opacity=0.0,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

        @handle.on_click
        def _(event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
            if event.instance_index is not None:
                self._on_keyframe(visit, int(event.instance_index))

    @property
    def _frustum_depth(self) -> float:
        return float(np.clip(8 * self._points.point_size_m, 0.12, 1.0))

    def _local_pose(self, T_world_camera: NDArray[np.floating]) -> NDArray[np.float64]:
        local = np.array(T_world_camera, np.float64)
        local[:3, 3] -= self._points.origin
        return local

    def _box(self, sighting: Sighting, margin_m: float = 0.0) -> NDArray[np.float32]:
        low = np.array(sighting.box_min_world_m) - self._points.origin
        high = np.array(sighting.box_max_world_m) - self._points.origin
        return outlines.box_segments(low, high, margin_m)

    def _top(self, sighting: Sighting) -> NDArray[np.float64]:
        low, high = np.array(sighting.box_min_world_m), np.array(sighting.box_max_world_m)
        rise = float(np.abs(self._points.up_world) @ (high - low)) / 2
        return (low + high) / 2 - self._points.origin + rise * self._points.up_world

    def _remove(self, name: str) -> None:
        handle = self._scene.get_handle_by_name(name)
        if handle is not None:
            handle.remove()
