"""What stands in the 3D view of one browser: nodes of viser, kept in step with the inspector's choices.

Background and objects are separate nodes, so that a new label resends objects only. Everything lives
under ``/map``, which is shifted by the map's origin.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import viser
from numpy.typing import NDArray

from oasisview.catalogue import Catalogue
from oasisview.panels.hud import Layers
from oasisview.scene.cameras import draw_cameras
from oasisview.scene.clicks import Drawn, MapClicks
from oasisview.scene.cut import CutBox
from oasisview.scene.ghost import Ghost
from oasisview.scene.map_points import GROUND_RGB, MapPoints, Rgb, VisitPoints, muted, object_colours
from oasisview.scene.marks import Marks
from pipeline.result import ChangeLabel

PAST_LABELS = (ChangeLabel.DISAPPEARED, ChangeLabel.MOVED)
# Label of an object in the earlier and in the later visit's map; None = nothing is known of it yet.
VisitLabels = tuple[Callable[[int], ChangeLabel | None], Callable[[int], ChangeLabel | None]]


class MapView:
    """The map as one browser shows it; ``marks`` draws selection, boxes and names over it, ``clicks`` says
    what a click means.

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
        label_of: Callable[[int], ChangeLabel],
        label_rgb: Mapping[bool, Mapping[ChangeLabel, Rgb]],
        *,
        on_object: Callable[[int], None],
        on_keyframe: Callable[[int, int], None],
    ) -> None:
        self._client = client
        self._scene = client.scene
        self._catalogue = catalogue
        self._points = points
        self._clickable = True
        self._box: CutBox | None = None
        self._visits = points.visits  # what of it is drawn: all, or what a cut leaves
        self._decided: VisitLabels = (label_of, label_of)
        self._labels: VisitLabels = self._decided
        self._label_rgb = label_rgb
        self._on_keyframe = on_keyframe
        self._mode, self._colours, self._layers, self._dark = "after", "label", Layers(), False
        self._clouds: dict[str, viser.PointCloudHandle] = {}
        self._pale: list[tuple[NDArray[np.uint8], bool, NDArray[np.uint8]]] = []
        self._ghost = Ghost(client.scene, points.point_size_m)
        self.clicks = MapClicks(client.scene, catalogue, points, self._drawn, on_object)
        self.marks = Marks(client, catalogue, points, self._shown_label, label_rgb)

    def build(self, mode: str, colours: str, layers: Layers, *, dark: bool) -> None:
        """Send everything once."""
        self._mode, self._colours, self._layers, self._dark = mode, colours, layers, dark
        self._scene.set_up_direction(tuple(self._points.up_world))
        self._scene.add_frame("/map", show_axes=False, position=self._points.origin)
        self._ground()
        for visit in range(len(self._visits)):
            self._add_clouds(visit)
            self.clicks.add_boxes(visit)
            draw_cameras(self._scene, self._catalogue.session(visit), visit, self._points, self._on_keyframe)
        self._add_gone()
        self._draw_marks()
        self._apply_visibility()
        self.clicks.listen()
        self._client.camera.on_update(self._on_camera)

    def close(self) -> None:
        """The tab is gone: nothing more is sent."""
        self.marks.close()

    # Choices of the inspector

    def set_mode(self, mode: str) -> None:
        """Which visits' maps are shown: before, after or both."""
        self._mode = mode
        with self._client.atomic():
            self._apply_visibility()
            self._draw_marks()

    def set_colours(self, colours: str) -> None:
        """Colour objects by label, by identity or as recorded."""
        self._colours = colours
        for visit, points in enumerate(self._visits):
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

    def set_preview(self, labels: VisitLabels | None) -> None:
        """Colour by other labels than the decided ones; None = by these again."""
        self._labels = labels or self._decided
        self.recolour()

    def follow(self, points: MapPoints) -> None:
        """The map as corrected: points that belong to other objects, and new labels."""
        self._points = points
        self._visits = self._cut_visits()
        self.recolour()

    def recolour(self) -> None:
        """Follow changed labels: objects, their boxes, and what is shown of the earlier visit."""
        with self._client.atomic():
            colours = [self._object_colours(visit) for visit in range(len(self._visits))]
            for visit, of_visit in enumerate(colours):
                cloud = self._clouds.get(f"{visit}/objects")
                if cloud is not None:
                    cloud.colors = of_visit
            self._add_gone(colours[0])
            self._draw_marks()
            self._ghost.forget()
            self._apply_visibility()

    def set_clickable(self, on: bool) -> None:
        """Whether objects answer to clicks, and are outlined under the pointer."""
        self._clickable = on
        self._apply_visibility()

    def set_cut(self, box: CutBox | None) -> None:
        """Draw only what lies in a box; None = everything."""
        self._box = box
        self._visits = self._cut_visits()
        with self._client.atomic():
            self.marks.outline_cut(box)
            for visit in range(len(self._visits)):
                self._add_clouds(visit)
            self._add_gone()
            self._draw_marks()
            self._ghost.forget()
            self._apply_visibility()

    # Nodes

    def _on_camera(self, camera: viser.CameraHandle) -> None:
        self.marks.arrange_soon()
        self.clicks.follow_camera(camera.position)

    def _drawn(self) -> Drawn:
        """What is shown now; of the earlier visit beside the later one, only what is past."""
        nothing = np.zeros((0, 3), np.float32)
        objects, ids, background, ceiling = [nothing], [np.zeros(0, np.int32)], [nothing], [nothing]
        for visit, points in enumerate(self._visits):
            if not self._shows(visit):
                continue
            keep = slice(None) if self._whole(visit) else self._past(points.object_ids)
            objects.append(points.objects[keep])
            ids.append(points.object_ids[keep])
            if self._whole(visit) and self._layers.background:
                background.append(points.background)
                ceiling += [points.ceiling] if self._layers.ceiling else []
        return Drawn(
            np.concatenate(objects), np.concatenate(ids), np.concatenate(background), np.concatenate(ceiling)
        )

    def _cut_visits(self) -> tuple[VisitPoints, ...]:
        visits, box = self._points.visits, self._box
        return visits if box is None else tuple(box.cut(visit) for visit in visits)

    def _shown_label(self, object_id: int) -> ChangeLabel | None:
        """The label of an object as a whole, for what is drawn once for both visits."""
        item = self._catalogue.objects.get(object_id)
        visit = self._catalogue.shown_session(item) if item is not None else 1
        return self._labels[visit](object_id)

    def _draw_marks(self) -> None:
        self.marks.draw(self._mode, self._layers, dark=self._dark)

    def _ground(self) -> None:
        self._scene.set_background_image(np.full((2, 2, 3), GROUND_RGB[self._dark], np.uint8))

    def _add_clouds(self, visit: int) -> None:
        points = self._visits[visit]
        self._cloud(f"{visit}/background", points.background, points.background_rgb)
        self._cloud(f"{visit}/ceiling", points.ceiling, points.ceiling_rgb)
        self._cloud(f"{visit}/objects", points.objects, self._object_colours(visit))

    def _cloud(self, name: str, points: NDArray[np.float32], true_rgb: NDArray[np.uint8]) -> None:
        if len(points) == 0:
            self._remove(f"/map/{name}")
            self._clouds.pop(name, None)
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
        points = self._visits[visit]
        return object_colours(
            points.objects_rgb,
            points.object_ids,
            self._colours,
            self._labels[visit],
            self._label_rgb[self._dark],
            dark=self._dark,
            pale=self._pale_of(points),
        )

    def _pale_of(self, points: VisitPoints) -> NDArray[np.uint8]:
        """``muted`` colours of a visit's objects; labels change far more often than they do."""
        for colours, dark, pale in self._pale:
            if colours is points.objects_rgb and dark == self._dark:
                return pale
        pale = muted(points.objects_rgb, dark=self._dark)
        self._pale = [*self._pale[-1:], (points.objects_rgb, self._dark, pale)]
        return pale

    def _add_gone(self, colours: NDArray[np.uint8] | None = None) -> None:
        """What Both adds to the later map: the earlier visit's points of what is gone or moved."""
        points = self._visits[0]
        keep = self._past(points.object_ids)
        self._remove("/map/0/gone")
        self._clouds.pop("0/gone", None)
        if keep.any():
            self._clouds["0/gone"] = self._scene.add_point_cloud(
                "/map/0/gone",
                points.objects[keep],
                (self._object_colours(0) if colours is None else colours)[keep],
                point_size=self._points.point_size_m,
                point_shape="diamond",
                point_shading="flat",
                precision="float32",
            )

    def _past(self, object_ids: NDArray[np.int32]) -> NDArray[np.bool_]:
        past = [i for i in np.unique(object_ids).tolist() if self._labels[0](i) in PAST_LABELS]
        return np.isin(object_ids, past)

    def _shows(self, visit: int) -> bool:
        return self._mode == "both" or (visit == 0) == (self._mode == "before")

    def _whole(self, visit: int) -> bool:
        return self._shows(visit) and not (visit == 0 and self._mode == "both")

    def _apply_visibility(self) -> None:
        # Both shows what differs already.
        other = {"before": 1, "after": 0}.get(self._mode) if self._layers.ghost else None
        self._ghost.show(
            None if other is None else self._visits[other],
            None if other is None else self._object_colours(other),
            dark=self._dark,
        )
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
            self.clicks.show_boxes(visit, self._clickable and self._shows(visit))
            for kind, on in (("keyframes", self._layers.keyframes), ("path", self._layers.path)):
                for suffix in ("", "_pick"):
                    handle = self._scene.get_handle_by_name(f"/map/{kind}{suffix}/{visit}")
                    if handle is not None:
                        handle.visible = on and self._shows(visit)
        for name, on in (("boxes", self._layers.boxes), ("names", self._layers.names)):
            handle = self._scene.get_handle_by_name(f"/map/{name}")
            if handle is not None:
                handle.visible = on

    def _remove(self, name: str) -> None:
        handle = self._scene.get_handle_by_name(name)
        if handle is not None:
            handle.remove()
