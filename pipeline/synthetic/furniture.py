"""Things of an office: furniture, and what lies on it."""

from __future__ import annotations

import numpy as np

from pipeline.synthetic import prints, textures
from pipeline.synthetic.props import Prop, Workshop
from pipeline.synthetic.shapes import Mesh, Outline, box, cylinder, join, lathe, sphere
from pipeline.synthetic.textures import Colour

_DARK = (38, 38, 42)


def desk(shop: Workshop, size: tuple[float, float, float], wood: Colour) -> Prop:
    """A table of (width, depth, height) metres with legs or side panels and maybe drawers."""
    width, depth, height = size
    top = shop.tile(textures.wood(shop.rng, wood, shop.count(1, 4)), gloss=0.04)
    frame = shop.paint(shop.near(_DARK if shop.rng.random() < 0.5 else (190, 190, 190), 20))
    parts = [box((-width / 2, -depth / 2, height - 0.035), (width / 2, depth / 2, height), top, 0.8)]
    if shop.rng.random() < 0.5:
        for x in (-width / 2 + 0.03, width / 2 - 0.08):
            for y in (-depth / 2 + 0.03, depth / 2 - 0.08):
                parts.append(box((x, y, 0), (x + 0.05, y + 0.05, height - 0.035), frame, 0.5))
    else:
        for x in (-width / 2 + 0.02, width / 2 - 0.05):
            parts.append(
                box((x, -depth / 2 + 0.03, 0), (x + 0.03, depth / 2 - 0.03, height - 0.035), top, 0.8)
            )
    if width > 1 and shop.rng.random() < 0.6:
        front = shop.tile(textures.wood(shop.rng, shop.near(wood), 3), gloss=0.04)
        x = width / 2 - 0.48
        parts.append(
            box((x, -depth / 2 + 0.05, 0.08), (x + 0.4, depth / 2 - 0.05, height - 0.06), front, None)
        )
    return Prop("desk", join(parts), lambda: desk(shop, size, shop.near(wood)))


def chair(shop: Workshop, colour: Colour, width: float = 0.46) -> Prop:
    """A swivel or four-legged chair with a cloth seat and back."""
    cloth = shop.tile(textures.cloth(shop.rng, [colour, shop.near(colour, 45)], shop.count(0, 6)))
    metal = shop.paint(shop.near(_DARK, 10), gloss=0.1)
    half = width / 2
    parts = [
        box((-half, -half, 0.43), (half, half, 0.5), cloth, 0.4),
        box((-half + 0.02, half - 0.06, 0.56), (half - 0.02, half, 0.98), cloth, 0.4),
        box((-0.03, half - 0.03, 0.45), (0.03, half + 0.01, 0.7), metal),
    ]
    if shop.rng.random() < 0.6:
        parts.append(cylinder(0.03, 0.4, metal).at(z=0.05))
        for leg in range(5):
            arm = box((0, -0.02, 0.03), (0.28, 0.02, 0.07), metal)
            parts.append(arm.at(yaw=leg * 2 * np.pi / 5))
    else:
        for x in (-half, half - 0.03):
            for y in (-half, half - 0.03):
                parts.append(box((x, y, 0), (x + 0.03, y + 0.03, 0.44), metal))
    return Prop("chair", join(parts), lambda: chair(shop, shop.near(colour), width), tips=True)


def monitor(shop: Workshop, width: float) -> Prop:
    """A screen on a foot, facing -y."""
    shell = shop.paint(shop.near(_DARK, 8), gloss=0.1)
    lit = shop.tile(prints.screen(shop.rng), gloss=0.3)
    height = width * shop.between(0.56, 0.64)
    faces = [shell, shell, lit, shell, shell, shell]
    parts = [
        box((-width / 2, -0.02, 0.13), (width / 2, 0.025, 0.13 + height), faces, None),
        box((-0.03, 0.0, 0.0), (0.03, 0.04, 0.3), shell),
        box((-0.13, -0.09, 0), (0.13, 0.09, 0.015), shell, 0.4),
    ]
    return Prop("monitor", join(parts), lambda: monitor(shop, width * shop.between(0.97, 1.03)))


def desk_lamp(shop: Workshop, colour: Colour) -> Prop:
    """A foot, a stem and a conical shade in one column."""
    shade, metal = shop.paint(colour, 0.12), shop.paint(shop.near((150, 150, 150), 30), gloss=0.2)
    height = shop.between(0.35, 0.5)
    parts = [
        cylinder(0.085, 0.025, metal, 0.3),
        cylinder(0.013, height - 0.1, metal, 0.3, segments=8).at(z=0.02),
        cylinder(0.11, 0.15, shade, 0.3, top=0.06).at(z=height - 0.12),
    ]
    return Prop("lamp", join(parts), lambda: desk_lamp(shop, shop.near(colour)), 0, True, True)


def mug(shop: Workshop, colour: Colour) -> Prop:
    """A cup with a band of print and a handle."""
    face = textures.mottled(shop.rng, colour, 0.05, size=64)
    prints.rectangle(face, (0, 18), (63, 40), prints.vivid(shop.rng))
    prints.write(face, prints.word(shop.rng, 3), (6, 36), 0.6, (240, 240, 240), 2)
    tile = shop.tile(face, gloss=0.1)
    radius, height = shop.between(0.04, 0.05), shop.between(0.09, 0.12)
    parts = [
        lathe(
            [[0, 0], [radius, 0], [radius, height], [radius * 0.85, height], [radius * 0.8, 0.02]],
            tile,
            None,
            16,
        ),
        box((radius - 0.005, -0.008, 0.025), (radius + 0.025, 0.008, height - 0.02), tile),
    ]
    return Prop("mug", join(parts), lambda: mug(shop, shop.near(colour)), tips=True)


def carton(shop: Workshop, size: tuple[float, float, float], board: Colour, ink: Colour) -> Prop:
    """A printed box of (width, depth, height) metres; every carton has its own print on every face."""
    width, depth, height = size
    sides = [shop.tile(prints.carton_face(shop.rng, board, ink)) for _ in range(5)]
    tiles = [sides[0], sides[1], sides[2], sides[3], sides[4], sides[4]]
    mesh = box((-width / 2, -depth / 2, 0), (width / 2, depth / 2, height), tiles, None)

    def lookalike() -> Prop:
        w, d, h = shop.similar(size)
        return carton(shop, (w, d, h), shop.near(board, 5), shop.near(ink, 25))

    return Prop("carton", mesh, lookalike, tips=True)


def books(shop: Workshop, count: int) -> Prop:
    """A row of standing books, spines towards -y."""
    x, parts = 0.0, []
    for _ in range(count):
        thick, height, depth = shop.between(0.02, 0.05), shop.between(0.19, 0.29), shop.between(0.14, 0.2)
        spine = shop.tile(prints.book_spines(shop.rng))
        page = shop.paint((225, 220, 205))
        tiles = [spine, spine, spine, page, page, page]
        parts.append(box((x, -0.1, 0), (x + thick, -0.1 + depth, height), tiles, None))
        x += thick + 0.001
    row = join(parts).at(x=-x / 2)
    return Prop("books", row, lambda: books(shop, count))


def book_stack(shop: Workshop, count: int) -> Prop:
    """Books lying on each other."""
    z, parts = 0.0, []
    for _ in range(count):
        width, depth, thick = shop.between(0.16, 0.22), shop.between(0.22, 0.29), shop.between(0.02, 0.045)
        cover = shop.tile(prints.picture(shop.rng, 128))
        spine = shop.tile(prints.book_spines(shop.rng))
        tiles = [spine, spine, spine, spine, cover, cover]
        lying = box((-width / 2, -depth / 2, 0), (width / 2, depth / 2, thick), tiles, None)
        parts.append(lying.at(z=z, yaw=shop.rng.normal(0, 0.12)))
        z += thick
    return Prop("book stack", join(parts), lambda: book_stack(shop, count))


def laptop(shop: Workshop, colour: Colour) -> Prop:
    """An open notebook computer, screen towards -y."""
    shell, lit = shop.paint(colour, 0.04, gloss=0.1), shop.tile(prints.screen(shop.rng), gloss=0.25)
    keys = shop.tile(textures.masonry(shop.rng, (50, 50, 52), (120, 120, 122), 6, 12, 128))
    base = box((-0.17, -0.12, 0), (0.17, 0.12, 0.02), [shell] * 5 + [keys], None)
    lid = box((-0.17, -0.006, 0), (0.17, 0.006, 0.23), [shell, shell, lit, shell, shell, shell], None)
    return Prop(
        "laptop", join([base, lid.at(y=0.12, z=0.02, yaw=-0.3, axis="x")]), lambda: laptop(shop, colour)
    )


def plant(shop: Workshop, height: float, pot: Colour) -> Prop:
    """A pot with a bush of ``height`` metres in all."""
    clay = shop.tile(textures.cloth(shop.rng, [pot, shop.near(pot, 40)], shop.count(0, 5), 128))
    leaf = shop.tile(
        textures.leaves(shop.rng, (shop.between(30, 90), shop.between(110, 170), shop.between(30, 70)))
    )
    radius = height * shop.between(0.13, 0.17)
    parts: list[Mesh] = [cylinder(radius * 0.8, height * 0.3, clay, 0.5, top=radius)]
    stem = shop.paint((88, 74, 46), 0.2)
    parts.append(cylinder(height * 0.02, height * 0.35, stem, 0.3, segments=8).at(z=height * 0.28))
    for _ in range(shop.count(4, 7)):
        size = height * shop.between(0.1, 0.18)
        bumps = 1 + 0.35 * shop.rng.standard_normal((9, 16)).clip(-1.5, 1.5)
        bumps[[0, -1]] = 1
        spot = shop.rng.normal(0, height * 0.07, 2)
        crown = sphere(size, leaf, 0.35, bumps, flat=1.25)
        parts.append(crown.at(float(spot[0]), float(spot[1]), height * shop.between(0.45, 0.8)))
    return Prop("plant", join(parts), lambda: plant(shop, height, shop.near(pot)))


def bin_(shop: Workshop, colour: Colour) -> Prop:
    """A waste-paper bin."""
    tile = shop.tile(textures.cloth(shop.rng, [colour, shop.near(colour, 30)], shop.count(3, 10), 128))
    radius, height = shop.between(0.13, 0.17), shop.between(0.28, 0.38)
    profile: Outline = [
        [0, 0],
        [radius * 0.8, 0],
        [radius, height],
        [radius * 0.95, height],
        [radius * 0.75, 0.02],
        [0, 0.02],
    ]
    return Prop("bin", lathe(profile, tile, 0.5), lambda: bin_(shop, shop.near(colour)), 0, True, True)


def bag(shop: Workshop, colour: Colour) -> Prop:
    """A rucksack: a rounded body with a pocket."""
    tile = shop.tile(textures.cloth(shop.rng, [colour, shop.near(colour, 50)], shop.count(0, 7), 128))
    pocket = shop.tile(prints.picture(shop.rng, 64))
    profile: Outline = [[0, 0], [0.15, 0.01], [0.17, 0.12], [0.16, 0.3], [0.1, 0.41], [0, 0.44]]
    body = lathe(profile, tile, 0.4, 16, smooth=True)
    front = box((-0.1, -0.2, 0.05), (0.1, -0.1, 0.24), [tile, tile, pocket, tile, tile, tile], None)
    return Prop("bag", join([body, front]), lambda: bag(shop, shop.near(colour)), tips=True)


def bookcase(
    shop: Workshop, size: tuple[float, float, float], boards: int, wood: Colour
) -> tuple[Prop, list[float]]:
    """A case open towards -y of (width, depth, height) metres, and the heights of its boards."""
    width, depth, height = size
    tile = shop.tile(textures.wood(shop.rng, wood, 2), gloss=0.03)
    levels = [0.06 + i * (height - 0.1) / boards for i in range(boards)]
    half, t = width / 2, 0.022
    parts = [
        box((-half, -depth / 2, 0), (-half + t, depth / 2, height), tile, 0.7),
        box((half - t, -depth / 2, 0), (half, depth / 2, height), tile, 0.7, 0.3),
        box((-half, depth / 2 - 0.01, 0), (half, depth / 2, height), tile, 0.7, 0.6),
        box((-half, -depth / 2, height - t), (half, depth / 2, height), tile, 0.7),
    ]
    for i, z in enumerate(levels):
        parts.append(box((-half, -depth / 2, z - t), (half, depth / 2, z), tile, 0.7, 0.17 * i))
    made = Prop("bookcase", join(parts), lambda: bookcase(shop, size, boards, wood)[0])
    return made, levels


def cabinet(shop: Workshop, size: tuple[float, float, float], colour: Colour) -> Prop:
    """A closed cupboard with drawer fronts towards -y."""
    width, depth, height = size
    side = shop.paint(colour, 0.06)
    face = textures.mottled(shop.rng, colour, 0.05, size=128)
    drawers = shop.count(2, 4)
    for row in range(drawers):
        top, bottom = row * 128 // drawers, (row + 1) * 128 // drawers
        prints.rectangle(face, (2, top + 2), (125, bottom - 2), np.asarray(colour) * 0.5, 2)
        prints.rectangle(face, (50, top + 9), (78, top + 14), (60, 60, 60))
        prints.rectangle(face, (90, top + 8), (112, top + 18), prints.vivid(shop.rng, 120, 240))
    front = shop.tile(face, gloss=0.05)
    tiles = [side, side, front, side, side, side]
    mesh = box((-width / 2, -depth / 2, 0), (width / 2, depth / 2, height), tiles, None)
    return Prop("cabinet", mesh, lambda: cabinet(shop, size, shop.near(colour)))
