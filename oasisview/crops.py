"""Where an object stands in a picture: its mask, a frame around it, and its place in the other visit.

Boxes are (left, top, width, height) in pixels of the keyframe's camera. Pure arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from oasisview.scene.outlines import box_corners
from pipeline.camera import PinholeCamera, invert_rigid, transform_points
from pipeline.result import PatchLinks

CROP_ASPECT = 4 / 3


@dataclass(frozen=True)
class PixelBox:
    """A rectangle in an image, pixels; may be fractional."""

    left: float
    top: float
    width: float
    height: float


@dataclass(frozen=True)
class LinkLine:
    """One patch match drawn between two crops, both ends as shares of their crop in [0, 1].

    Attributes:
        before, after: (x, y) in the earlier and the later crop.
        score: match quality; lands_on_object: whether it ends on the same object.
    """

    before: tuple[float, float]
    after: tuple[float, float]
    score: float
    lands_on_object: bool


def mask_box(mask: NDArray[np.bool_], camera: PinholeCamera) -> PixelBox | None:
    """Bounds of a mask of any resolution, in pixels of the camera; None where it is empty."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if len(rows) == 0:
        return None
    across, down = camera.width / mask.shape[1], camera.height / mask.shape[0]
    return PixelBox(
        float(columns[0]) * across,
        float(rows[0]) * down,
        float(columns[-1] + 1 - columns[0]) * across,
        float(rows[-1] + 1 - rows[0]) * down,
    )


def crop_around(box: PixelBox, camera: PinholeCamera, scale: float = 1.5, margin_px: float = 40) -> PixelBox:
    """A 4:3 frame around a box with some surroundings, moved inside the image (whole pixels)."""
    width = max(box.width, box.height * CROP_ASPECT) * scale + margin_px
    width = min(width, camera.width, camera.height * CROP_ASPECT)
    height = width / CROP_ASPECT
    left = np.clip(box.left + box.width / 2 - width / 2, 0, camera.width - width)
    top = np.clip(box.top + box.height / 2 - height / 2, 0, camera.height - height)
    return PixelBox(float(int(left)), float(int(top)), float(max(int(width), 1)), float(max(int(height), 1)))


def project_box(
    low_world: NDArray[np.floating],
    high_world: NDArray[np.floating],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.floating],
    min_depth_m: float = 0.2,
) -> PixelBox | None:
    """Where world bounds appear in a keyframe, cut to the image; None if not wholly in front of it."""
    corners = transform_points(invert_rigid(T_world_camera), box_corners(low_world, high_world))
    pixels, depths = camera.project(corners)
    if depths.min() < min_depth_m:
        return None
    left, top = np.clip(pixels.min(axis=0), -0.5, [camera.width - 0.5, camera.height - 0.5]) + 0.5
    right, bottom = np.clip(pixels.max(axis=0), -0.5, [camera.width - 0.5, camera.height - 0.5]) + 0.5
    if right - left < 2 or bottom - top < 2:
        return None
    return PixelBox(float(left), float(top), float(right - left), float(bottom - top))


def visible_share(
    low_world: NDArray[np.floating],
    high_world: NDArray[np.floating],
    camera: PinholeCamera,
    T_world_camera: NDArray[np.floating],
) -> float:
    """Share of the bounds' projection that lies inside the image, in [0, 1] (0 if behind the camera)."""
    corners = transform_points(invert_rigid(T_world_camera), box_corners(low_world, high_world))
    pixels, depths = camera.project(corners)
    if depths.min() < 0.2:
        return 0.0
    size = np.maximum(pixels.max(axis=0) - pixels.min(axis=0), 1e-6)
    inside = project_box(low_world, high_world, camera, T_world_camera)
    return 0.0 if inside is None else float(inside.width * inside.height / (size[0] * size[1]))


def outline_path(mask: NDArray[np.bool_]) -> str:
    """Contours of a mask as an SVG path in a 100 x 100 view box; empty for an empty mask."""
    if not mask.any():
        return ""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    largest = sorted(contours, key=len, reverse=True)[:12]
    height, width = mask.shape
    parts = []
    for contour in largest:
        simple = cv2.approxPolyDP(contour, 0.8, closed=True)[:, 0, :]
        if len(simple) < 3:
            continue
        steps = (f"{(x + 0.5) / width * 100:.1f} {(y + 0.5) / height * 100:.1f}" for x, y in simple)
        parts.append("M" + "L".join(steps) + "Z")
    return "".join(parts)


def object_at(mask: NDArray[np.integer], u: float, v: float) -> int:
    """Object id under a place (u, v) in [0, 1] of an image; looks one pixel around thin objects."""
    height, width = mask.shape
    column, row = min(int(u * width), width - 1), min(int(v * height), height - 1)
    found = int(mask[row, column])
    if found:
        return found
    around = mask[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
    return int(around.max())


def link_lines(
    links: PatchLinks,
    mask_before: NDArray[np.bool_] | None,
    mask_after: NDArray[np.bool_] | None,
    crop_before: tuple[PixelBox, PinholeCamera],
    crop_after: tuple[PixelBox, PinholeCamera],
    limit: int = 14,
) -> tuple[LinkLine, ...]:
    """The strongest patch matches of an object between two crops.

    Matches start on the object where it was masked (before if it has a mask there, else after) and are
    left out where they end outside the other crop.
    """
    if mask_before is not None:
        start_mask, end_mask, to, score = mask_before, mask_after, links.forward, links.forward_score
        start_shape, end_shape = links.previous_shape, links.current_shape
        start_crop, end_crop = crop_before, crop_after
    elif mask_after is not None:
        start_mask, end_mask, to, score = mask_after, mask_before, links.backward, links.backward_score
        start_shape, end_shape = links.current_shape, links.previous_shape
        start_crop, end_crop = crop_after, crop_before
    else:
        return ()
    start_uv = _patch_centres(start_shape)
    on_object = _inside(start_mask, start_uv)
    starts = np.flatnonzero(on_object)
    if len(starts) == 0:
        return ()
    end_uv = _patch_centres(end_shape)[to[starts].astype(np.int64)]
    lands = _inside(end_mask, end_uv) if end_mask is not None else np.zeros(len(starts), bool)
    a, b = _to_crop(start_uv[starts], *start_crop), _to_crop(end_uv, *end_crop)
    shown = np.flatnonzero(((a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)).all(axis=1))
    # Those that end on the object first, then by quality.
    order = shown[np.lexsort((-score[starts][shown].astype(np.float32), ~lands[shown]))][:limit]
    lines = []
    for i in order:
        first, second = (float(a[i, 0]), float(a[i, 1])), (float(b[i, 0]), float(b[i, 1]))
        before, after = (first, second) if mask_before is not None else (second, first)
        lines.append(LinkLine(before, after, float(score[starts[i]]), bool(lands[i])))
    return tuple(lines)


def _patch_centres(shape: tuple[int, int]) -> NDArray[np.float64]:
    rows, columns = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
    return np.stack([(columns + 0.5) / shape[1], (rows + 0.5) / shape[0]], axis=1)


def _inside(mask: NDArray[np.bool_], uv: NDArray[np.floating]) -> NDArray[np.bool_]:
    height, width = mask.shape
    rows = np.minimum((uv[:, 1] * height).astype(np.int64), height - 1)
    columns = np.minimum((uv[:, 0] * width).astype(np.int64), width - 1)
    return mask[rows, columns]


def _to_crop(uv: NDArray[np.floating], crop: PixelBox, camera: PinholeCamera) -> NDArray[np.float64]:
    x = (uv[:, 0] * camera.width - crop.left) / crop.width
    y = (uv[:, 1] * camera.height - crop.top) / crop.height
    return np.stack([x, y], axis=1)
