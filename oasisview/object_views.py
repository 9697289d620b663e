"""Which pictures show an object: its best crop in each visit, the place where it would stand, patch matches.

Reads keyframe images when a crop is asked for, so crops are made on worker threads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from oasisview import crops, heatmap_colours
from oasisview.assets import Asset
from oasisview.crops import LinkLine, PixelBox
from oasisview.same_viewpoint import SameViewpoint
from pipeline.result import MapObject, Result, SessionResult, Sighting

_CROP_WIDTH_PX = 400
# Of an object's largest mask: keyframes that show less of it are not chosen for its picture.
SCRAP_SHARE = 0.25


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


class ObjectViews:
    """Crops of the objects of a result.

    Args:
        result: where the pictures come from.
        mask: object ids of a keyframe, by visit and keyframe.
        register: offers a picture to browsers under a name, and returns its address.
        crop_quality: of the pictures' JPEG, 0 to 100.
    """

    def __init__(
        self,
        result: Result,
        mask: Callable[[int, int], NDArray[np.uint16]],
        register: Callable[[str, Callable[[], Asset | None]], str],
        *,
        crop_quality: int = 95,
    ) -> None:
        self._result = result
        self._objects: dict[int, MapObject] = {item.object_id: item for item in result.objects}
        self._mask = mask
        self._register = register
        self._crop_quality = crop_quality
        self.best = lru_cache(maxsize=1024)(self._best)
        self._same = lru_cache(maxsize=8)(SameViewpoint(result).picture)
        self.before_after = lru_cache(maxsize=256)(self._before_after)

    def _session(self, index: int) -> SessionResult:
        return self._result.sessions[index]

    def tight_url(self, view: ObjectView, object_id: int) -> str:
        """The same picture cut close around the object; ``view`` itself if it shows a bare place."""
        camera = self._session(view.session).keyframes[view.keyframe].camera
        bounds = crops.mask_box(self._mask(view.session, view.keyframe) == object_id, camera)
        if bounds is None:
            return view.url
        tight = crops.crop_around(bounds, camera, scale=1.1, margin_px=8)
        return self._crop_url(view.session, view.keyframe, tight)

    def _best(self, object_id: int, session: int) -> ObjectView | None:
        """The best crop of an object in a visit, or of the place where it would stand there."""
        item = self._objects[object_id]
        sighting = item.sighting(session)
        if sighting is not None:
            ranked = sorted(sighting.keyframes[:6], key=lambda k: -self._area(item, sighting, k))
            for keyframe in ranked:
                view = self._object_crop(object_id, session, keyframe)
                if view is not None:
                    return view
        other = item.sighting(1 - session)
        place = other or sighting
        return None if place is None else self._best_place(place, session)

    def _object_crop(self, object_id: int, session: int, keyframe: int) -> ObjectView | None:
        camera = self._session(session).keyframes[keyframe].camera
        mask = self._mask(session, keyframe) == object_id
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
        visit, origin = self._session(session), self._session(place.session)
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
        box = crops.crop_around(bounds, self._session(session).keyframes[keyframe].camera)
        place = (
            (bounds.left - box.left) / box.width * 100,
            (bounds.top - box.top) / box.height * 100,
            bounds.width / box.width * 100,
            bounds.height / box.height * 100,
        )
        return ObjectView(session, keyframe, box, self._crop_url(session, keyframe, box), "", place)

    def same_viewpoint_url(self, session: int, keyframe: int, box: PixelBox | None = None) -> str:
        """The other visit from a keyframe's camera, whole or a crop; empty if nothing sees this view."""
        if not self._session(session).keyframes[keyframe].covisible:
            return ""
        if box is None:
            return self._register(
                f"same/{session}/{keyframe}.jpg", lambda: self._same_viewpoint(session, keyframe, None)
            )
        left, top, width, height = (int(v) for v in (box.left, box.top, box.width, box.height))
        return self._register(
            f"same/{session}/{keyframe}/{left}-{top}-{width}-{height}.jpg",
            lambda: self._same_viewpoint(session, keyframe, (left, top, width, height)),
        )

    def _same_viewpoint(
        self, session: int, keyframe: int, box: tuple[int, int, int, int] | None
    ) -> Asset | None:
        found = self._same(session, keyframe)
        if found is None:
            return None
        image, known = found
        if box is not None:
            left, top, width, height = box
            rows, columns = slice(top, top + height), slice(left, left + width)
            image, known = image[rows, columns], known[rows, columns]
            size = (_CROP_WIDTH_PX, round(_CROP_WIDTH_PX / crops.CROP_ASPECT))
            image = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)
            known = cv2.resize(known.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        picture = heatmap_colours.hatched(image, ~known)
        encoded, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        return Asset("image/jpeg", data.tobytes()) if encoded else None

    def _crop_url(self, session: int, keyframe: int, box: PixelBox) -> str:
        left, top, width, height = (int(v) for v in (box.left, box.top, box.width, box.height))
        name = f"crop/{session}/{keyframe}/{left}-{top}-{width}-{height}.jpg"
        return self._register(name, lambda: self._crop(session, keyframe, left, top, width, height))

    def _crop(
        self, session: int, keyframe: int, left: int, top: int, width: int, height: int
    ) -> Asset | None:
        visit = self._session(session)
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
        picture = cv2.resize(part, size, interpolation=cv2.INTER_CUBIC)
        encoded, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, self._crop_quality])
        return Asset("image/jpeg", data.tobytes()) if encoded else None

    def _before_after(self, object_id: int) -> BeforeAfter:
        """Pictures of both visits, from a pair of keyframes that were compared where there is one."""
        item = self._objects[object_id]
        pair = self._compared_pair(item)
        if pair is None:
            return BeforeAfter(self.best(object_id, 0), self.best(object_id, 1), (), compared=False)
        views = tuple(self._view_in(item, session, pair[session]) for session in (0, 1))
        before, after = views
        if before is None or after is None:
            return BeforeAfter(self.best(object_id, 0), self.best(object_id, 1), (), compared=False)
        links = self._result.links(*pair)
        if links is None:
            return BeforeAfter(before, after, (), compared=False)
        masks = [
            self._mask(s, pair[s]) == object_id if item.sighting(s) is not None else None for s in (0, 1)
        ]
        cameras = [self._session(s).keyframes[pair[s]].camera for s in (0, 1)]
        lines = crops.link_lines(links, masks[0], masks[1], (before.box, cameras[0]), (after.box, cameras[1]))
        return BeforeAfter(before, after, lines, compared=True)

    def _view_in(self, item: MapObject, session: int, keyframe: int) -> ObjectView | None:
        if item.sighting(session) is not None:
            return self._object_crop(item.object_id, session, keyframe)
        place = item.sighting(1 - session)
        if place is None:
            return None
        record = self._session(session).keyframes[keyframe]
        bounds = crops.project_box(
            np.array(place.box_min_world_m),
            np.array(place.box_max_world_m),
            record.camera,
            record.T_world_camera,
        )
        return None if bounds is None else self._place_view(session, keyframe, bounds)

    def _compared_pair(self, item: MapObject) -> tuple[int, int] | None:
        """Keyframes (previous, current) that show the object well and were matched with each other."""
        before, after = item.sighting(0), item.sighting(1)
        seen = before or after
        if seen is None:
            return None
        opposite = after if before is not None else None
        low, high = np.array(seen.box_min_world_m), np.array(seen.box_max_world_m)
        for keyframe in seen.keyframes[:8]:
            if not self._shows(item, seen, keyframe):
                continue
            for pair in self._session(seen.session).keyframes[keyframe].covisible:
                other = pair.other_keyframe
                if opposite is not None:
                    suits = self._shows(item, opposite, other)
                else:
                    record = self._session(1 - seen.session).keyframes[other]
                    suits = crops.visible_share(low, high, record.camera, record.T_world_camera) > 0.5
                ordered = (keyframe, other) if seen.session == 0 else (other, keyframe)
                if suits and self._result.links(*ordered) is not None:
                    return ordered
        return None

    def _shows(self, item: MapObject, sighting: Sighting, keyframe: int) -> bool:
        """Whether a keyframe shows more than a scrap of an object: a few pixels enlarged show nobody what."""
        if keyframe not in sighting.keyframes:
            return False
        best = self._area(item, sighting, sighting.keyframes[0])
        return self._area(item, sighting, keyframe) >= max(SCRAP_SHARE * best, 1)

    def _area(self, item: MapObject, sighting: Sighting, keyframe: int) -> int:
        return int(np.count_nonzero(self._mask(sighting.session, keyframe) == item.object_id))
