"""Things of a camp in the hills: rocks, tents, tarps, lanterns, washing, and what campers leave about."""

from __future__ import annotations

import numpy as np

from pipeline.synthetic import prints, textures
from pipeline.synthetic.props import Prop, Workshop
from pipeline.synthetic.shapes import Mesh, Outline, box, cylinder, join, lathe, prism, sphere
from pipeline.synthetic.sheets import sheet, tube
from pipeline.synthetic.textures import Colour


def boulder(shop: Workshop, radius: float) -> Prop:
    """A weathered rock, partly in the ground."""
    stone = textures.speckled(shop.rng, shop.near((136, 130, 120), 25), 0.3, 256)
    for _ in range(shop.count(3, 9)):
        textures.blot(shop.rng, stone, list(shop.near((120, 138, 80), 25)))  # lichen
    bumps = 1 + 0.2 * shop.rng.standard_normal((9, 16)).clip(-1.6, 1.6)
    bumps[[0, -1]] = 1
    mesh = sphere(radius, shop.tile(stone), 0.9, bumps, flat=shop.between(0.55, 0.9)).at(z=radius * 0.25)
    return Prop("boulder", mesh, lambda: boulder(shop, radius))


def dome_tent(shop: Workshop, radius: float, colours: list[Colour]) -> Prop:
    """An igloo tent with a printed door."""
    height = radius * shop.between(0.75, 0.95)
    segments = 24
    cloth = shop.tile(textures.cloth(shop.rng, colours, shop.count(2, 6)))
    door = shop.tile(prints.picture(shop.rng, 128))
    rise = np.linspace(0, np.pi / 2, 9)
    profile = np.stack([radius * np.cos(rise), height * np.sin(rise)], axis=1)
    # Cloth hangs in between the poles.
    sag = 1 - 0.06 * np.abs(np.sin(np.arange(segments) / segments * 2 * np.pi * 2))
    bumps = 1 + (sag - 1)[None, :] * np.sin(2 * rise)[:, None]
    flap = lathe(profile.tolist(), door, None, segments, smooth=True, bumps=bumps * 1.01)
    middle = flap.corners.mean(axis=1)
    front = (np.abs(np.arctan2(middle[:, 1], middle[:, 0])) < 0.4) & (middle[:, 2] < 0.75 * height)
    angle = np.arctan2(flap.corners[..., 1], flap.corners[..., 0])
    uv = np.stack([angle / 0.8 + 0.5, 1 - flap.corners[..., 2] / height / 0.8], axis=-1).astype(np.float32)
    shown = Mesh(flap.corners[front], flap.normals[front], uv[front], flap.tile[front])
    shell = lathe(profile.tolist(), cloth, 1.2, segments, smooth=True, bumps=bumps)
    return Prop(
        "dome tent", join([shell, shown]), lambda: dome_tent(shop, radius, [shop.near(c) for c in colours])
    )


def ridge_tent(shop: Workshop, length: float, colour: Colour) -> Prop:
    """Two slopes of sagging cloth between two poles, open at the front."""
    height, half = length * shop.between(0.5, 0.6), length * shop.between(0.36, 0.44)
    cloth = shop.tile(textures.cloth(shop.rng, [colour, shop.near(colour, 30)], shop.count(0, 5)))
    patch = shop.tile(prints.picture(shop.rng, 64))
    pole = shop.paint((170, 168, 160), 0.1)
    x = np.linspace(-length / 2, length / 2, 9)
    across = np.linspace(-1, 1, 13)
    ridge = height * (1 - 0.07 * (1 - (2 * x / length) ** 2))
    drop = np.abs(across)[:, None] ** 0.85
    grid = np.stack(
        np.broadcast_arrays(x[None, :], half * across[:, None], ridge[None, :] * (1 - drop)), axis=-1
    )
    parts = [sheet(grid, cloth, 1.0)]
    for at in (-length / 2, length / 2):
        parts.append(cylinder(0.02, height, pole, 0.4, segments=8).at(at))
    rear = [(-half, 0.0), (half, 0.0), (0.0, height * 0.98)]
    parts.append(prism(rear, 0.01, cloth, 1.0).at(-length / 2, 0, 0, np.pi / 2))
    mark = box((-0.16, -0.16, 0), (0.16, 0.16, 0.012), patch, None)
    parts.append(mark.at(0, -half * 0.5, height * 0.52, np.arctan2(height, half), "x"))
    return Prop("ridge tent", join(parts), lambda: ridge_tent(shop, length, shop.near(colour)))


def tarp(shop: Workshop, size: tuple[float, float], colour: Colour) -> Prop:
    """A sheet stretched over four poles of unlike height, sagging in folds."""
    width, depth = size
    pair: list[Colour] = [colour, shop.near(colour, 25)]
    cloth = shop.tile(textures.cloth(shop.rng, pair, shop.count(0, 6)))
    pole = shop.paint((150, 120, 84), 0.15)
    heights = np.array([[shop.between(1.5, 2.3) for _ in range(2)] for _ in range(2)])
    u, v = np.meshgrid(np.linspace(0, 1, 15), np.linspace(0, 1, 15))
    plane = (
        heights[0, 0] * (1 - u) * (1 - v)
        + heights[0, 1] * u * (1 - v)
        + heights[1, 0] * (1 - u) * v
        + heights[1, 1] * u * v
    )
    folds = 0.04 * np.sin(u * shop.between(8, 14) + v * shop.between(3, 8))
    z = plane - 0.32 * np.sin(np.pi * u) * np.sin(np.pi * v) + folds * np.sin(np.pi * u) * np.sin(np.pi * v)
    parts = [sheet(np.stack([(u - 0.5) * width, (v - 0.5) * depth, z], axis=-1), cloth, 1.1)]
    for row, y in enumerate((-depth / 2, depth / 2)):
        for column, x in enumerate((-width / 2, width / 2)):
            parts.append(cylinder(0.025, float(heights[row, column]), pole, 0.4, segments=8).at(x, y))
    return Prop("tarp", join(parts), lambda: tarp(shop, size, shop.near(colour)))


def washing(shop: Workshop, width: float, height: float) -> Prop:
    """A garment or towel that hangs in folds from its upper edge (z = 0), facing -y."""
    colours: list[Colour] = [prints.vivid(shop.rng, 70, 235), (230, 228, 222)]
    face = textures.cloth(shop.rng, colours, shop.count(0, 8))
    if shop.rng.random() < 0.6:
        prints.write(face, prints.word(shop.rng, 3), (50, 120), 2.2, prints.vivid(shop.rng, 20, 120), 5)
    tile = shop.tile(face)
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 17), np.linspace(0, 1, 11))
    waves, phase = shop.between(2, 4), shop.between(0, 6)
    narrow = 1 - shop.between(0.05, 0.25) * v
    sleeves = shop.rng.random() < 0.4
    widen = np.where(v < 0.3, 1.35, 1.0) if sleeves else np.ones_like(v)

    def hung(lift: float, shift: float) -> Mesh:
        fold = (0.015 + 0.05 * v) * np.sin(2 * np.pi * waves * u + phase + shift) + lift * v**2
        return sheet(np.stack([u * width * narrow * widen, fold, -v * height], axis=-1), tile, None)

    def lookalike() -> Prop:
        w, h = shop.similar((width, height))
        return washing(shop, w, h)

    def sway() -> Mesh:
        return hung(shop.between(-0.05, 0.05), shop.between(-0.7, 0.7))

    return Prop("washing", hung(0.0, 0.0), lookalike, sway=sway)


def lantern(shop: Workshop, colour: Colour) -> Prop:
    """A paper or tin lantern on a string; its hook is at z = 0."""
    face = textures.cloth(shop.rng, [colour, shop.near(colour, 60)], shop.count(2, 6), 128)
    prints.write(face, prints.word(shop.rng, 2), (20, 84), 1.6, (30, 30, 32), 4)
    paper, tin = shop.tile(face), shop.paint((90, 88, 84), 0.2, 0.1)
    radius = shop.between(0.11, 0.2)
    rise = np.linspace(-np.pi / 2, np.pi / 2, 9)
    ribs = 1 + 0.04 * (np.arange(9) % 2)
    profile = np.stack([radius * np.cos(rise) * ribs, radius * 1.1 * np.sin(rise)], axis=1)
    drop = radius * 1.1 + shop.between(0.12, 0.3)
    parts = [
        lathe(profile.tolist(), paper, None, 18, smooth=True).at(z=-drop),
        cylinder(0.05, 0.03, tin, 0.2, segments=10).at(z=-drop + radius * 1.08),
        cylinder(0.006, drop - radius, tin, 0.2, segments=6).at(z=-drop + radius),
    ]
    return Prop("lantern", join(parts), lambda: lantern(shop, shop.near(colour, 8)))


def log(shop: Workshop, length: float, radius: float) -> Prop:
    """A trunk lying on the ground."""
    bark = shop.tile(textures.wood(shop.rng, shop.near((104, 82, 60), 25), 1))
    rows = 7
    bumps = 1 + 0.1 * shop.rng.standard_normal((rows + 2, 14)).clip(-1.5, 1.5)
    z = np.linspace(0, length, rows)
    profile: Outline = [[0.0, 0.0], *([radius, float(at)] for at in z), [0.0, length]]
    lying = lathe(profile, bark, 0.8, 14, bumps=bumps).at(-length / 2, 0, radius * 0.8, np.pi / 2, "y")
    return Prop("log", lying, lambda: log(shop, length, radius))


def roll(shop: Workshop, colour: Colour) -> Prop:
    """A rolled mat or sleeping bag with straps."""
    cloth = shop.tile(textures.cloth(shop.rng, [colour, shop.near(colour, 40)], shop.count(0, 8), 128))
    strap = shop.tile(prints.picture(shop.rng, 64))
    radius, length = shop.between(0.09, 0.15), shop.between(0.45, 0.65)
    parts = [cylinder(radius, length, cloth, 0.4, segments=16).at(-length / 2, 0, radius, np.pi / 2, "y")]
    for x in (-length * 0.3, length * 0.25):
        parts.append(cylinder(radius * 1.04, 0.05, strap, None, segments=16).at(x, 0, radius, np.pi / 2, "y"))
    return Prop("roll", join(parts), lambda: roll(shop, shop.near(colour)))


def canister(shop: Workshop, colour: Colour) -> Prop:
    """A water can with a handle and a label."""
    face = textures.mottled(shop.rng, colour, 0.08, size=128)
    prints.rectangle(face, (20, 40), (108, 100), prints.vivid(shop.rng, 120, 240))
    prints.write(face, prints.word(shop.rng, 3), (26, 82), 1.3, (20, 20, 24), 3)
    front, plain = shop.tile(face), shop.paint(colour)
    cap = shop.paint((40, 40, 44))
    width, depth, height = shop.between(0.24, 0.36), shop.between(0.16, 0.22), shop.between(0.34, 0.46)
    sides = [plain, plain, front, front, plain, plain]
    parts = [
        box((-width / 2, -depth / 2, 0), (width / 2, depth / 2, height), sides, None),
        cylinder(0.035, 0.04, cap, 0.2, segments=10).at(width * 0.3, 0, height),
        box((-width * 0.35, -0.02, height), (width * 0.1, 0.02, height + 0.045), plain, 0.3),
    ]
    return Prop("canister", join(parts), lambda: canister(shop, shop.near(colour, 6)))


def notice(shop: Workshop) -> Prop:
    """A sign on a stake, its face towards -y: only its print says which."""
    shown = shop.tile(prints.picture(shop.rng, 256))
    wood = shop.tile(textures.wood(shop.rng, (150, 118, 80), 1, 128))
    width, height = 0.55, 0.42
    parts = [
        box((-0.035, -0.03, -0.2), (0.035, 0.03, 1.15), wood, 0.5),
        box(
            (-width / 2, -0.05, 0.72),
            (width / 2, -0.03, 0.72 + height),
            [wood, wood, shown, wood, wood, wood],
            None,
        ),
    ]
    return Prop("notice", join(parts), lambda: notice(shop))


def fireplace(shop: Workshop) -> Prop:
    """A ring of stones with charred wood."""
    char = shop.paint((40, 34, 30), 0.4)
    parts: list[Mesh] = []
    for angle in np.arange(0, 2 * np.pi, 0.7):
        stone = boulder(shop, shop.between(0.12, 0.18)).mesh
        parts.append(stone.at(0.5 * float(np.cos(angle)), 0.5 * float(np.sin(angle)), 0))
    for turn in range(4):
        stick = np.array([[-0.35, 0, 0.03], [0, 0, 0.09], [0.35, 0, 0.2]])
        parts.append(tube(stick, 0.04, char, 0.4, 8).at(yaw=turn * 0.8))
    return Prop("fireplace", join(parts), lambda: fireplace(shop))


def pot(shop: Workshop, colour: Colour) -> Prop:
    """An enamelled pot with a lid and speckles."""
    tile = shop.tile(textures.speckled(shop.rng, colour, 0.4, 64), gloss=0.15)
    r, h = shop.between(0.12, 0.19), shop.between(0.16, 0.26)
    parts = [
        lathe([[0, 0], [r * 0.9, 0], [r, h * 0.2], [r, h], [r * 0.6, h + 0.04], [0, h + 0.05]], tile, None),
        box((-r - 0.06, -0.02, h * 0.7), (-r, 0.02, h * 0.78), tile, 0.2),
        box((r, -0.02, h * 0.7), (r + 0.06, 0.02, h * 0.78), tile, 0.2),
    ]
    return Prop("pot", join(parts), lambda: pot(shop, shop.near(colour)), 2, plain=True)
