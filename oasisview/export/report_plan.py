"""The report's plan view: the current map from above, with a numbered sign on every change."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from oasisview.export.exporter import CHUNK_POINTS, ReviewedResult
from oasisview.export.footprints import Footprint
from oasisview.export.report_marks import COLOURS, mark
from oasisview.export.report_words import Change, is_standing
from oasisview.scene.ground_plan import GroundPlan
from oasisview.scene.level_of_detail import ceiling_height
from oasisview.scene.map_points import muted
from pipeline.result import ChangeLabel, SessionResult

LONG_SIDE_PX = 1000
MARGIN = 0.03  # of the longer side
SAMPLE = 200_000
Footprints = Mapping[tuple[int, int], Footprint]


@dataclass(frozen=True)
class Sheet:
    """The drawing: where the plan's metres lie on it. y runs down, as in images."""

    left_m: float
    top_m: float
    metres_per_px: float
    width_px: int
    height_px: int

    def to_px(self, points_m: NDArray[np.floating]) -> NDArray[np.float64]:
        """(N, 2) plan metres to (N, 2) pixels."""
        points = np.asarray(points_m, np.float64)
        x = (points[..., 0] - self.left_m) / self.metres_per_px
        y = (self.top_m - points[..., 1]) / self.metres_per_px
        return np.stack([x, y], axis=-1)


def plan_svg(
    reviewed: ReviewedResult, changes: Sequence[Change], plan: GroundPlan, ground: Footprints
) -> str:
    """An inline ``<svg>`` with the map as an embedded picture."""
    session = reviewed.result.sessions[-1]
    sheet, ceiling_m = _sheet(session, changes, plan, ground)
    picture = _picture(session, plan, sheet, ceiling_m)
    encoded, data = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 82])
    uri = base64.b64encode(data.tobytes()).decode() if encoded else ""
    room = sheet.width_px * sheet.height_px / max(len(changes), 1)
    radius = float(np.clip(0.16 * np.sqrt(room), 9, 16))
    anchors = _anchors(changes, ground, sheet)
    places = _apart(anchors, radius, sheet)
    drawn = [
        *(_ground(change, ground, sheet, radius) for change in changes),
        *(_leader(a, p, radius) for a, p in zip(anchors, places, strict=True)),
        *_pairs(reviewed, changes, places, radius),
        *(_numbered(change, p, radius) for change, p in zip(changes, places, strict=True)),
        _scale_bar(sheet),
        _axes(plan, sheet),
    ]
    return (
        f'<svg class="plan" viewBox="0 0 {sheet.width_px} {sheet.height_px}" role="img" '
        f'aria-label="Plan of the place from above with {len(changes)} numbered changes">'
        f'<image href="data:image/jpeg;base64,{uri}" width="{sheet.width_px}" height="{sheet.height_px}"/>'
        f"{''.join(drawn)}</svg>"
    )


def _sheet(
    session: SessionResult, changes: Sequence[Change], plan: GroundPlan, ground: Footprints
) -> tuple[Sheet, float | None]:
    step = max(1, len(session.points_world) // SAMPLE)
    sample = plan.project(session.points_world[::step])
    cameras = plan.project(np.array([k.T_world_camera[:3, 3] for k in session.keyframes]).reshape(-1, 3))
    corners = [ground[key].polygon_m for c in changes for key in _keys(c) if key in ground]
    if len(sample):
        corners.append(np.percentile(sample[:, :2], [0.2, 99.8], axis=0))
    around = np.concatenate(corners) if corners else np.array([[-1.0, -1.0], [1.0, 1.0]])
    low, high = around.min(axis=0), around.max(axis=0)
    margin = MARGIN * max(float((high - low).max()), 0.5)
    low, high = low - margin, high + margin
    metres_per_px = float((high - low).max()) / LONG_SIDE_PX
    width, height = (max(int(np.ceil(side / metres_per_px)), 60) for side in high - low)
    sheet = Sheet(float(low[0]), float(high[1]), metres_per_px, width, height)
    return sheet, ceiling_height(sample[:, 2], cameras[:, 2])


def _picture(
    session: SessionResult, plan: GroundPlan, sheet: Sheet, ceiling_m: float | None
) -> NDArray[np.uint8]:
    """The map from above without its ceiling, paled so that signs stand out; white where nothing is."""
    size = sheet.width_px * sheet.height_px
    highest = np.full(size, -np.inf)
    colour = np.full((size, 3), 255, np.uint8)
    for start in range(0, len(session.points_world), CHUNK_POINTS):
        points = plan.project(session.points_world[start : start + CHUNK_POINTS])
        cells = np.floor(sheet.to_px(points[:, :2])).astype(np.int64)
        shown = ((cells >= 0) & (cells < [sheet.width_px, sheet.height_px])).all(axis=1)
        if ceiling_m is not None:
            shown &= points[:, 2] < ceiling_m
        chosen = np.flatnonzero(shown)
        cell = cells[chosen, 1] * sheet.width_px + cells[chosen, 0]
        order = np.lexsort((points[chosen, 2], cell))
        last = order[np.append(cell[order][1:] != cell[order][:-1], True)] if len(order) else order
        higher = last[points[chosen[last], 2] > highest[cell[last]]]
        highest[cell[higher]] = points[chosen[higher], 2]
        colour[cell[higher]] = session.colours[start : start + CHUNK_POINTS][chosen[higher]]
    image = muted(colour, dark=False).reshape(sheet.height_px, sheet.width_px, 3)
    return _without_gaps(image, np.isfinite(highest).reshape(image.shape[:2]))


def _without_gaps(image: NDArray[np.uint8], known: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Give the empty pixels between points of a surface the mean of what is beside them."""
    kernel = np.ones((5, 5), np.uint8)
    closed = cv2.morphologyEx(known.astype(np.uint8), cv2.MORPH_CLOSE, kernel).astype(bool)
    weight = cv2.blur(known.astype(np.float32), (5, 5))
    mean = cv2.blur(np.where(known[:, :, None], image, 0).astype(np.float32), (5, 5))
    filled = np.where(known[:, :, None], image, mean / np.maximum(weight, 1e-6)[:, :, None])
    return np.where((known | (closed & (weight > 0)))[:, :, None], filled, 255).astype(np.uint8)


def _keys(change: Change) -> list[tuple[int, int]]:
    return [(change.item.object_id, sighting.session) for sighting in change.item.sightings]


def _middle(footprint: Footprint, sheet: Sheet) -> NDArray[np.float64]:
    return sheet.to_px((footprint.polygon_m.min(axis=0) + footprint.polygon_m.max(axis=0)) / 2)


def _anchors(changes: Sequence[Change], ground: Footprints, sheet: Sheet) -> NDArray[np.float64]:
    centre = np.array([sheet.width_px / 2, sheet.height_px / 2])
    anchors = [_middle(ground[_keys(change)[-1]], sheet) if _keys(change) else centre for change in changes]
    return np.array(anchors).reshape(-1, 2)


def _apart(anchors: NDArray[np.float64], radius: float, sheet: Sheet) -> NDArray[np.float64]:
    """Places near the anchors where signs do not cover each other."""
    places = anchors + 1e-3 * np.stack([np.cos(np.arange(len(anchors))), np.sin(np.arange(len(anchors)))], 1)
    least = 2.25 * radius
    for _ in range(300):
        between = places[:, None] - places[None, :]
        distance = np.linalg.norm(between, axis=2) + np.eye(len(places)) * 1e9
        overlap = np.maximum(least - distance, 0)
        if not overlap.any():
            break
        places = (
            places + (between / np.maximum(distance, 1e-6)[..., None] * overlap[..., None]).sum(axis=1) * 0.4
        )
        places = np.clip(places, radius, np.array([sheet.width_px, sheet.height_px]) - radius)
    return places


def _ground(change: Change, ground: Footprints, sheet: Sheet, radius: float) -> str:
    """The object's outline; for moved ones where it was, too, and an arrow between the two."""
    name, keys = change.name, [key for key in _keys(change) if key in ground]
    if not keys:
        return ""
    fill = {"disappeared": "url(#lines)", "unknown": "url(#dots)"}.get(name, COLOURS[name])
    opacity = 1 if fill.startswith("url") else 0.4
    dash = ' stroke-dasharray="7 4"' if name == "disappeared" else ""
    drawn = _polygon(ground[keys[-1]], sheet, f'fill="{fill}" fill-opacity="{opacity}"{dash}', name)
    if change.label is ChangeLabel.MOVED and len(keys) > 1:
        drawn = _polygon(ground[keys[0]], sheet, 'fill="none" stroke-dasharray="7 4"', name) + drawn
        (x1, y1), (x2, y2) = (_middle(ground[key], sheet) for key in (keys[0], keys[-1]))
        # The head has to be seen beside the number that stands on the end.
        length = float(np.hypot(x2 - x1, y2 - y1))
        short = max(length - 1.4 * radius, 0.5 * length) / max(length, 1e-6)
        x2, y2 = x1 + (x2 - x1) * short, y1 + (y2 - y1) * short
        line = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
        drawn += (
            f'<line {line} stroke="#fff" stroke-width="7" stroke-opacity=".8"/>'
            f'<line {line} stroke="{COLOURS[name]}" stroke-width="3.5" marker-end="url(#head)"/>'
        )
    return drawn


def _polygon(footprint: Footprint, sheet: Sheet, look: str, name: str) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in sheet.to_px(footprint.polygon_m))
    return f'<polygon points="{points}" {look} stroke="{COLOURS[name]}" stroke-width="2.5"/>'


def _leader(anchor: NDArray[np.float64], place: NDArray[np.float64], radius: float) -> str:
    if np.linalg.norm(place - anchor) < 0.8 * radius:
        return ""
    (x1, y1), (x2, y2) = anchor, place
    return (
        f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="#14171c" stroke-width="1.5"/>'
    )


def _pairs(
    reviewed: ReviewedResult, changes: Sequence[Change], places: NDArray[np.float64], radius: float
) -> list[str]:
    """A purple band around the signs of each pair of which one took the other's place."""
    row = {change.item.object_id: i for i, change in enumerate(changes)}
    bands = []
    for event in reviewed.replaced:
        if is_standing(reviewed, event):
            (x1, y1), (x2, y2) = places[row[event.disappeared_id]], places[row[event.appeared_id]]
            bands.append(
                f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke-linecap="round" '
                f'stroke="{COLOURS["replaced"]}" stroke-width="{2 * radius + 9:.1f}"/>'
            )
    return bands


def _numbered(change: Change, place: NDArray[np.float64], radius: float) -> str:
    sign = mark(change.name, float(place[0]), float(place[1]), radius, str(change.number))
    return f'<a href="#change-{change.number}">{sign}</a>'


def _scale_bar(sheet: Sheet) -> str:
    """A bar of 1, 2 or 5 times a power of ten metres, about a fifth of the width."""
    wanted = sheet.width_px * sheet.metres_per_px / 5
    power = 10.0 ** np.floor(np.log10(wanted))
    metres = max(f * power for f in (1, 2, 5) if f * power <= wanted or f == 1)
    length, y = metres / sheet.metres_per_px, sheet.height_px - 16
    words = f"{metres:g} m" if metres >= 1 else f"{metres * 100:g} cm"
    return (
        f'<rect x="8" y="{y - 26}" width="{length + 16:.1f}" height="36" rx="4" fill="#fff" '
        f'fill-opacity=".85"/><path d="M16 {y - 6}V{y}H{16 + length:.1f}V{y - 6}" fill="none" '
        f'stroke="#14171c" stroke-width="2.5"/>'
        f'<text x="{16 + length / 2:.1f}" y="{y - 8}" class="scale">{words}</text>'
    )


def _axes(plan: GroundPlan, sheet: Sheet) -> str:
    x, y = sheet.width_px - 78, sheet.height_px - 20
    across, along = (name.split()[-1] for name in plan.names[:2])
    return (
        f'<rect x="{x - 16}" y="{y - 66}" width="88" height="80" rx="4" fill="#fff" fill-opacity=".85"/>'
        f'<path d="M{x} {y - 46}V{y}H{x + 46}M{x - 5} {y - 39}L{x} {y - 47}L{x + 5} {y - 39}M{x + 39} {y - 5}'
        f'L{x + 47} {y}L{x + 39} {y + 5}" fill="none" stroke="#14171c" stroke-width="2"/>'
        f'<text x="{x}" y="{y - 52}" class="scale">{along}</text>'
        f'<text x="{x + 58}" y="{y + 5}" class="scale">{across}</text>'
    )
