"""An opened result as the viewer needs it: which sighting to show, in which order, with which pictures.

Shared by all inspectors; what it holds is replaced as a whole when somebody corrects an object. Methods
that read images run on worker threads.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from oasisview import heatmap_colours
from oasisview.assets import Asset, AssetTable
from oasisview.crops import PixelBox
from oasisview.matrix_window import display_order
from oasisview.object_views import BeforeAfter, ObjectView, ObjectViews
from oasisview.priority import priority
from oasisview.review import CorrectedMap, Fragment, corrected_result
from oasisview.wording import Limits
from pipeline.errors import ResultError
from pipeline.result import (
    ChangeLabel,
    CovisiblePair,
    MapObject,
    Result,
    ScoreMatrix,
    SessionResult,
    Sighting,
)

# A shown keyframe is kept on selection if the object covers at least this share of it.
VISIBLE_SHARE = 0.004


class Catalogue:
    """Facts and pictures of a result, as corrected so far; ``assets`` serves the pictures.

    Raises:
        ResultError: the result holds fewer than two visits.
    """

    def __init__(self, result: Result, assets: AssetTable) -> None:
        if len(result.sessions) < 2:
            raise ResultError(
                f"{result.path} holds a single visit", "process two visits with `oasisview run`"
            )
        self.result = self._machine = result
        self.limits = Limits.of(result)
        self.objects: dict[int, MapObject] = {item.object_id: item for item in result.objects}
        self._assets = assets
        self._registered: set[str] = set()
        stamp = f"{result.path.resolve()}|{sorted(map(str, result.manifest.items()))}"
        # Keys stand for content that never changes: another result on the same port gets other keys.
        self._prefix = hashlib.sha256(stamp.encode()).hexdigest()[:12]
        self._object_of: Mapping[Fragment, int] = {}
        self._forget_pictures()

    def follow(self, corrected: CorrectedMap) -> None:
        """Show objects as people corrected them; call before pages are told of the change."""
        self.result = corrected_result(self._machine, corrected)
        self.objects = {number: entry.item for number, entry in corrected.objects.items()}
        if corrected.object_of != self._object_of:
            self._object_of = corrected.object_of
            self._forget_pictures()

    def _forget_pictures(self) -> None:
        """Which pictures show an object depends on what is one object."""
        self._thumbnail = lru_cache(maxsize=4096)(self._tight_crop)
        self.mask = lru_cache(maxsize=64)(self._mask)
        self._views = ObjectViews(self.result, self.mask, self._register)

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
        """How much a look at the object is worth (``oasisview.priority``)."""
        return priority(item)

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
        found = int(ids[instance]) if 0 <= instance < len(ids) else 0
        return found or None

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

    def view_of(self, object_id: int, session: int) -> ObjectView | None:
        """The best crop of an object in a visit, or of the place where it would stand there."""
        return self._views.best(object_id, session)

    def before_after(self, object_id: int) -> BeforeAfter:
        """Pictures of both visits, from a pair of keyframes that were compared where there is one."""
        return self._views.before_after(object_id)

    def image_url(self, session: int, keyframe: int) -> str:
        """The keyframe's colour image."""
        path = self.session(session).image_path(keyframe)
        return self._register(
            f"image/{session}/{keyframe}.jpg", lambda: Asset("image/jpeg", path.read_bytes())
        )

    def same_viewpoint_url(self, session: int, keyframe: int, box: PixelBox | None = None) -> str:
        """The other visit as this keyframe's camera would have seen it; empty if nothing sees this view."""
        return self._views.same_viewpoint_url(session, keyframe, box)

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
        return self._views.tight_url(view, object_id)

    def matrix_url(self, kind: str) -> str:
        """The whole score matrix as an image, one pixel a cell; kind is ``sigma`` or ``s_bar``."""
        matrix = self.result.score_matrix
        # Corrected identities order it anew, and what an address stands for never changes.
        ids = np.concatenate([matrix.row_object_ids, matrix.column_object_ids])
        order = hashlib.sha256(ids.tobytes()).hexdigest()[:8]
        return self._register(f"matrix/{order}/{kind}.png", lambda: self._matrix(kind, matrix))

    def _matrix(self, kind: str, matrix: ScoreMatrix) -> Asset | None:
        values = np.asarray(matrix.sigma if kind == "sigma" else matrix.s_bar, np.float32)
        # As the panel draws it: partners on the diagonal.
        values = values[np.ix_(*display_order(matrix))]
        table = heatmap_colours.ramp(heatmap_colours.CIVIDIS)
        return _png(table[np.round(np.clip(np.nan_to_num(values), 0, 1) * 255).astype(np.uint8)])

    def _register(self, name: str, make: Callable[[], Asset | None]) -> str:
        key = f"{self._prefix}/{name}"
        if key in self._registered:
            return f"/asset/{key}"
        url = self._assets.register(key, make)
        self._registered.add(key)
        return url


def changed_labels() -> frozenset[ChangeLabel]:
    """The labels that the queue shows at first: everything but static."""
    return frozenset(label for label in ChangeLabel if label is not ChangeLabel.STATIC)


def _png(image_rgb: NDArray[np.uint8]) -> Asset | None:
    encoded, data = cv2.imencode(".png", cv2.cvtColor(image_rgb, cv2.COLOR_RGB2BGR))
    return Asset("image/png", data.tobytes()) if encoded else None
