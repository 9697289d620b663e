"""A town square: in one visit a market fills it, in the other most of that is gone."""

from __future__ import annotations

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.synthetic import furniture, goods, prints, street, textures
from pipeline.synthetic.carpark import OUTDOOR_SENSOR
from pipeline.synthetic.changes import Rearrangement
from pipeline.synthetic.footprint import Area, Footprint, footprint
from pipeline.synthetic.lighting import daylight
from pipeline.synthetic.mix import draw_mix
from pipeline.synthetic.paths import walk
from pipeline.synthetic.props import Arrangement, Prop, Workshop, scatter
from pipeline.synthetic.shapes import Mesh, box, join, pose
from pipeline.synthetic.spots import Reach, Spot
from pipeline.synthetic.world import SyntheticScene


def square(shop: Workshop, width: float, depth: float) -> Mesh:
    """Paving with bands of another stone, and houses on all four sides."""
    rng = shop.rng
    paving = shop.tile(
        textures.masonry(
            rng, shop.near((150, 142, 130), 14), (104, 98, 90), shop.count(6, 12), shop.count(4, 8), 512
        ),
        macro=0.13,
    )
    band = shop.tile(textures.masonry(rng, shop.near((110, 106, 102), 12), (80, 78, 74), 4, 4), macro=0.08)
    parts = [box((-width / 2 - 4, -depth / 2 - 4, -0.2), (width / 2 + 4, depth / 2 + 4, 0), paving, 3.0)]
    for x in np.arange(-width / 2 + 2, width / 2, shop.between(4.5, 7)):
        parts.append(box((x, -depth / 2, 0), (x + 0.4, depth / 2, 0.004), band, 1.0, x))
    height = shop.between(7, 11)
    for side in range(4):
        length, distance = (width, depth / 2) if side % 2 == 0 else (depth, width / 2)
        houses = street.facade_row(shop, length, height)
        parts.append(join([houses.at(0, distance)]).at(yaw=-side * np.pi / 2))
    return join(parts)


def market_thing(shop: Workshop, colours: list) -> Prop:
    """Something that comes and goes with a market."""
    match int(shop.rng.integers(9)):
        case 0 | 1:
            ground = (shop.between(2.3, 3.2), shop.between(2.2, 2.8))
            pair = [colours[int(i)] for i in shop.rng.choice(len(colours), 2, replace=False)]
            return street.tent(shop, ground, [shop.near(c, 12) for c in pair])
        case 2 | 3:
            return street.stall(shop, shop.between(1.6, 2.8))
        case 4:
            return street.parasol(shop, shop.between(1.1, 1.6))
        case 5:
            return street.wheelie_bin(shop, prints.vivid(shop.rng, 40, 130))
        case 6:
            return street.trolley(shop, prints.vivid(shop.rng, 60, 200))
        case 7:
            size = (shop.between(0.6, 1.0), shop.between(0.5, 0.8), shop.between(0.5, 1.0))
            return goods.crate(shop, size, shop.near((160, 120, 78), 24))
        case _:
            size = (shop.between(0.6, 0.9), shop.between(0.5, 0.8), shop.between(0.5, 0.9))
            return furniture.carton(
                shop, size, shop.near((186, 146, 102), 14), prints.vivid(shop.rng, 30, 140)
            )


def build(shop: Workshop, seed: int, frames: int, camera: PinholeCamera) -> SyntheticScene:
    """Draw a market square."""
    rng = shop.rng
    width, depth = shop.between(29, 34), shop.between(25, 29)
    plan = Arrangement()
    colours = [prints.vivid(rng, 120, 235) for _ in range(4)] + [np.array([232.0, 228.0, 218.0])]
    lasting: list[Prop] = [street.fountain(shop, shop.between(1.4, 2.0))]
    lasting += [street.tree(shop, shop.between(3.6, 5.5)) for _ in range(shop.count(3, 6))]
    lasting += [street.lamppost(shop, shop.between(3.2, 4.2)) for _ in range(shop.count(3, 5))]
    lasting += [street.bench(shop, shop.between(1.6, 2.2)) for _ in range(shop.count(3, 5))]
    passing = [market_thing(shop, colours) for _ in range(shop.count(38, 48))]
    passing.sort(key=lambda prop: -prop.radius)
    # The camera walks round the square: the ring of its path stays free of things.
    inner = (width / 2 - 5.2, depth / 2 - 5.2)
    everything = lasting[:1] + passing[:9] + lasting[1:] + passing[9:]
    # Crowns overhang their neighbours; the corners of tents nearly touch.
    room = {"tree": 0.55, "tent": 0.86, "stall": 0.9}
    radii = [thing.radius * room.get(thing.class_name, 1.0) for thing in everything]
    places = scatter(rng, (-inner[0], -inner[1]), inner, radii, 0.15, 800)
    spots: list[Spot] = []
    obstacles: list[Footprint] = []
    floor = Area(np.eye(4), *inner)
    for thing, place in zip(everything, places, strict=True):
        if place is None:
            continue
        T = pose(place[0], place[1], 0, rng.integers(4) * np.pi / 2 + rng.normal(0, 0.2))
        if any(thing is kept for kept in lasting):
            plan.keep(thing, T)
            obstacles.append(footprint(thing.mesh, T, 0.5 if thing.class_name == "tree" else 1.0))
        else:
            spots.append(Spot(T, thing, floor, "square"))
    arriving = rng.random() < 0.5
    shares = (0.28, 0.05, 0.12) if arriving else (0.05, 0.28, 0.12)
    mix = draw_mix(shop, len(spots), seed % 3 == 0, shares, spare=0.5, jolted=shop.count(0, 2))
    # Crowns and awnings overhang their neighbours: boxes around things are taken a little smaller.
    reach = Reach(shift_m=(0.15, 0.6), nudge_m=0.05, footprint_scale=0.9)
    Rearrangement(shop, spots, lambda _: market_thing(shop, colours), obstacles, reach).deal(mix, plan)

    partial = shop.count(0, 1)
    return SyntheticScene(
        name="market",
        seed=seed,
        atlas=shop.atlas,
        background=square(shop, width, depth),
        objects=plan.objects(rng),
        lighting=(daylight(shop), daylight(shop)),
        paths=(
            _round(shop, partial == 0, width, depth, frames),
            _round(shop, partial == 1, width, depth, frames),
        ),
        camera=camera,
        sensor=OUTDOOR_SENSOR,
        truth_voxel_m=0.05,
    )


def _round(shop: Workshop, partial: bool, width: float, depth: float, frames: int) -> np.ndarray:
    """Round the square near the houses, looking across it; a partial one leaves a side out."""
    rng = shop.rng
    laps = shop.between(0.42, 0.62) if partial else shop.between(0.95, 1.05)
    start, turn = shop.between(0, 2 * np.pi), rng.choice([-1.0, 1.0])
    angle = start + turn * np.linspace(0, 2 * np.pi * laps, 17)
    margin, height = shop.between(2.2, 3.8), shop.between(1.6, 2.6)
    # A rounded rectangle: a circle pushed outwards.
    unit = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    unit /= (np.abs(unit) ** 4).sum(1, keepdims=True) ** 0.25
    positions = np.concatenate(
        [unit * [width / 2 - margin, depth / 2 - margin], height + rng.normal(0, 0.08, (17, 1))], axis=1
    )
    ahead = angle + np.pi - turn * shop.between(-0.3, 0.8)
    targets = np.stack([np.cos(ahead) * width * 0.12, np.sin(ahead) * depth * 0.12, np.full(17, 0.9)], axis=1)
    return walk(positions, targets, frames, rng, 0.04)
