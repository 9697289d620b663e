"""What is drawn over the points of one browser's map: boxes, names, the selection, the keyframe's camera."""

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
from oasisview.scene.cut import CutBox
from oasisview.scene.map_points import REPLACED_RGB, MapPoints, Rgb
from oasisview.scene.names import readable
from oasisview.wording import LABEL_NAMES
from pipeline.result import ChangeLabel, MapObject, Sighting

# More names than this cannot be read in a map anyway; the most doubtful ones stay.
MAX_NAMES = 30
NAMES_AFTER_S = 0.2
LabelOf = Callable[[int], ChangeLabel | None]


class Marks:
    """Line drawings and names under ``/map``; arguments as of ``MapView``."""

    def __init__(
        self,
        client: viser.ClientHandle,
        catalogue: Catalogue,
        points: MapPoints,
        label_of: LabelOf,
        label_rgb: Mapping[bool, Mapping[ChangeLabel, Rgb]],
    ) -> None:
        self._client = client
        self._scene = client.scene
        self._catalogue = catalogue
        self._points = points
        self._label_of = label_of
        self._label_rgb = label_rgb
        self._mode, self._layers, self._dark = "after", Layers(), False
        self._names: dict[int, viser.LabelHandle] = {}
        self._timer: threading.Timer | None = None
        # Names are arranged on a timer's thread: they must not be replaced by new ones meanwhile.
        self._drawing = threading.RLock()
        self._keyframe_centre: NDArray[np.float64] | None = None
        self._selected: int | None = None
        self._cut: CutBox | None = None  # objects outside it get neither box nor name

    def draw(self, mode: str, layers: Layers, *, dark: bool) -> None:
        """Boxes and names anew, after labels, the visit shown or the theme changed."""
        with self._drawing:
            self._mode, self._layers, self._dark = mode, layers, dark
            self._boxes()

    def close(self) -> None:
        """The tab is gone: nothing more is sent."""
        if self._timer is not None:
            self._timer.cancel()

    def select(self, item: MapObject | None) -> None:
        """Mark an object: a thick box with its name, where it was, and how it moved."""
        with self._drawing, self._client.atomic():
            for name in ("box", "ghost", "way", "name", "points"):
                self._remove(f"/map/selected/{name}")
            self._selected = item.object_id if item is not None else None
            if item is not None and item.sightings:
                self._mark(item)
        self._arrange()

    def outline_cut(self, box: CutBox | None) -> None:
        """Show what the map is cut to."""
        self._cut = box
        self._remove("/map/cut")
        if box is not None:
            edges = outlines.dashed(outlines.edges_of(box.corners_world() - self._points.origin), 0.15)
            grey = (167, 175, 188) if self._dark else (82, 90, 103)
            self._scene.add_line_segments("/map/cut", edges, grey, thickness=1.5, thickness_units="screen")

    def show_keyframe(self, session: int, keyframe: int) -> None:
        """Mark the camera of the keyframe in the band."""
        record = self._catalogue.session(session).keyframes[keyframe]
        segments = outlines.frustum_segments(
            record.camera, self._points.local_pose(record.T_world_camera), self._points.frustum_depth_m * 1.6
        )
        accent = (125, 167, 255) if self._dark else (36, 86, 200)
        self._scene.add_line_segments(
            "/map/current_keyframe", segments, accent, thickness=3.0, thickness_units="screen"
        )
        self._keyframe_centre = np.asarray(record.T_world_camera[:3, 3], np.float64)
        self.arrange_soon()

    def _boxes(self) -> None:
        """Thin boxes around everything that is not static, dashed where it is no more."""
        segments: dict[ChangeLabel, list[NDArray[np.float32]]] = {}
        names = []
        for item in self._catalogue.by_doubt():
            label = self._label_of(item.object_id)
            sighting = self._shown_sighting(item)
            if label in (None, ChangeLabel.STATIC) or sighting is None:
                continue
            if self._cut is not None and not self._cut.holds(np.array([sighting.centroid_world_m])).all():
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
            if self._label_of(gone.object_id) is not ChangeLabel.DISAPPEARED:
                continue
            if self._label_of(new.object_id) is not ChangeLabel.APPEARED:
                continue
            first, second = gone.sighting(0), new.sighting(1)
            if first is not None and second is not None:
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
        self.arrange_soon()

    def arrange_soon(self) -> None:
        """Once the camera rests: every move of it is reported."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = threading.Timer(NAMES_AFTER_S, self._arrange)
        self._timer.daemon = True
        self._timer.start()

    def _arrange(self) -> None:
        """Show the names that can be read from here; the selected object has a larger one of its own."""
        with self._drawing:
            self._arrange_names()

    def _arrange_names(self) -> None:
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
            away = float(np.linalg.norm(position - self._keyframe_centre)) > 8 * self._points.frustum_depth_m
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
        known = self._label_of(item.object_id)
        label = ChangeLabel.UNKNOWN if known is None else known
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
