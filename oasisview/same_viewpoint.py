"""One visit seen from a camera of the other one, so that both can be laid over each other.

What the camera would have measured is drawn from the map of the visit that is to be shown; its pixels are
then looked up in the pictures of that visit which saw these places unoccluded. Nothing is invented: what no
picture shows stays unknown. Pure arrays but for reading pictures, so it runs on worker threads.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from oasisview.scene.level_of_detail import point_spacing_m
from pipeline.camera import PinholeCamera, invert_rigid, transform_points
from pipeline.result import Result

# Maps are about as dense as the pixels of a picture of this width are wide a few metres away.
_DEPTH_WIDTH_PX = 320
_MIN_DEPTH_M = 0.15
_LARGEST_RADIUS_PX = 3
# A place is hidden from a picture if something stands this much nearer there.
_OCCLUSION_SHARE, _OCCLUSION_M = 0.03, 0.05
MAX_PICTURES = 6
_SPACING_SAMPLE = 200_000
# Specks are not worth another picture.
_ENOUGH_MISSING = 0.004


def drawn_depth(
    points_world: NDArray[np.floating],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.floating],
    spacing_m: float,
) -> NDArray[np.float32]:
    """(h, w) depth of a point map along a camera's axis, metres; NaN where nothing is.

    Every point is as large as ``spacing_m``, the distance of neighbouring points, looks from where it is;
    gaps of up to four pixels that are left are closed.
    """
    step = max(1, round(camera.width / _DEPTH_WIDTH_PX))
    small = camera.strided(step)
    T = invert_rigid(np.asarray(T_world_camera, np.float64)).astype(np.float32)
    local = np.asarray(points_world, np.float32) @ T[:3, :3].T + T[:3, 3]
    local = local[local[:, 2] > _MIN_DEPTH_M]
    column = np.rint(local[:, 0] / local[:, 2] * small.fx + small.cx).astype(np.int64)
    row = np.rint(local[:, 1] / local[:, 2] * small.fy + small.cy).astype(np.int64)
    inside = (column >= 0) & (column < small.width) & (row >= 0) & (row < small.height)
    row, column, depth = row[inside], column[inside], local[inside, 2]
    radius = np.clip(np.ceil(0.5 * spacing_m * small.fx / depth - 0.5), 0, _LARGEST_RADIUS_PX).astype(
        np.int64
    )
    padded = np.full((small.height + 2 * _LARGEST_RADIUS_PX, small.width + 2 * _LARGEST_RADIUS_PX), np.inf)
    buffer = padded.astype(np.float32).reshape(-1)
    place = (row + _LARGEST_RADIUS_PX) * padded.shape[1] + column + _LARGEST_RADIUS_PX
    for size in range(_LARGEST_RADIUS_PX + 1):
        of_size = radius >= size
        ring = [
            (down, across)
            for down in range(-size, size + 1)
            for across in range(-size, size + 1)
            if max(abs(down), abs(across)) == size
        ]
        for down, across in ring:
            np.minimum.at(buffer, place[of_size] + down * padded.shape[1] + across, depth[of_size])
    margin = slice(_LARGEST_RADIUS_PX, -_LARGEST_RADIUS_PX)
    found = buffer.reshape(padded.shape)[margin, margin].copy()
    around = np.ones((5, 5), np.uint8)
    # A surface closes over its own gaps, and does not grow beyond its outline.
    closed = cv2.morphologyEx(np.isfinite(found).astype(np.uint8), cv2.MORPH_CLOSE, around) > 0
    nearest = cv2.erode(found, around, borderType=cv2.BORDER_REPLICATE)
    found = np.where(closed & ~np.isfinite(found), nearest, found)
    near = cv2.erode(found, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_REPLICATE)
    is_near = (found <= near * 1.08 + 0.05).astype(np.float32)
    # A lone point behind its surroundings shines through a gap of what is in front.
    shines_through = (is_near == 0) & (cv2.blur(is_near, (3, 3)) > 0.6)
    found = np.where(shines_through, near, found)
    return np.where(np.isfinite(found), found, np.nan).astype(np.float32)


class SameViewpoint:
    """Pictures of the visits of a result from each other's cameras."""

    def __init__(self, result: Result) -> None:
        self._result = result
        self._depth = lru_cache(maxsize=48)(self._drawn)
        self._spacing_m = lru_cache(self._spacing)

    def _spacing(self, session: int) -> float:
        points = self._result.sessions[session].points_world
        # Neighbours in the map are neighbours in the file: a piece of it tells, and reads fast.
        start = max(0, len(points) // 2 - _SPACING_SAMPLE // 2)
        return point_spacing_m(np.asarray(points[start : start + _SPACING_SAMPLE]))

    def _drawn(self, of_session: int, session: int, keyframe: int) -> NDArray[np.float32]:
        record = self._result.sessions[session].keyframes[keyframe]
        points = self._result.sessions[of_session].points_world
        return drawn_depth(points, record.camera, record.T_world_camera, self._spacing_m(of_session))

    def picture(self, session: int, keyframe: int) -> tuple[NDArray[np.uint8], NDArray[np.bool_]] | None:
        """The other visit as a keyframe's camera would have seen it.

        Returns:
            (H, W, 3) RGB and (H, W) where it is known; None where no keyframe of the other visit sees this
            view.
        """
        record = self._result.sessions[session].keyframes[keyframe]
        if not record.covisible:
            return None
        other = 1 - session
        camera = record.camera
        depth = cv2.resize(
            self._depth(other, session, keyframe),
            (camera.width, camera.height),
            interpolation=cv2.INTER_NEAREST,
        )
        known = np.isfinite(depth)
        points = transform_points(record.T_world_camera, camera.backproject(np.nan_to_num(depth, nan=1.0)))
        points = points.reshape(-1, 3)
        image = np.zeros((camera.height * camera.width, 3), np.uint8)
        missing = known.reshape(-1).copy()
        for pair in record.covisible[:MAX_PICTURES]:
            if missing.mean() < _ENOUGH_MISSING:
                break
            wanted = np.flatnonzero(missing)
            colours, seen = self._looked_up(other, pair.other_keyframe, points[wanted])
            image[wanted[seen]] = colours[seen]
            missing[wanted[seen]] = False
        shape = (camera.height, camera.width)
        return image.reshape(*shape, 3), (known.reshape(-1) & ~missing).reshape(shape)

    def _looked_up(
        self, session: int, keyframe: int, points_world: NDArray[np.floating]
    ) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """(N, 3) colours of places in a picture, and (N,) whether it shows them."""
        visit = self._result.sessions[session]
        record = visit.keyframes[keyframe]
        camera = record.camera
        none = np.zeros((len(points_world), 3), np.uint8), np.zeros(len(points_world), bool)
        picture = cv2.imread(str(visit.image_path(keyframe)), cv2.IMREAD_COLOR)
        if picture is None:
            return none
        pixels, along = camera.project(transform_points(invert_rigid(record.T_world_camera), points_world))
        inside = (along > _MIN_DEPTH_M) & (pixels >= 0).all(axis=1)
        inside &= (pixels[:, 0] <= camera.width - 1) & (pixels[:, 1] <= camera.height - 1)
        depth = self._depth(session, session, keyframe)
        row = np.clip(pixels[:, 1] * depth.shape[0] / camera.height, 0, depth.shape[0] - 1)
        column = np.clip(pixels[:, 0] * depth.shape[1] / camera.width, 0, depth.shape[1] - 1)
        at = np.zeros(len(pixels), np.float32)
        at[inside] = depth[row[inside].astype(np.int64), column[inside].astype(np.int64)]
        with np.errstate(invalid="ignore"):
            seen = inside & (along <= at * (1 + _OCCLUSION_SHARE) + _OCCLUSION_M)
        across = picture.shape[1] / camera.width, picture.shape[0] / camera.height
        colours = none[0]
        chosen = np.flatnonzero(seen)
        if len(chosen):
            mapped = (pixels[chosen] * across).astype(np.float32)
            # remap takes at most 32767 rows or columns at once.
            width = 4096
            padded = np.zeros((-(-len(chosen) // width) * width, 2), np.float32)
            padded[: len(chosen)] = mapped
            grid = padded.reshape(-1, width, 2)
            found = cv2.remap(
                picture, grid[..., 0], grid[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
            )
            colours[chosen] = found.reshape(-1, 3)[: len(chosen), ::-1]
        return colours, seen
