"""Things of a service tunnel: pipes with valves and gauges, signs, hoses, cables, and tools left behind."""

from __future__ import annotations

import cv2
import numpy as np

from pipeline.synthetic import prints, textures
from pipeline.synthetic.props import Prop, Workshop
from pipeline.synthetic.shapes import Mesh, Outline, box, cylinder, join, lathe, sphere
from pipeline.synthetic.sheets import tube
from pipeline.synthetic.textures import Colour, Tile


def sign_face(shop: Workshop, size: int = 128) -> Tile:
    """A warning or instruction: a bordered field, a symbol and lines of text."""
    rng = shop.rng
    ground = [(240, 200, 40), (238, 238, 232), (40, 90, 170), (190, 40, 38), (40, 130, 76)][
        int(rng.integers(5))
    ]
    ink = (24, 24, 26) if sum(ground) > 430 else (240, 240, 238)
    tile = textures.mottled(rng, shop.near(ground, 6), 0.05, size=size)
    prints.rectangle(tile, (4, 4), (size - 5, size - 5), ink, 3)
    centre = (int(rng.integers(28, size - 28)), 42)
    match int(rng.integers(4)):
        case 0:
            corners = np.array([[-24, 20], [24, 20], [0, -24]]) + centre
            cv2.fillPoly(tile, [corners.astype(np.int32)], [float(c) for c in ink], cv2.LINE_AA)
        case 1:
            cv2.circle(tile, centre, 22, [float(c) for c in ink], int(rng.integers(3, 9)), cv2.LINE_AA)
        case 2:
            cv2.arrowedLine(
                tile,
                (20, 42),
                (size - 20, int(rng.integers(28, 56))),
                [float(c) for c in ink],
                6,
                cv2.LINE_AA,
                tipLength=0.35,
            )
        case _:
            prints.write(tile, prints.word(rng, 2), (30, 60), 1.8, ink, 4)
    for line in range(int(rng.integers(1, 3))):
        prints.write(tile, prints.word(rng, int(rng.integers(4, 8))), (10, 88 + 22 * line), 0.7, ink, 2)
    return tile


def sign(shop: Workshop, size: tuple[float, float]) -> Prop:
    """A plate on a wall (z points away from it, y up): only its print says which."""
    width, height = size
    shown, edge = shop.tile(sign_face(shop), gloss=0.05), shop.paint((170, 170, 168), 0.1)
    plate = box(
        (-width / 2, -height / 2, 0.0),
        (width / 2, height / 2, 0.012),
        [edge, edge, edge, edge, edge, shown],
        None,
    )
    return Prop("sign", plate, lambda: sign(shop, size))


def gauge(shop: Workshop, radius: float) -> Prop:
    """A round instrument on a wall or pipe; its dial faces z."""
    dial = textures.mottled(shop.rng, (232, 232, 226), 0.03, size=128)
    for tick in np.linspace(-2.3, 2.3, 13):
        inner = (int(64 + 42 * np.sin(tick)), int(64 - 42 * np.cos(tick)))
        outer = (int(64 + 54 * np.sin(tick)), int(64 - 54 * np.cos(tick)))
        cv2.line(dial, inner, outer, (20.0, 20.0, 22.0), 3, cv2.LINE_AA)
    zone = [float(c) for c in prints.vivid(shop.rng, 120, 220)]
    cv2.ellipse(dial, (64, 64), (36, 36), 0, shop.between(0, 180), shop.between(200, 330), zone, 8)
    needle = shop.between(-2.2, 2.2)
    tip = (int(64 + 40 * np.sin(needle)), int(64 - 40 * np.cos(needle)))
    cv2.line(dial, (64, 64), tip, (180.0, 20.0, 20.0), 5, cv2.LINE_AA)
    prints.write(dial, prints.word(shop.rng, 3), (36, 104), 0.9, (20, 20, 22), 2)
    face, metal = shop.tile(dial, gloss=0.05), shop.paint((120, 122, 124), 0.15, 0.15)
    half = radius * 0.72
    parts = [
        cylinder(radius * 0.35, 0.1, metal, 0.3, segments=10),
        cylinder(radius, 0.06, metal, 0.4, segments=20).at(z=0.08),
        box((-half, -half, 0.139), (half, half, 0.145), [metal] * 5 + [face], None),
    ]
    return Prop("gauge", join(parts), lambda: gauge(shop, radius))


def valve(shop: Workshop, radius: float, colour: Colour) -> Prop:
    """A gate valve around a pipe of this radius along x, its hand wheel up z."""
    body, wheel = shop.paint(shop.near((86, 92, 98), 15), 0.2, 0.08), shop.paint(colour, 0.15, 0.08)
    tag = shop.tile(sign_face(shop, 64))
    width, rim = radius * 2.2, radius * shop.between(1.0, 1.4)
    top = radius * 2.4
    parts: list[Mesh] = []
    for x in (-width / 2, width / 2 - 0.04):
        parts.append(cylinder(radius * 1.5, 0.04, body, 0.4, segments=16).at(x, 0, 0, np.pi / 2, "y"))
    parts.append(sphere(radius * 1.35, body, 0.5))
    parts.append(cylinder(radius * 0.4, top, body, 0.4, segments=10))
    angle = np.linspace(0, 2 * np.pi, 17)
    ring = np.stack([rim * np.cos(angle), rim * np.sin(angle), np.full(17, top)], axis=1)
    parts.append(tube(ring, 0.018, wheel, 0.3, 8, caps=False))
    for spoke in range(2):
        across = np.array([[-rim, 0, top], [0, 0, top + 0.01], [rim, 0, top]])
        parts.append(tube(across, 0.012, wheel, 0.3, 6).at(yaw=spoke * np.pi / 2))
    parts.append(box((-0.07, -radius * 1.45, -0.05), (0.07, -radius * 1.3, 0.08), tag, None))
    return Prop("valve", join(parts), lambda: valve(shop, radius, shop.near(colour, 8)))


def sleeve(shop: Workshop, radius: float) -> Prop:
    """Insulation wrapped around a pipe along x, with bands and a label."""
    wrap = textures.cloth(shop.rng, [shop.near((196, 192, 180), 18), prints.vivid(shop.rng, 90, 200)], 8)
    prints.write(wrap, prints.word(shop.rng, 4), (20, 150), 1.6, prints.vivid(shop.rng, 20, 110), 4)
    tile, length = shop.tile(wrap), shop.between(0.4, 0.8)
    x = np.linspace(-length / 2, length / 2, 9)
    path = np.stack([x, np.zeros(9), np.zeros(9)], axis=1)
    mesh = tube(path, radius * shop.between(1.25, 1.5), tile, None, 16)
    return Prop("sleeve", mesh, lambda: sleeve(shop, radius))


def hose_coil(shop: Workshop, colour: Colour) -> Prop:
    """Turns of a soft hose lying on each other, none quite round, one end loose."""
    tile = shop.tile(textures.cloth(shop.rng, [colour, shop.near(colour, 50)], shop.count(3, 9), 128))
    turns, radius = shop.count(3, 5), shop.between(0.18, 0.26)
    angle = np.linspace(0, 2 * np.pi * turns, 16 * turns)
    wobble = radius * (1 + 0.07 * np.sin(angle * 0.7 + shop.between(0, 6)) + 0.05 * np.sin(2.3 * angle))
    z = 0.025 + 0.035 * angle / (2 * np.pi)
    path = np.stack([wobble * np.cos(angle), wobble * np.sin(angle), z], axis=1)
    end = path[-1] + np.array([[0.02, 0.1, -0.03], [0.08, 0.2, -0.07], [0.17, 0.26, -0.1]])
    end[:, 2] = np.maximum(end[:, 2], 0.03)
    mesh = tube(np.concatenate([path, end]), 0.024, tile, 0.3, 8)
    return Prop("hose", mesh, lambda: hose_coil(shop, shop.near(colour, 8)))


def slack_cable(shop: Workshop, colour: Colour) -> Prop:
    """A bundle of cables looped from two hooks at z = 0, with a printed tag."""
    tile = shop.tile(textures.cloth(shop.rng, [colour, (40, 40, 42)], shop.count(2, 6), 64))
    tag = shop.tile(sign_face(shop, 64))
    span, drop = shop.between(0.5, 0.9), shop.between(0.35, 0.7)
    share = np.linspace(-1, 1, 15)
    parts = []
    for strand in range(shop.count(2, 3)):
        depth = drop * (1 - 0.13 * strand)
        path = np.stack([share * span / 2, np.full(15, 0.03 * strand), -depth * (1 - share**2)], axis=1)
        parts.append(tube(path, 0.018, tile, 0.2, 8))
    parts.append(box((-0.06, -0.03, -drop - 0.13), (0.06, -0.02, -drop + 0.02), tag, None))
    return Prop("cable", join(parts), lambda: slack_cable(shop, shop.near(colour)))


def pendant(shop: Workshop, colour: Colour) -> Prop:
    """A caged lamp on a cable; its hook is at z = 0."""
    drop, radius = shop.between(0.25, 0.5), shop.between(0.1, 0.16)
    shade = shop.tile(textures.cloth(shop.rng, [colour, shop.near(colour, 40)], shop.count(0, 4), 64))
    cable, glass = shop.paint((34, 34, 36)), shop.paint((240, 232, 200), 0.04, 0.2)
    tag = shop.tile(sign_face(shop, 64))
    parts = [
        cylinder(0.008, drop, cable, 0.2, segments=6).at(z=-drop),
        cylinder(radius, 0.14, shade, 0.3, top=0.04, segments=14).at(z=-drop - 0.1),
        sphere(radius * 0.6, glass, 0.3).at(z=-drop - 0.13),
        box((-0.05, -0.014, -drop * 0.75), (0.05, -0.008, -drop * 0.75 + 0.1), tag, None),
    ]
    return Prop("pendant", join(parts), lambda: pendant(shop, shop.near(colour)))


def extinguisher(shop: Workshop) -> Prop:
    """A red bottle with a printed label and a hose, standing on z = 0."""
    face = textures.mottled(shop.rng, (186, 34, 30), 0.08)
    label = cv2.resize(sign_face(shop), (120, 120), interpolation=cv2.INTER_AREA)
    face[80:200, 60:180] = label
    red, dark = shop.tile(face, gloss=0.12), shop.paint((30, 30, 32))
    profile: Outline = [
        [0, 0],
        [0.085, 0.0],
        [0.09, 0.05],
        [0.09, 0.42],
        [0.05, 0.49],
        [0.03, 0.52],
        [0, 0.52],
    ]
    hose = np.array([[0.03, 0, 0.53], [0.12, 0, 0.5], [0.13, 0, 0.3], [0.11, 0, 0.12]])
    parts = [lathe(profile, red, None, 18), tube(hose, 0.012, dark, 0.2, 6)]
    parts.append(box((-0.06, -0.02, 0.52), (0.07, 0.02, 0.57), dark))
    return Prop("extinguisher", join(parts), lambda: extinguisher(shop))


def spool(shop: Workshop, colour: Colour) -> Prop:
    """A cable reel standing on its flange, with print on the flange."""
    flange = shop.tile(textures.wood(shop.rng, shop.near((170, 136, 94)), 4))
    shown, wound = shop.tile(sign_face(shop)), shop.tile(textures.cloth(shop.rng, [colour, (40, 40, 40)], 16))
    radius, height = shop.between(0.2, 0.32), shop.between(0.22, 0.34)
    half = radius * 0.6
    parts = [
        cylinder(radius, 0.03, flange, 0.5),
        cylinder(radius * 0.75, height, wound, 0.4),
        cylinder(radius, 0.03, flange, 0.5).at(z=height),
        box((-half, -half, height + 0.03), (half, half, height + 0.034), shown, None),
    ]
    return Prop("spool", join(parts), lambda: spool(shop, shop.near(colour)), tips=True)


def bottle(shop: Workshop, colour: Colour) -> Prop:
    """A gas cylinder with a stencilled band."""
    face = textures.mottled(shop.rng, colour, 0.1)
    prints.rectangle(face, (0, 60), (255, 110), prints.vivid(shop.rng, 90, 230))
    prints.write(face, prints.word(shop.rng, 5), (10, 200), 1.9, (235, 235, 230), 5)
    tile, brass = shop.tile(face, gloss=0.08), shop.paint((150, 126, 70), 0.2, 0.2)
    r, h = shop.between(0.1, 0.13), shop.between(0.8, 1.15)
    profile: Outline = [
        [0, 0],
        [r, 0],
        [r, h * 0.82],
        [r * 0.7, h * 0.92],
        [r * 0.3, h * 0.96],
        [0, h * 0.97],
    ]
    parts = [lathe(profile, tile, None, 18), cylinder(0.03, 0.1, brass, 0.2, segments=10).at(z=h * 0.95)]
    return Prop("bottle", join(parts), lambda: bottle(shop, shop.near(colour, 6)))


def junction(shop: Workshop, size: tuple[float, float]) -> Prop:
    """A switch box on a wall (z points away from it, y up) with a printed door and cable ends."""
    width, height = size
    shell, door = shop.paint(shop.near((128, 134, 136), 20), 0.08), shop.tile(sign_face(shop))
    dark = shop.paint((36, 36, 38))
    parts = [
        box(
            (-width / 2, -height / 2, 0),
            (width / 2, height / 2, 0.14),
            [shell, shell, shell, shell, shell, door],
            None,
        )
    ]
    for x in np.linspace(-width * 0.3, width * 0.3, 3):
        drop = np.array(
            [[x, -height / 2, 0.07], [x, -height / 2 - 0.08, 0.06], [x, -height / 2 - 0.16, 0.02]]
        )
        parts.append(tube(drop, 0.012, dark, 0.2, 6))
    return Prop("junction box", join(parts), lambda: junction(shop, size))


def bucket(shop: Workshop, colour: Colour) -> Prop:
    """An open bucket with a print."""
    face = textures.mottled(shop.rng, colour, 0.08)
    prints.rectangle(face, (60, 70), (190, 190), prints.vivid(shop.rng, 130, 240))
    prints.write(face, prints.word(shop.rng, 3), (70, 145), 1.6, (24, 24, 26), 4)
    tile = shop.tile(face)
    r, h = shop.between(0.13, 0.17), shop.between(0.25, 0.33)
    profile: Outline = [[0, 0], [r * 0.78, 0], [r, h], [r * 0.94, h], [r * 0.74, 0.02], [0, 0.02]]
    return Prop("bucket", lathe(profile, tile, None, 20), lambda: bucket(shop, shop.near(colour, 6)))
