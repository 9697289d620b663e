"""Light of a visit, drawn anew for each: lamps of a room, or sun and sky."""

from __future__ import annotations

import numpy as np

from pipeline.synthetic.props import Workshop
from pipeline.synthetic.world import Lamp, Lighting


def white(shop: Workshop, warm: float = 0.0) -> np.ndarray:
    """A nearly white light; ``warm`` in [-1, 1] goes from blue to orange."""
    return np.array([1 + 0.22 * warm, 1.0, 1 - 0.3 * warm]) * shop.rng.normal(1, 0.015, 3)


def room_lighting(shop: Workshop, width: float, depth: float, height: float) -> Lighting:
    """Ceiling lamps, the first of which casts shadows, and light thrown back by the walls."""
    warm = shop.between(-0.6, 0.9)
    lamps = []
    for _ in range(shop.count(2, 4)):
        at = np.array([shop.between(-0.33, 0.33) * width, shop.between(-0.33, 0.33) * depth, height - 0.1])
        lamps.append(Lamp(at, white(shop, warm) * shop.between(0.7, 1.2), reach=shop.between(2.2, 3.2)))
    ambient = white(shop, warm * 0.7) * shop.between(0.3, 0.5)
    return Lighting(tuple(lamps), ambient, ambient * 0.7, ambient, exposure=shop.between(0.9, 1.25))


def daylight(shop: Workshop) -> Lighting:
    """Sun from a drawn direction through a clear to overcast sky."""
    overcast = shop.between(0.0, 0.8)
    elevation, azimuth = np.deg2rad(shop.between(24, 62)), shop.between(-np.pi, np.pi)
    direction = np.array(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    warm = 0.9 * (1 - elevation / np.deg2rad(62))
    sun = Lamp(direction, white(shop, warm) * (1.9 * (1 - 0.75 * overcast)), is_sun=True)
    sky = np.array([0.62, 0.78, 1.0]) * (1 - overcast) + np.array([0.85, 0.87, 0.9]) * overcast
    ambient = sky * shop.between(0.5, 0.65)
    return Lighting(
        (sun,), ambient, ambient * np.array([0.5, 0.46, 0.42]), sky, exposure=shop.between(0.9, 1.2)
    )
