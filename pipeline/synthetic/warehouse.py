"""A warehouse aisle between pallet racks full of look-alike cartons, with goods on the floor at its end."""

from __future__ import annotations

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.synthetic import furniture, goods, prints, textures
from pipeline.synthetic.changes import Rearrangement
from pipeline.synthetic.footprint import Area
from pipeline.synthetic.lighting import room_lighting
from pipeline.synthetic.mix import draw_mix
from pipeline.synthetic.paths import walk
from pipeline.synthetic.props import Arrangement, Prop, Workshop, scatter
from pipeline.synthetic.shapes import Mesh, box, join, pose
from pipeline.synthetic.spots import Spot
from pipeline.synthetic.world import SensorSettings, SyntheticScene

_RACK_DEPTH_M = 0.95


def hall(shop: Workshop, low: tuple[float, float], high: tuple[float, float], height: float) -> Mesh:
    """Floor with a painted lane, walls of panels and signs, a roof."""
    rng = shop.rng
    floor = shop.tile(textures.speckled(rng, shop.near((150, 148, 142), 14), 0.16), gloss=0.05, macro=0.12)
    panel = textures.cloth(rng, [shop.near((172, 178, 182), 14), shop.near((160, 166, 170), 10)], 16)
    wall = shop.tile(panel, macro=0.06)
    block = shop.tile(
        textures.masonry(rng, shop.near((168, 164, 155), 12), (130, 128, 122), 6, 3), macro=0.06
    )
    roof = shop.tile(textures.cloth(rng, [(120, 122, 126), (96, 98, 102)], 8))
    line = shop.tile(textures.speckled(rng, (214, 178, 40), 0.25, 128))
    (x0, y0), (x1, y1) = low, high
    parts = [
        box((x0, y0, -0.1), (x1, y1, 0), floor, 3.0),
        box((x0, y0, height), (x1, y1, height + 0.1), roof, 2.0),
        box((x0, y0 - 0.1, 0), (x1, y0, height), block, 1.6),
        box((x0, y1, 0), (x1, y1 + 0.1, height), block, 1.6, 0.4),
        box((x0 - 0.1, y0, 0), (x0, y1, height), wall, 2.0),
        box((x1, y0, 0), (x1 + 0.1, y1, height), wall, 2.0, 0.3),
    ]
    for y in (-1.25, 1.25):
        parts.append(box((x0 + 0.5, y - 0.05, 0), (x1 - 0.5, y + 0.05, 0.003), line, 0.5))
    for x in (x0, x1):
        for y in np.arange(y0 + 0.8, y1 - 1.2, 1.7):
            shown = shop.tile(prints.picture(rng, 128))
            inner = x + 0.02 if x == x0 else x - 0.02
            bounds = sorted((x, inner))
            wide, low_z = shop.between(0.5, 0.9), shop.between(1.4, 2.4)
            parts.append(box((bounds[0], y, low_z), (bounds[1], y + wide, low_z + wide), shown, None))
    return join(parts)


def build(shop: Workshop, seed: int, frames: int, camera: PinholeCamera) -> SyntheticScene:
    """Draw a warehouse."""
    rng = shop.rng
    bays, bay = shop.count(3, 4), shop.between(2.1, 2.5)
    aisle = shop.between(3.3, 3.9)
    levels = [0.14, shop.between(1.15, 1.3), shop.between(2.15, 2.35)]
    length = bays * bay
    end = length / 2 + shop.between(3.6, 4.4)
    side = aisle / 2 + _RACK_DEPTH_M + shop.between(0.15, 0.5)
    low, high = (-length / 2 - 2.2, -side), (end, side)
    height = shop.between(3.8, 4.6)
    plan = Arrangement()
    paint, beam = shop.near((52, 78, 128), 30), shop.near((222, 112, 36), 14)
    families = [
        (
            (shop.between(0.36, 0.62), shop.between(0.38, 0.6), shop.between(0.28, 0.52)),
            shop.near((188, 148, 104), 14) if rng.random() < 0.75 else shop.near((216, 214, 206), 8),
            prints.vivid(rng, 25, 120),
        )
        for _ in range(shop.count(3, 5))
    ]

    def good() -> Prop:
        if rng.random() < 0.13:
            return goods.drum(shop, drum_colour, shop.between(0.2, 0.26), shop.between(0.5, 0.7))
        if rng.random() < 0.1:
            return goods.crate(shop, (0.58, 0.4, shop.between(0.22, 0.34)), prints.vivid(rng, 60, 200))
        size, board, ink = families[int(rng.integers(len(families)))]
        width, depth, tall = shop.similar(size, 0.02)
        return furniture.carton(shop, (width, depth, tall), shop.near(board, 4), shop.near(ink, 10))

    drum_colour = prints.vivid(rng, 70, 180)
    spots: list[Spot] = []
    for row, facing in ((-1, np.pi), (1, 0.0)):
        for number in range(bays):
            centre = pose(
                -length / 2 + (number + 0.5) * bay, row * (aisle / 2 + _RACK_DEPTH_M / 2), 0, facing
            )
            plan.keep(
                goods.rack(shop, bay, _RACK_DEPTH_M, levels, shop.near(paint, 6), shop.near(beam, 6)), centre
            )
            for z in levels:
                x = -bay / 2 + shop.between(0.14, 0.3)
                while True:
                    thing = good()
                    half = float(thing.mesh.bounds[1, 0])
                    if x + 2 * half > bay / 2 - 0.12:
                        break
                    if rng.random() < 0.93:
                        yaw, y = rng.normal(0, 0.07), shop.between(-0.14, 0.06)
                        deck = Area(centre @ pose(0, 0, z), bay / 2 - 0.1, _RACK_DEPTH_M / 2)
                        spots.append(Spot(centre @ pose(x + half, y, z, yaw), thing, deck, "rack"))
                    x += 2 * half + shop.between(0.05, 0.2)

    # Pallets, stacks, drums and trucks on the floor at the end of the aisle.
    def floor_thing() -> Prop:
        match int(rng.integers(5)):
            case 0:
                return goods.pallet(shop)
            case 1:
                return goods.drum(shop, drum_colour)
            case 2:
                return goods.cone(shop)
            case 3:
                return goods.pallet_truck(shop, prints.vivid(rng, 120, 220))
            case _:
                size = (shop.between(0.6, 0.9), shop.between(0.6, 0.8), shop.between(0.5, 0.9))
                board, ink = families[0][1:]
                return furniture.carton(shop, size, shop.near(board, 6), shop.near(ink, 10))

    floor_things = [floor_thing() for _ in range(shop.count(8, 11))]
    corner = (length / 2 + 0.3, low[1] + 0.2), (end - 0.2, high[1] - 0.2)
    radii = [thing.radius for thing in floor_things]
    places = scatter(rng, corner[0], corner[1], radii, 0.1, 300)
    (x0, y0), (x1, y1) = corner
    floor = Area(pose((x0 + x1) / 2, (y0 + y1) / 2, 0), (x1 - x0) / 2, (y1 - y0) / 2)
    spots += [
        Spot(pose(place[0], place[1], 0, shop.between(-np.pi, np.pi)), thing, floor, "floor", weight=1.8)
        for place, thing in zip(places, floor_things, strict=True)
        if place is not None
    ]

    def substitute(spot: Spot) -> Prop:
        return floor_thing() if spot.group == "floor" else good()

    mix = draw_mix(shop, len(spots), seed % 3 == 1, (0.07, 0.07, 0.13), spare=0.7, jolted=shop.count(0, 4))
    Rearrangement(shop, spots, substitute).deal(mix, plan)

    partial = shop.count(0, 1)
    return SyntheticScene(
        name="warehouse",
        seed=seed,
        atlas=shop.atlas,
        background=hall(shop, low, high, height),
        objects=plan.objects(rng),
        lighting=(
            room_lighting(shop, length, 2 * side, height),
            room_lighting(shop, length, 2 * side, height),
        ),
        paths=(
            _patrol(shop, partial == 0, length, aisle, frames),
            _patrol(shop, partial == 1, length, aisle, frames),
        ),
        camera=camera,
        sensor=SensorSettings(max_range_m=9.0),
        truth_voxel_m=0.025,
    )


def _patrol(shop: Workshop, partial: bool, length: float, aisle: float, frames: int) -> np.ndarray:
    """Up the aisle looking at one side, across the end, and back looking at the other.

    A partial patrol leaves out the far bays of one side.
    """
    rng = shop.rng
    height = shop.between(1.35, 1.95)
    ahead, reach = shop.between(0.3, 1.4), length / 2
    near = aisle / 2 * shop.between(0.5, 0.78)
    stop = -reach + (shop.between(0.2, 0.45) * length if partial else 0.0)
    down = shop.between(0.8, 1.25)
    first = float(rng.choice([-1, 1]))  # the side walked along first
    positions, targets = [], []
    for x in np.linspace(-reach - 0.6, reach + 0.2, 6):
        positions.append((x, -first * near, height))
        targets.append((x + ahead, first * (aisle / 2 + 0.4), down))
    positions.append((reach + 0.6, 0, height))
    targets.append((reach + 3.2, first * (aisle / 2 - 0.6), 0.5))
    positions.append((reach + 0.4, first * near * 0.6, height))
    targets.append((reach + 3.2, -first * (aisle / 2 + 0.2), 0.4))
    for x in np.linspace(reach + 0.3, stop, 6):
        positions.append((x, first * near, height + shop.between(-0.1, 0.1)))
        targets.append((x - ahead, -first * (aisle / 2 + 0.4), down))
    order = slice(None) if rng.random() < 0.5 else slice(None, None, -1)
    return walk(np.array(positions)[order], np.array(targets)[order], frames, rng, 0.025)
