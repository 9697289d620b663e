"""Cars of a few families; each has its own paint flecks, dirt, plates and stickers."""

from __future__ import annotations

import numpy as np

from pipeline.synthetic import prints, textures
from pipeline.synthetic.props import Prop, Workshop
from pipeline.synthetic.shapes import Mesh, box, cylinder, join, prism
from pipeline.synthetic.textures import Colour

# Length, width, height, end of the hood, foot and top of the windscreen, top and foot of the rear window:
# metres, and fractions of the length from the front.
FAMILIES: dict[str, tuple[float, float, float, tuple[float, float, float, float]]] = {
    "hatchback": (3.95, 1.72, 1.48, (0.24, 0.40, 0.86, 0.97)),
    "sedan": (4.65, 1.80, 1.44, (0.27, 0.42, 0.72, 0.86)),
    "estate": (4.70, 1.80, 1.50, (0.26, 0.40, 0.90, 0.98)),
    "suv": (4.55, 1.88, 1.72, (0.25, 0.38, 0.88, 0.97)),
    "van": (4.90, 1.92, 1.98, (0.12, 0.27, 0.97, 0.99)),
}
PAINTS = [
    (200, 200, 202),
    (60, 62, 66),
    (120, 124, 130),
    (150, 32, 34),
    (36, 62, 120),
    (225, 222, 214),
    (46, 84, 62),
]


def car(shop: Workshop, family: str, paint: Colour, size: tuple[float, float, float] | None = None) -> Prop:
    """A car along x, its front towards +x."""
    base_length, base_width, base_height, cabin = FAMILIES[family]
    length, width, height = size or tuple(shop.similar((base_length, base_width, base_height), 0.025))
    body = shop.tile(_bodywork(shop, paint), gloss=0.16)
    glass = shop.tile(textures.mottled(shop.rng, (34, 40, 46), 0.3, 1.6, 128), gloss=0.85)
    rubber = shop.paint((32, 32, 33), 0.2)
    rim = shop.tile(prints.picture(shop.rng, 64) // 3 + np.uint8(110), gloss=0.15)
    lamp, red = shop.paint((225, 225, 220), 0.15, 0.5), shop.paint((170, 24, 22), 0.2, 0.4)
    plate = shop.tile(prints.number_plate(shop.rng))
    front, back = length / 2, -length / 2
    waist = height * shop.between(0.56, 0.6)
    hood, foot, rear_top, rear_foot = (front - share * length for share in cabin)
    lower = [
        (back + 0.06, 0.28),
        (front - 0.1, 0.24),
        (front, 0.42),
        (front - 0.06, waist * 0.82),
        (hood, waist * 0.98),
        (back + 0.1, waist),
        (back, waist * 0.75),
    ]
    house = [(rear_foot, waist - 0.02), (hood, waist - 0.02), (foot, height), (rear_top, height)]
    parts: list[Mesh] = [
        prism(lower, width, body, 1.6, taper=0.94),
        prism(house, width * 0.92, body, 1.6, taper=0.8),
    ]
    parts += _windows(house, width * 0.92, glass, waist, height)
    radius = 0.31 * (1.1 if family in ("suv", "van") else 1.0)
    for x in (front - 0.19 * length, back + 0.19 * length):
        for y in (-width / 2 + 0.09, width / 2 - 0.09):
            parts.append(cylinder(radius, 0.22, rubber, 0.4).at(x, y + 0.11, radius, np.pi / 2, "x"))
            parts.append(cylinder(radius * 0.62, 0.235, rim, None).at(x, y + 0.1175, radius, np.pi / 2, "x"))
    for y in (-width * 0.36, width * 0.36):
        parts.append(box((front - 0.12, y - 0.17, 0.58), (front - 0.01, y + 0.17, 0.72), lamp, 0.4))
        parts.append(box((back - 0.01, y - 0.15, 0.62), (back + 0.12, y + 0.15, 0.82), red, 0.4))
    for x in (front - 0.03, back - 0.02):
        parts.append(box((x, -0.26, 0.38), (x + 0.05, 0.26, 0.5), plate, None))
    mesh = join(parts)

    def lookalike() -> Prop:
        w, d, h = shop.similar((length, width, height), 0.012)
        return car(shop, family, shop.near(paint, 5), (w, d, h))

    return Prop(family, mesh, lookalike)


def _bodywork(shop: Workshop, paint: Colour) -> np.ndarray:
    """Paint with door gaps, dirt from below, and a few stickers or scratches of its own."""
    rng = shop.rng
    tile = textures.mottled(rng, paint, 0.07, 1.5)
    for _ in range(shop.count(2, 5)):
        x = int(rng.integers(10, 245))
        textures_line = np.asarray(paint, dtype=np.float64) * 0.5
        prints.rectangle(tile, (x, 0), (x + 1, 255), textures_line)
    for _ in range(shop.count(4, 9)):
        textures.blot(rng, tile, list(shop.near((96, 84, 66), 25)))
    for _ in range(shop.count(1, 3)):
        x, y = (int(v) for v in rng.integers(5, 190, 2))
        prints.rectangle(
            tile, (x, y), (x + shop.count(18, 50), y + shop.count(10, 26)), prints.vivid(rng, 90, 240)
        )
        prints.write(tile, prints.word(rng, 3), (x + 3, y + 16), 0.55, (245, 245, 245), 2)
    return tile


def _windows(
    house: list[tuple[float, float]], width: float, glass: int, waist: float, height: float
) -> list[Mesh]:
    """Slightly raised panes on the four sides of a cabin (rear foot, front foot, front top, rear top)."""
    (rear_x, _), (front_x, _), (top_front, _), (top_rear, _) = house

    def level(z: float, share: float) -> tuple[float, float]:
        rear = rear_x + (top_rear - rear_x) * share
        return rear, front_x + (top_front - front_x) * share

    low, high = 0.14, 0.86
    z_low, z_high = waist + (height - waist) * low, waist + (height - waist) * high
    (r0, f0), (r1, f1) = level(z_low, low), level(z_high, high)
    middle = (r0 + f0) / 2
    panes = []
    for x0, x1, x2, x3 in (
        (r0 + 0.18, middle - 0.05, middle - 0.05, r1 + 0.16),
        (middle + 0.05, f0 - 0.2, f1 - 0.14, middle + 0.05),
    ):
        # Wider than the cabin at this height by a few millimetres, so that the pane shows.
        outline = [(x0, z_low), (x1, z_low), (x2, z_high), (x3, z_high)]
        widths = [width * (1 - 0.2 * share) + 0.012 for share in (low, high)]
        panes.append(prism(outline, widths[0], glass, 0.8, taper=widths[1] / widths[0]))
    inset = width * 0.9
    shift = 0.02
    windscreen = [(f0 - 0.1, z_low), (f0 + shift, z_low), (f1 + shift, z_high), (f1 - 0.1, z_high)]
    rear = [(r0 - shift, z_low), (r0 + 0.1, z_low), (r1 + 0.1, z_high), (r1 - shift, z_high)]
    for outline in (windscreen, rear):
        panes.append(prism(outline, inset * 0.94, glass, 0.8, taper=0.84))
    return panes
