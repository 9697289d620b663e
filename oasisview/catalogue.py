"""An opened result as the viewer needs it: which sighting to show, in which order, with which pictures.

Read-only after construction and shared by all inspectors; methods that read images run on worker threads.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from oasisview import crops, heatmap_colours
from oasisview.assets import Asset, AssetTable
from oasisview.crops import LinkLine, PixelBox
from oasisview.wording import Limits
from pipeline.errors import ResultError
from pipeline.result import ChangeLabel, CovisiblePair, MapObject, Result, SessionResult, Sighting

# A shown keyframe is kept on selection if the object covers at least this share of it.
VISIBLE_SHARE = 0.004
_CROP_WIDTH_PX = 400


@dataclass(frozen=True)
class ObjectView:
    """A crop of one visit that shows an object, or the place where it would stand.

    Attributes:
        session, keyframe: where the crop comes from; box: its frame in the keyframe, pixels.
        url: the picture.
        outline: SVG path of the object's mask in a 100 x 100 box of the crop; empty for a bare place.
        place: bounds of the object's volume, (left, top, width, height) in percent of the crop; None
            where the object itself is shown.
    """

    session: int
    keyframe: int
    box: PixelBox
    url: str
    outline: str
    place: tuple[float, float, float, float] | None


@dataclass(frozen=True)
class BeforeAfter:
    """Both visits' pictures of an object, and the patch matches between them.

    ``compared`` tells whether these two keyframes were matched with each other at all.
    """

    before: ObjectView | None
    after: ObjectView | None
    lines: tuple[LinkLine, ...]
    compared: bool


class Catalogue:
    """Facts and pictures of a result; ``assets`` serves the pictures.

    Raises:
        ResultError: the result holds fewer than two visits.
    """

    def __init__(self, result: Result, assets: AssetTable) -> None:
        if len(result.sessions) < 2:
            raise ResultError(
                f"{result.path} holds a single visit", "process two visits with `oasisview run`"
            )
        self.result = result
        self.limits = Limits.of(result)
        self.objects: dict[int, MapObject] = {item.object_id: item for item in result.objects}
        self._assets = assets
        self._registered: set[str] = set()
        stamp = f"{result.path.resolve()}|{sorted(map(str, result.manifest.items()))}"
        # Keys stand for content that never changes: another result on the same port gets other keys.
        self._prefix = hashlib.sha256(stamp.encode()).hexdigest()[:12]
        self.view_of = lru_cache(maxsize=1024)(self._view_of)
        self.before_after = lru_cache(maxsize=256)(self._before_after)
        self._thumbnail = lru_cache(maxsize=4096)(self._tight_crop)
        self.mask = lru_cache(maxsize=64)(self._mask)

    def session(self, index: int) -> SessionResult:
        """One visit."""
        return self.result.sessions[index]

    def shown_session(self, item: MapObject) -> int:
        """The visit in which an object is shown in the map: the latest that saw it."""
        return item.sightings[-1].session if item.sightings else 1

    def shown_sighting(self, item: MapObject) -> Sighting | None:
        """The sighting of :meth:`shown_session`."""
        return item.sightings[-1] if item.sightings else None

    def doubt(self, item: MapObject) -> float:
        """How much a look at the object is worth: doubt in its label times its size in metres."""
        shown = self.shown_sighting(item)
        extent = np.prod(np.maximum(shown.extent_m, 0.01)) ** (1 / 3) if shown is not None else 0.01
        return float((1.0 - item.confidence) * extent)

    def by_doubt(self) -> list[MapObject]:
        """All objects, most doubtful first; ties by id so that the order never flickers."""
        return sorted(self.objects.values(), key=lambda item: (-self.doubt(item), item.object_id))

    def counterpart_object(self, item: MapObject) -> int | None:
        """Object id behind ``counterpart_instance`` of the other visit, or None."""
        instance = item.counterpart_instance
        if instance is None or not item.sightings:
            return None
        matrix = self.result.score_matrix
        ids = matrix.column_object_ids if item.sighting(0) is not None else matrix.row_object_ids
        return int(ids[instance]) if 0 <= instance < len(ids) else None

    # Keyframes

    def covisible(self, session: int, keyframe: int) -> CovisiblePair | None:
        """The best co-visible keyframe of the other visit, or None."""
        pairs = self.session(session).keyframes[keyframe].covisible
        return pairs[0] if pairs else None

    def best_keyframe(self, item: MapObject, session: int) -> int | None:
        """The keyframe of a visit that shows an object, or else its place, best."""
        view = self.view_of(item.object_id, session)
        return view.keyframe if view is not None else None

    def sees_well(self, session: int, keyframe: int, object_id: int) -> bool:
        """Whether an object is large enough in a keyframe to be looked at there."""
        return float((self.mask(session, keyframe) == object_id).mean()) >= VISIBLE_SHARE

    def _mask(self, session: int, keyframe: int) -> NDArray[np.uint16]:
        return self.session(session).object_mask(keyframe)

    # Pictures

    def image_url(self, session: int, keyframe: int) -> str:
        """The keyframe's colour image."""
        path = self.session(session).image_path(keyframe)
        return self._register(
            f"image/{session}/{keyframe}.jpg", lambda: Asset("image/jpeg", path.read_bytes())
        )

    def heatmap_url(self, kind: str, session: int, keyframe: int, *, dark: bool) -> str:
        """The coloured heatmap of a keyframe; kind is ``semantic`` or ``geometric``."""
        theme = "dark" if dark and kind == "geometric" else "light"
        return self._register(
            f"{kind}/{theme}/{session}/{keyframe}.png", lambda: self._heatmap(kind, session, keyframe, dark)
        )

    def _heatmap(self, kind: str, session: int, keyframe: int, dark: bool) -> Asset | None:
        visit = self.session(session)
        camera = visit.keyframes[keyframe].camera
        height, width = camera.height // 2, camera.width // 2
        if kind == "semantic":
            image = heatmap_colours.colour_semantic(visit.semantic_heatmap(keyframe), height, width)
        else:
            image = heatmap_colours.colour_geometric(
                visit.geometric_heatmap(keyframe), height, width, dark=dark
            )
        return _png(image)

    def thumbnail_url(self, object_id: int, session: int | None = None) -> str:
        """A small picture of an object, by default from the latest visit that saw it; empty without any."""
        return self._thumbnail(object_id, session)

    def _tight_crop(self, object_id: int, session: int | None) -> str:
        item = self.objects.get(object_id)
        if item is None:
            return ""
        view = self.view_of(object_id, self.shown_session(item) if session is None else session)
        if view is None:
            return ""
        camera = self.session(view.session).keyframes[view.keyframe].camera
        bounds = crops.mask_box(self.mask(view.session, view.keyframe) == object_id, camera)
        if bounds is None:
            return view.url
        tight = crops.crop_around(bounds, camera, scale=1.1, margin_px=8)
        return self._crop_url(view.session, view.keyframe, tight)

    def matrix_url(self, kind: str) -> str:
        """The whole score matrix as an image, one pixel a cell; kind is ``sigma`` or ``s_bar``."""
        return self._register(f"matrix/{kind}.png", lambda: self._matrix(kind))

    def _matrix(self, kind: str) -> Asset | None:
        matrix = self.result.score_matrix
        values = np.asarray(matrix.sigma if kind == "sigma" else matrix.s_bar, np.float32)
        table = heatmap_colours.ramp(heatmap_colours.CIVIDIS)
        return _png(table[np.round(np.clip(np.nan_to_num(values), 0, 1) * 255).astype(np.uint8)])

    def _register(self, name: str, make: Callable[[], Asset | None]) -> str:
        key = f"{self._prefix}/{name}"
        if key in self._registered:
            return f"/asset/{key}"
        url = self._assets.register(key, make)
        self._registered.add(key)
        return url

    # Views of objects

    def _view_of(self, object_id: int, session: int) -> ObjectView | None:
        """The best crop of an object in a visit, or of the place where it would stand there."""
        item = self.objects[object_id]
        sighting = item.sighting(session)
        if sighting is not None:
            for keyframe in sighting.keyframes[:6]:
                view = self._object_crop(object_id, session, keyframe)
                if view is not None:
                    return view
        other = item.sighting(1 - session)
        place = other or sighting
        return None if place is None else self._best_place(place, session)

    def _object_crop(self, object_id: int, session: int, keyframe: int) -> ObjectView | None:
        camera = self.session(session).keyframes[keyframe].camera
        mask = self.mask(session, keyframe) == object_id
        bounds = crops.mask_box(mask, camera)
        if bounds is None:
            return None
        box = crops.crop_around(bounds, camera)
        left, top = box.left / camera.width, box.top / camera.height
        rows = slice(round(top * mask.shape[0]), round((top + box.height / camera.height) * mask.shape[0]))
        columns = slice(round(left * mask.shape[1]), round((left + box.width / camera.width) * mask.shape[1]))
        outline = crops.outline_path(mask[rows, columns])
        return ObjectView(session, keyframe, box, self._crop_url(session, keyframe, box), outline, None)

    def _best_place(self, place: Sighting, session: int) -> ObjectView | None:
        """The other visit's view of a sighting's volume, from where it was itself seen best."""
        visit, origin = self.session(session), self.session(place.session)
        low, high = np.array(place.box_min_world_m), np.array(place.box_max_world_m)
        preferred: list[int] = []
        for keyframe in place.keyframes[:4] if place.session != session else ():
            preferred += [p.other_keyframe for p in origin.keyframes[keyframe].covisible]
        best: tuple[float, int, PixelBox] | None = None
        for keyframe, record in enumerate(visit.keyframes):
            share = crops.visible_share(low, high, record.camera, record.T_world_camera)
            if share < 0.3:
                continue
            bounds = crops.project_box(low, high, record.camera, record.T_world_camera)
            if bounds is None:
                continue
            area = bounds.width * bounds.height / (record.camera.width * record.camera.height)
            # Walls may hide a place from a camera that points at it: co-visible keyframes really see it.
            score = share * min(area, 0.25) * (4.0 if keyframe in preferred else 1.0)
            if best is None or score > best[0]:
                best = (score, keyframe, bounds)
        if best is None:
            return None
        _, keyframe, bounds = best
        return self._place_view(session, keyframe, bounds)

    def _place_view(self, session: int, keyframe: int, bounds: PixelBox) -> ObjectView:
        box = crops.crop_around(bounds, self.session(session).keyframes[keyframe].camera)
        place = (
            (bounds.left - box.left) / box.width * 100,
            (bounds.top - box.top) / box.height * 100,
            bounds.width / box.width * 100,
            bounds.height / box.height * 100,
        )
        return ObjectView(session, keyframe, box, self._crop_url(session, keyframe, box), "", place)

    def _crop_url(self, session: int, keyframe: int, box: PixelBox) -> str:
        left, top, width, height = (int(v) for v in (box.left, box.top, box.width, box.height))
        name = f"crop/{session}/{keyframe}/{left}-{top}-{width}-{height}.jpg"
        return self._register(name, lambda: self._crop(session, keyframe, left, top, width, height))

    def _crop(
        self, session: int, keyframe: int, left: int, top: int, width: int, height: int
    ) -> Asset | None:
        visit = self.session(session)
        image = cv2.imread(str(visit.image_path(keyframe)), cv2.IMREAD_COLOR)
        if image is None:
            return None
        camera = visit.keyframes[keyframe].camera
        across, down = image.shape[1] / camera.width, image.shape[0] / camera.height
        part = image[
            int(top * down) : max(int((top + height) * down), int(top * down) + 1),
            int(left * across) : max(int((left + width) * across), int(left * across) + 1),
        ]
        size = (_CROP_WIDTH_PX, round(_CROP_WIDTH_PX / crops.CROP_ASPECT))
        encoded, data = cv2.imencode(".jpg", cv2.resize(part, size, interpolation=cv2.INTER_CUBIC))
        return Asset("image/jpeg", data.tobytes()) if encoded else None

    def _before_after(self, object_id: int) -> BeforeAfter:
        """Pictures of both visits, from a pair of keyframes that were compared where there is one."""
        item = self.objects[object_id]
        pair = self._compared_pair(item)
        if pair is None:
            return BeforeAfter(self.view_of(object_id, 0), self.view_of(object_id, 1), (), compared=False)
        views = tuple(self._view_in(item, session, pair[session]) for session in (0, 1))
        before, after = views
        if before is None or after is None:
            return BeforeAfter(self.view_of(object_id, 0), self.view_of(object_id, 1), (), compared=False)
        links = self.result.links(*pair)
        if links is None:
            return BeforeAfter(before, after, (), compared=False)
        masks = [self.mask(s, pair[s]) == object_id if item.sighting(s) is not None else None for s in (0, 1)]
        cameras = [self.session(s).keyframes[pair[s]].camera for s in (0, 1)]
        lines = crops.link_lines(links, masks[0], masks[1], (before.box, cameras[0]), (after.box, cameras[1]))
        return BeforeAfter(before, after, lines, compared=True)

    def _view_in(self, item: MapObject, session: int, keyframe: int) -> ObjectView | None:
        if item.sighting(session) is not None:
            return self._object_crop(item.object_id, session, keyframe)
        place = item.sighting(1 - session)
        if place is None:
            return None
        record = self.session(session).keyframes[keyframe]
        bounds = crops.project_box(
            np.array(place.box_min_world_m),
            np.array(place.box_max_world_m),
            record.camera,
            record.T_world_camera,
        )
        return None if bounds is None else self._place_view(session, keyframe, bounds)

    def _compared_pair(self, item: MapObject) -> tuple[int, int] | None:
        """Keyframes (previous, current) that see the object best and were matched with each other."""
        before, after = item.sighting(0), item.sighting(1)
        seen = before or after
        if seen is None:
            return None
        opposite = after if before is not None else None
        low, high = np.array(seen.box_min_world_m), np.array(seen.box_max_world_m)
        for keyframe in seen.keyframes[:8]:
            for pair in self.session(seen.session).keyframes[keyframe].covisible:
                other = pair.other_keyframe
                if opposite is not None:
                    suits = other in opposite.keyframes
                else:
                    record = self.session(1 - seen.session).keyframes[other]
                    suits = crops.visible_share(low, high, record.camera, record.T_world_camera) > 0.5
                ordered = (keyframe, other) if seen.session == 0 else (other, keyframe)
                if suits and self.result.links(*ordered) is not None:
                    return ordered
        return None


def changed_labels() -> frozenset[ChangeLabel]:
    """The labels that the queue shows at first: everything but static."""
    return frozenset(label for label in ChangeLabel if label is not ChangeLabel.STATIC)


def _png(image_rgb: NDArray[np.uint8]) -> Asset | None:
    encoded, data = cv2.imencode(".png", cv2.cvtColor(image_rgb, cv2.COLOR_RGB2BGR))
    return Asset("image/png", data.tobytes()) if encoded else None
