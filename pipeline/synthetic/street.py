"""Things that stand outdoors: trees, lampposts, benches, tents, stalls, market tables."""

from __future__ import annotations

import numpy as np

from pipeline.synthetic import goods, prints, textures
from pipeline.synthetic.props import Prop, Workshop
from pipeline.synthetic.shapes import Mesh, Outline, box, cylinder, join, lathe, prism, sphere
from pipeline.synthetic.textures import Colour


def tree(shop: Workshop, height: float) -> Prop:
    """A trunk and a crown of several bushes of leaves."""
    bark = shop.tile(textures.wood(shop.rng, shop.near((96, 76, 58), 20), 1))
    leaf = shop.tile(
        textures.leaves(shop.rng, (shop.between(50, 110), shop.between(100, 150), shop.between(30, 60)))
    )
    radius = shop.between(0.12, 0.2)
    parts: list[Mesh] = [cylinder(radius, height * 0.6, bark, 0.6, top=radius * 0.5, segments=12)]
    for _ in range(shop.count(4, 7)):
        size = height * shop.between(0.13, 0.22)
        bumps = 1 + 0.22 * shop.rng.standard_normal((9, 16)).clip(-1.5, 1.5)
        bumps[[0, -1]] = 1
        spot = shop.rng.normal(0, height * 0.09, 2)
        crown = sphere(size, leaf, 1.3, bumps)
        parts.append(crown.at(float(spot[0]), float(spot[1]), height * shop.between(0.58, 0.85)))
    return Prop("tree", join(parts), lambda: tree(shop, height))


def lamppost(shop: Workshop, height: float) -> Prop:
    """A post with a lantern and a sticker or two."""
    metal = shop.tile(textures.mottled(shop.rng, shop.near((76, 86, 82), 25), 0.15, size=128), gloss=0.08)
    glass, sticker = shop.paint((230, 226, 205), 0.05, 0.3), shop.tile(prints.picture(shop.rng, 64))
    parts = [
        cylinder(0.16, 0.5, metal, 0.4, top=0.1, segments=12),
        cylinder(0.07, height - 0.5, metal, 0.4, top=0.05, segments=12).at(z=0.5),
        cylinder(0.14, 0.4, glass, 0.5, top=0.2, segments=10).at(z=height),
        cylinder(0.24, 0.1, metal, 0.4, top=0.05, segments=10).at(z=height + 0.4),
        box((-0.08, -0.08, 1.3), (0.08, 0.08, 1.6), sticker, None),
    ]
    return Prop("lamppost", join(parts), lambda: lamppost(shop, height))


def bench(shop: Workshop, length: float) -> Prop:
    """Slats on two cast feet."""
    slat, iron = shop.tile(textures.wood(shop.rng, (140, 98, 62), 2)), shop.paint((52, 54, 52))
    parts = [
        box((-length / 2, y, 0.42), (length / 2, y + 0.1, 0.46), slat, 0.7, y) for y in (-0.25, -0.12, 0.01)
    ]
    parts += [box((-length / 2, 0.16, z), (length / 2, 0.2, z + 0.1), slat, 0.7, z) for z in (0.55, 0.72)]
    for x in (-length / 2 + 0.15, length / 2 - 0.2):
        parts.append(box((x, -0.25, 0), (x + 0.05, 0.2, 0.42), iron))
        parts.append(box((x, 0.14, 0.4), (x + 0.05, 0.18, 0.84), iron))
    return Prop("bench", join(parts), lambda: bench(shop, length))


def tent(shop: Workshop, size: tuple[float, float], colours: list[Colour]) -> Prop:
    """A pavilion: four poles, a pyramid roof with a striped valance, sometimes a back wall and a banner."""
    width, depth = size
    eave, peak = shop.between(2.1, 2.4), shop.between(0.6, 1.1)
    roof = shop.tile(textures.cloth(shop.rng, colours, shop.count(4, 10)))
    pole = shop.paint((190, 190, 188), 0.1, 0.1)
    half_w, half_d = width / 2, depth / 2
    parts = []
    for x in (-half_w + 0.05, half_w - 0.05):
        for y in (-half_d + 0.05, half_d - 0.05):
            parts.append(cylinder(0.03, eave, pole, 0.4, segments=8).at(x, y))
    ridge = min(half_w, 0.25)
    outline = [(-half_w, eave), (half_w, eave), (ridge, eave + peak), (-ridge, eave + peak)]
    parts.append(prism(outline, depth, roof, 1.5, taper=0.12))
    for y in (-half_d, half_d - 0.02):
        parts.append(box((-half_w, y, eave - 0.25), (half_w, y + 0.02, eave + 0.02), roof, 1.5))
    for x in (-half_w, half_w - 0.02):
        parts.append(box((x, -half_d, eave - 0.25), (x + 0.02, half_d, eave + 0.02), roof, 1.5))
    if shop.rng.random() < 0.6:
        banner = shop.tile(prints.picture(shop.rng))
        side = shop.tile(textures.cloth(shop.rng, colours, shop.count(0, 6)))
        parts.append(box((-half_w, half_d - 0.03, 0.1), (half_w, half_d - 0.005, eave), side, 1.5))
        parts.append(
            box((-half_w * 0.6, half_d - 0.06, 0.9), (half_w * 0.6, half_d - 0.03, 1.9), banner, None)
        )
    return Prop("tent", join(parts), lambda: tent(shop, size, [shop.near(c, 10) for c in colours]))


def stall(shop: Workshop, length: float) -> Prop:
    """A market table with a cloth, boxes of goods on it, maybe an awning."""
    drape = shop.tile(
        textures.cloth(shop.rng, [prints.vivid(shop.rng, 80, 220), (228, 224, 215)], shop.count(0, 9))
    )
    parts = [box((-length / 2, -0.4, 0), (length / 2, 0.4, 0.78), drape, 0.9)]
    x = -length / 2 + 0.3
    while x < length / 2 - 0.25:
        size = (shop.between(0.35, 0.5), shop.between(0.3, 0.6), shop.between(0.1, 0.25))
        parts.append(goods.crate(shop, size, shop.near((170, 130, 84), 20)).mesh.at(x, rng_small(shop), 0.78))
        x += shop.between(0.5, 0.7)
    if shop.rng.random() < 0.6:
        cloth = shop.tile(textures.cloth(shop.rng, [prints.vivid(shop.rng, 110, 230), (235, 232, 225)], 8))
        pole = shop.paint((130, 100, 70))
        for px in (-length / 2 + 0.05, length / 2 - 0.05):
            parts.append(box((px - 0.025, 0.35, 0), (px + 0.025, 0.4, 2.3), pole))
            parts.append(box((px - 0.025, -0.4, 0), (px + 0.025, -0.35, 2.0), pole))
        awning = box((-length / 2, -0.75, 0), (length / 2, 0.75, 0.04), cloth, 1.2)
        parts.append(awning.at(0, -0.1, 2.15, 0.2, "x"))
    return Prop("stall", join(parts), lambda: stall(shop, length))


def rng_small(shop: Workshop) -> float:
    """A few centimetres either way."""
    return float(np.clip(shop.rng.normal(0, 0.03), -0.06, 0.06))


def parasol(shop: Workshop, radius: float) -> Prop:
    """A sunshade over a round table."""
    colours: list[Colour] = [prints.vivid(shop.rng, 100, 230), (232, 230, 222)]
    cloth = shop.tile(textures.cloth(shop.rng, colours, 8))
    top = shop.tile(textures.wood(shop.rng, (156, 112, 70), 3))
    pole = shop.paint((200, 198, 190), 0.08)
    parts = [
        cylinder(0.03, 2.5, pole, 0.4, segments=8),
        lathe([[0, 2.1], [radius, 2.05], [radius, 2.1], [0.03, 2.6]], cloth, None, 12),
        cylinder(0.5, 0.04, top, 0.8).at(z=0.7),
        cylinder(0.25, 0.05, pole, 0.4),
    ]
    return Prop("parasol", join(parts), lambda: parasol(shop, radius), 4)


def fountain(shop: Workshop, radius: float) -> Prop:
    """A round basin with a column and a bowl."""
    stone = shop.tile(textures.speckled(shop.rng, shop.near((168, 160, 146), 14), 0.25, 256))
    water = shop.tile(textures.mottled(shop.rng, (70, 100, 104), 0.25, 1.5), gloss=0.4)
    profile: Outline = [[0, 0], [radius, 0], [radius, 0.5], [radius - 0.25, 0.5], [radius - 0.25, 0.36]]
    parts = [
        lathe(profile, stone, 1.2, 28),
        lathe([[radius - 0.25, 0.37], [0, 0.37]], water, 1.5, 28),
        lathe(
            [
                [0.3, 0.3],
                [0.22, 1.1],
                [0.3, 1.3],
                [0.85, 1.5],
                [0.8, 1.52],
                [0.12, 1.45],
                [0.1, 2.1],
                [0, 2.2],
            ],
            stone,
            0.8,
        ),
    ]
    return Prop("fountain", join(parts), lambda: fountain(shop, radius))


def facade_row(shop: Workshop, length: float, height: float) -> Mesh:
    """Houses side by side along x, their fronts on y = 0 facing -y; doors and plinths stand out."""
    parts: list[Mesh] = []
    x = -length / 2
    while x < length / 2 - 0.5:
        width = min(shop.between(5.0, 9.0), length / 2 - x)
        if length / 2 - x - width < 3.0:
            width = length / 2 - x
        tall = height * shop.between(0.75, 1.1)
        colour = shop.near(
            shop.rng.choice([(186, 132, 104), (204, 188, 158), (168, 172, 170), (196, 160, 112)]), 12
        )
        if shop.rng.random() < 0.5:
            wall = textures.masonry(shop.rng, colour, np.asarray(colour) * 0.75, 16, 8, 256)
        else:
            wall = textures.mottled(shop.rng, colour, 0.07)
        columns = max(2, round(width / 2.2))
        front = shop.tile(
            prints.facade(shop.rng, wall, columns=min(columns, 5), rows=max(2, round(tall / 3))), macro=0.05
        )
        plain = shop.tile(wall, macro=0.05)
        plinth = shop.tile(textures.speckled(shop.rng, shop.near((130, 124, 116), 12), 0.2, 128))
        door = shop.tile(textures.wood(shop.rng, prints.vivid(shop.rng, 50, 130), 4))
        sign = shop.tile(prints.picture(shop.rng))
        setback = shop.between(0, 0.5)
        faces = [plain, plain, front, plain, plain, plain]
        parts.append(box((x, setback, 0), (x + width, 4, tall), faces, None))
        parts.append(box((x, setback - 0.08, 0), (x + width, setback, 0.6), plinth, 1.0, x))
        at = x + width * shop.between(0.2, 0.7)
        parts.append(box((at, setback - 0.12, 0), (at + 1.1, setback, 2.2), door, None))
        parts.append(box((at - 0.6, setback - 0.25, 2.4), (at + 1.7, setback, 3.0), sign, None))
        x += width
    return join(parts)


def wheelie_bin(shop: Workshop, colour: Colour) -> Prop:
    """A household waste container with a lid, a label and two wheels."""
    face = textures.mottled(shop.rng, colour, 0.1, 1.3)
    prints.rectangle(face, (60, 70), (190, 150), prints.vivid(shop.rng, 120, 240))
    prints.write(face, prints.word(shop.rng, 3), (72, 128), 1.6, (240, 240, 235), 3)
    plain, front = shop.paint(colour, 0.12), shop.tile(face)
    dark = shop.paint((36, 36, 38), 0.15)
    body = box((-0.29, -0.34, 0.06), (0.29, 0.34, 0.98), [plain, plain, front, plain, plain, plain], None)
    parts = [body, box((-0.31, -0.38, 0.98), (0.31, 0.37, 1.07), plain, 0.6)]
    parts += [cylinder(0.1, 0.06, dark, 0.3).at(x, 0.3, 0.1, np.pi / 2, "y") for x in (-0.33, 0.27)]
    return Prop("wheelie bin", join(parts), lambda: wheelie_bin(shop, shop.near(colour, 8)), tips=True)


def trolley(shop: Workshop, colour: Colour) -> Prop:
    """A shopping trolley, its front towards +x: a frame, a basket of panels with bars, a printed handle."""
    bars = shop.tile(textures.cloth(shop.rng, [shop.near((176, 178, 182), 10), (70, 72, 76)], 16, 128), 0.1)
    steel, handle = shop.paint((150, 152, 156), 0.15, 0.1), shop.tile(prints.picture(shop.rng, 64))
    grip = shop.paint(colour, 0.15)
    outline = [(-0.35, 0.62), (0.4, 0.55), (0.45, 0.98), (-0.45, 1.0)]
    parts = [
        prism(outline, 0.52, bars, 0.5),
        box((-0.55, -0.27, 0.98), (-0.49, 0.27, 1.05), grip, 0.3),
        box((-0.5, -0.18, 0.84), (-0.46, 0.18, 0.97), handle, None),
    ]
    for y in (-0.24, 0.22):
        parts.append(box((-0.45, y, 0.1), (0.42, y + 0.03, 0.14), steel, 0.4))
        parts.append(box((-0.42, y, 0.12), (-0.38, y + 0.03, 0.66), steel, 0.4))
        for x in (-0.42, 0.38):
            parts.append(cylinder(0.06, 0.03, grip, 0.2, segments=10).at(x, y + 0.03, 0.06, np.pi / 2, "x"))
    return Prop("trolley", join(parts), lambda: trolley(shop, shop.near(colour)), plain=True)
