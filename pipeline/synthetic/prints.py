"""Texture tiles with something printed on them: cartons, books, screens, posters, facades, plates."""

from __future__ import annotations

import string
from itertools import pairwise

import cv2
import numpy as np

from pipeline.synthetic.textures import Colour, Tile, mottled, noise, shaded

_LETTERS = list(string.ascii_uppercase + string.digits)


def vivid(rng: np.random.Generator, low: float = 40, high: float = 220) -> np.ndarray:
    """A saturated colour, (3,) in [0, 255]."""
    hue, saturation, value = rng.uniform(0, 180), rng.uniform(50, 190), rng.uniform(low, high)
    pixel = np.array([[[hue, saturation, value]]], dtype=np.uint8)
    return cv2.cvtColor(pixel, cv2.COLOR_HSV2RGB)[0, 0].astype(np.float64)


def word(rng: np.random.Generator, length: int) -> str:
    """Random capitals and digits."""
    return "".join(rng.choice(_LETTERS, length))


def write(tile: Tile, text: str, at: tuple[int, int], scale: float, colour: Colour, bold: int = 1) -> None:
    """Draw text into the tile; ``at`` is the left end of its base line."""
    tone = [float(c) for c in colour]
    cv2.putText(tile, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, tone, bold, cv2.LINE_AA)


def rectangle(
    tile: Tile, low: tuple[int, int], high: tuple[int, int], colour: Colour, line: int = -1
) -> None:
    """Fill (or outline, with ``line`` > 0) a rectangle of the tile."""
    cv2.rectangle(tile, low, high, [float(c) for c in colour], line)


def carton_face(rng: np.random.Generator, board: Colour, ink: Colour, size: int = 128) -> Tile:
    """Corrugated board with tape, a printed brand, symbols and a shipping label."""
    tile = shaded(board, noise(rng, size, 1.2) * 0.06 + noise(rng, size, 0.2, 6.0) * 0.04)
    if rng.random() < 0.75:
        middle, half = int(size * rng.uniform(0.42, 0.58)), int(rng.integers(5, 10))
        tape = np.clip(np.asarray(board) * rng.uniform(0.75, 1.25), 0, 255)
        rectangle(tile, (middle - half, 0), (middle + half, size), tape)
    write(
        tile,
        word(rng, int(rng.integers(3, 7))),
        (8, int(rng.integers(26, 60))),
        rng.uniform(0.6, 1.1),
        ink,
        2,
    )
    for _ in range(int(rng.integers(1, 4))):
        x, y = (int(v) for v in rng.integers(6, size - 34, 2))
        match int(rng.integers(4)):
            case 0:
                cv2.circle(
                    tile, (x + 12, y + 12), int(rng.integers(6, 14)), [float(c) for c in ink], 2, cv2.LINE_AA
                )
            case 1:
                rectangle(tile, (x, y), (x + int(rng.integers(12, 32)), y + int(rng.integers(6, 20))), ink)
            case 2:
                triangle = np.array([[x, y + 22], [x + 12, y], [x + 24, y + 22]], dtype=np.int32)
                cv2.fillPoly(tile, [triangle], [float(c) for c in ink], cv2.LINE_AA)
            case _:
                write(tile, word(rng, 4), (x, y + 14), 0.45, ink)
    x, y = int(rng.integers(4, size - 60)), int(rng.integers(size // 2, size - 42))
    rectangle(tile, (x, y), (x + 52, y + 36), (238, 236, 230))
    for line in range(3):
        write(tile, word(rng, int(rng.integers(4, 8))), (x + 3, y + 9 + line * 7), 0.25, (40, 40, 40))
    bars = np.cumsum(rng.integers(1, 4, 22))
    for left in bars[bars < 46]:
        rectangle(tile, (x + 3 + int(left), y + 25), (x + 3 + int(left), y + 34), (20, 20, 20))
    return tile


def picture(rng: np.random.Generator, size: int = 256) -> Tile:
    """A poster: overlapping shapes and a headline."""
    tile = mottled(rng, vivid(rng, 120, 240), 0.12, 1.4, size)
    for _ in range(int(rng.integers(8, 18))):
        tone = vivid(rng).tolist()
        centre = tuple(int(v) for v in rng.integers(0, size, 2))
        if rng.random() < 0.5:
            cv2.circle(tile, centre, int(rng.integers(8, size // 5)), tone, -1, cv2.LINE_AA)
        else:
            corners = (rng.normal(0, size / 7, (4, 2)) + centre).astype(np.int32)
            cv2.fillConvexPoly(tile, cv2.convexHull(corners), tone, cv2.LINE_AA)
    write(tile, word(rng, 6), (16, size - 24), 1.6, (245, 245, 245), 4)
    return tile


def screen(rng: np.random.Generator, size: int = 128) -> Tile:
    """A monitor showing windows with text and a chart."""
    tile = shaded(vivid(rng, 40, 110) * 0.7, noise(rng, size, 1.6) * 0.25)
    for _ in range(int(rng.integers(2, 4))):
        x, y = (int(v) for v in rng.integers(4, size // 2, 2))
        width, height = (int(v) for v in rng.integers(40, size - 20, 2))
        rectangle(tile, (x, y), (x + width, y + height), (225, 228, 232))
        rectangle(tile, (x, y), (x + width, y + 6), vivid(rng))
        for line in range(y + 12, min(y + height, size) - 2, 6):
            end = x + 4 + int(rng.uniform(0.2, 0.9) * width)
            cv2.line(tile, (x + 4, line), (end, line), vivid(rng, 30, 120).tolist(), 2)
    return tile


def book_spines(rng: np.random.Generator, books: int = 1, size: int = 64) -> Tile:
    """The backs of ``books`` books side by side, with titles."""
    tile = np.zeros((size, size, 3), dtype=np.uint8)
    edges = np.linspace(0, size, books + 1).astype(int)
    for left, right in pairwise(edges):
        colour = vivid(rng)
        tile[:, left:right] = shaded(colour, noise(rng, size, 1.1)[:, left:right] * 0.08)
        for _ in range(int(rng.integers(2, 5))):
            row = int(rng.integers(3, size - 6))
            tile[row : row + int(rng.integers(1, 8)), left:right] = np.clip(vivid(rng, 90, 255), 0, 255)
        tile[:, left] = tile[:, left] // 2
    return tile


def number_plate(rng: np.random.Generator, size: int = 64) -> Tile:
    """A car's number plate, stretched to a square."""
    tile = mottled(rng, (225, 225, 210), 0.05, size=size)
    write(tile, word(rng, 3), (2, 28), 0.85, (20, 20, 30), 2)
    write(tile, word(rng, 3), (2, 58), 0.85, (20, 20, 30), 2)
    return tile


def facade(rng: np.random.Generator, wall: Tile, columns: int = 3, rows: int = 3, size: int = 512) -> Tile:
    """Windows with frames, sills, curtains and reflections in a wall of the given tile."""
    repeat = size // wall.shape[0]
    tile = np.ascontiguousarray(np.tile(wall, (repeat, repeat, 1)))
    frame = np.clip(rng.uniform(90, 240) * rng.normal(1, 0.1, 3), 0, 255)
    step_x, step_y = size // columns, size // rows
    margin_x, margin_y = int(step_x * rng.uniform(0.18, 0.3)), int(step_y * rng.uniform(0.15, 0.25))
    for row in range(rows):
        for column in range(columns):
            x0, y0 = column * step_x + margin_x, row * step_y + margin_y
            x1, y1 = (column + 1) * step_x - margin_x, (row + 1) * step_y - margin_y
            rectangle(tile, (x0 - 6, y0 - 6), (x1 + 6, y1 + 6), frame)
            pane = shaded(rng.uniform(35, 110) * np.array([0.85, 1.0, 1.15]), noise(rng, 128, 1.7) * 0.35)
            tile[y0:y1, x0:x1] = cv2.resize(pane, (x1 - x0, y1 - y0))
            if rng.random() < 0.5:
                drop = int((y1 - y0) * rng.uniform(0.2, 0.7))
                rectangle(tile, (x0, y0), (x1, y0 + drop), np.clip(vivid(rng, 130, 230), 0, 255))
            middle = (x0 + x1) // 2
            rectangle(tile, (middle - 2, y0), (middle + 2, y1), frame)
            if rng.random() < 0.7:
                rectangle(tile, (x0, (y0 + y1) // 2 - 2), (x1, (y0 + y1) // 2 + 2), frame)
            rectangle(tile, (x0 - 10, y1 + 4), (x1 + 10, y1 + 12), frame * 0.75)
    return tile
