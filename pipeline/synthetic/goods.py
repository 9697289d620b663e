"""Things of a warehouse: racks, pallets, drums, crates."""

from __future__ import annotations

import numpy as np

from pipeline.synthetic import prints, textures
from pipeline.synthetic.props import Prop, Workshop
from pipeline.synthetic.shapes import box, cylinder, join, lathe
from pipeline.synthetic.textures import Colour


def rack(
    shop: Workshop, width: float, depth: float, levels: list[float], paint: Colour, beam: Colour
) -> Prop:
    """One bay of pallet racking: uprights, beams and boards at the given heights (metres)."""
    steel, orange = shop.paint(paint, 0.12, 0.05), shop.paint(beam, 0.12, 0.05)
    deck = shop.tile(textures.wood(shop.rng, shop.near((176, 140, 98)), 4))
    parts = []
    for x in (-width / 2, width / 2 - 0.08):
        for y in (-depth / 2, depth / 2 - 0.08):
            parts.append(box((x, y, 0), (x + 0.08, y + 0.08, levels[-1] + 0.5), steel, 0.5))
        for z in np.arange(0.2, levels[-1], 0.7):
            parts.append(box((x + 0.03, -depth / 2, z), (x + 0.06, depth / 2, z + 0.04), steel, 0.5))
    for z in levels:
        parts.append(box((-width / 2, -depth / 2, z - 0.1), (width / 2, -depth / 2 + 0.04, z), orange, 0.6))
        parts.append(box((-width / 2, depth / 2 - 0.04, z - 0.1), (width / 2, depth / 2, z), orange, 0.6))
        parts.append(box((-width / 2, -depth / 2, z - 0.025), (width / 2, depth / 2, z), deck, 1.0, z))
    return Prop("rack", join(parts), lambda: rack(shop, width, depth, levels, paint, beam))


def pallet(shop: Workshop, wood: Colour = (178, 142, 96)) -> Prop:
    """A euro pallet, 1.2 x 0.8 m."""
    tile = shop.tile(textures.wood(shop.rng, shop.near(wood, 16), 5))
    parts = [box((-0.6, y - 0.05, 0), (0.6, y + 0.05, 0.1), tile, 0.6, y) for y in (-0.35, 0, 0.35)]
    parts += [
        box((x - 0.06, -0.4, 0.1), (x + 0.06, 0.4, 0.13), tile, 0.6, x) for x in np.linspace(-0.54, 0.54, 7)
    ]
    return Prop("pallet", join(parts), lambda: pallet(shop, wood), 2, plain=True)


def drum(shop: Workshop, colour: Colour, radius: float = 0.29, height: float = 0.88) -> Prop:
    """A steel drum with ribs, rust and a label."""
    face = textures.mottled(shop.rng, colour, 0.12, 1.3)
    prints.write(face, prints.word(shop.rng, 4), (20, 150), 1.5, (235, 235, 230), 4)
    prints.rectangle(face, (150, 90), (225, 165), (235, 230, 215))
    prints.write(face, prints.word(shop.rng, 4), (154, 125), 0.8, (30, 30, 30), 2)
    for _ in range(6):
        textures.blot(shop.rng, face, (120, 70, 40))
    tile = shop.tile(face, gloss=0.12)
    r, h, rib = radius, height, radius * 1.03
    profile: list[list[float]] = [
        [0, 0],
        [rib, 0],
        [rib, 0.02],
        [r, 0.04],
        [r, h * 0.33],
        [rib, h * 0.35],
        [r, h * 0.37],
    ]
    profile += [[r, h * 0.64], [rib, h * 0.66], [r, h * 0.68], [r, h - 0.04], [rib, h - 0.02], [rib, h]]
    profile += [[r * 0.95, h], [r * 0.95, h - 0.02], [0, h - 0.02]]
    mesh = lathe(profile, tile, None, 24)
    return Prop("drum", mesh, lambda: drum(shop, shop.near(colour, 8), radius, height), tips=True)


def crate(shop: Workshop, size: tuple[float, float, float], colour: Colour) -> Prop:
    """An open slatted or plastic crate with goods heaped in it."""
    width, depth, height = size
    wooden = shop.rng.random() < 0.5
    face = (
        textures.wood(shop.rng, colour, 4, 128)
        if wooden
        else textures.masonry(shop.rng, colour, np.asarray(colour) * 0.4, 5, 6, 128)
    )
    side = shop.tile(face)
    fill = textures.leaves(shop.rng, prints.vivid(shop.rng, 120, 230), 128)
    heap = shop.tile(fill)
    half_w, half_d = width / 2, depth / 2
    parts = [
        box((-half_w, -half_d, 0), (half_w, half_d, height), [side] * 5 + [heap], None),
        box((-half_w * 0.7, -half_d * 0.7, height), (half_w * 0.7, half_d * 0.7, height + 0.04), heap, 0.4),
    ]

    def lookalike() -> Prop:
        w, d, h = shop.similar(size)
        return crate(shop, (w, d, h), shop.near(colour, 8))

    return Prop("crate", join(parts), lookalike, 2)


def cone(shop: Workshop) -> Prop:
    """A traffic cone."""
    tile = shop.tile(textures.cloth(shop.rng, [(225, 85, 30), (235, 235, 230)], 0, 64))
    white = shop.paint((232, 232, 228))
    parts = [
        box((-0.18, -0.18, 0), (0.18, 0.18, 0.03), tile, 0.4),
        cylinder(0.14, 0.28, tile, 0.4, top=0.09).at(z=0.03),
        cylinder(0.09, 0.13, white, 0.4, top=0.065).at(z=0.31),
        cylinder(0.065, 0.2, tile, 0.4, top=0.02).at(z=0.44),
    ]
    return Prop("cone", join(parts), lambda: cone(shop), 4, True, True)


def pallet_truck(shop: Workshop, colour: Colour) -> Prop:
    """A hand pallet truck."""
    tile, dark = shop.paint(colour, 0.15, 0.1), shop.paint((40, 40, 42))
    parts = [box((-0.6, y - 0.08, 0.08), (0.55, y + 0.08, 0.16), tile, 0.5) for y in (-0.2, 0.2)]
    parts.append(box((0.5, -0.28, 0.05), (0.7, 0.28, 0.45), tile, 0.5))
    parts.append(box((-0.025, -0.025, 0), (0.025, 0.025, 1.0), dark).at(0.66, 0, 0.35, 0.35, "y"))
    parts.append(cylinder(0.09, 0.12, dark).at(0.66, 0.06, 0.09, np.pi / 2, "x"))
    return Prop("pallet truck", join(parts), lambda: pallet_truck(shop, shop.near(colour)), plain=True)
