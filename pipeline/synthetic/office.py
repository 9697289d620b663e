"""An office room: desks with things on them, shelves, cabinets; people rearranged it between the visits."""

from __future__ import annotations

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.synthetic import furniture, prints, textures
from pipeline.synthetic.changes import Rearrangement
from pipeline.synthetic.footprint import Area, footprint, is_free
from pipeline.synthetic.lighting import room_lighting
from pipeline.synthetic.mix import draw_mix
from pipeline.synthetic.paths import walk
from pipeline.synthetic.props import Arrangement, Prop, Workshop, scatter
from pipeline.synthetic.shapes import Mesh, box, join, pose
from pipeline.synthetic.spots import Spot
from pipeline.synthetic.world import SensorSettings, SyntheticScene

_CARTON_BOARD = (186, 146, 102)


def small_thing(shop: Workshop) -> Prop:
    """Something that lies on a desk or a shelf."""
    match int(shop.rng.integers(7)):
        case 0:
            return furniture.mug(shop, prints.vivid(shop.rng, 90, 230))
        case 1:
            size = (shop.between(0.16, 0.34), shop.between(0.14, 0.26), shop.between(0.1, 0.26))
            board = shop.near(_CARTON_BOARD if shop.rng.random() < 0.6 else (215, 215, 210), 10)
            return furniture.carton(shop, size, board, prints.vivid(shop.rng, 30, 140))
        case 2:
            return furniture.book_stack(shop, shop.count(2, 5))
        case 3:
            return furniture.desk_lamp(shop, prints.vivid(shop.rng, 90, 230))
        case 4:
            return furniture.plant(shop, shop.between(0.25, 0.45), prints.vivid(shop.rng, 90, 220))
        case 5:
            return furniture.laptop(shop, shop.near((140, 140, 145), 40))
        case _:
            return furniture.books(shop, shop.count(4, 9))


def floor_thing(shop: Workshop) -> Prop:
    """Something that stands on the floor of an office."""
    match int(shop.rng.integers(5)):
        case 0:
            return furniture.plant(shop, shop.between(0.8, 1.3), prints.vivid(shop.rng, 60, 200))
        case 1:
            return furniture.bin_(shop, shop.near((90, 95, 105), 40))
        case 2:
            return furniture.bag(shop, prints.vivid(shop.rng, 40, 160))
        case 3:
            size = (shop.between(0.35, 0.6), shop.between(0.3, 0.5), shop.between(0.3, 0.55))
            return furniture.carton(shop, size, shop.near(_CARTON_BOARD, 10), prints.vivid(shop.rng, 30, 140))
        case _:
            return furniture.chair(shop, prints.vivid(shop.rng, 60, 200))


def room(shop: Workshop, width: float, depth: float, height: float) -> Mesh:
    """Floor, walls with posters, windows and a door, centred on the origin."""
    rng = shop.rng
    if rng.random() < 0.6:
        floor = shop.tile(textures.carpet(rng, shop.near((105, 108, 118), 25)), macro=0.08)
    else:
        floor = shop.tile(textures.wood(rng, shop.near((165, 125, 85), 18), 6, 512), gloss=0.06, macro=0.08)
    plaster = [
        shop.tile(textures.mottled(rng, shop.near((205, 198, 186), 14), 0.035), macro=0.05) for _ in range(4)
    ]
    ceiling = shop.tile(textures.masonry(rng, (222, 222, 218), (165, 165, 165), 4, 4, 256))
    w, d = width / 2, depth / 2
    parts = [
        box((-w, -d, -0.1), (w, d, 0), floor, 2.0),
        box((-w, -d, height), (w, d, height + 0.1), ceiling, 2.4),
        box((-w, -d - 0.1, 0), (w, -d, height), plaster[0], 2.2),
        box((-w, d, 0), (w, d + 0.1, height), plaster[1], 2.2, 0.3),
        box((-w - 0.1, -d, 0), (-w, d, height), plaster[2], 2.2, 0.6),
        box((w, -d, 0), (w + 0.1, d, height), plaster[3], 2.2, 0.9),
    ]
    skirting = shop.paint(shop.near((120, 110, 100), 30))
    for wall in range(4):
        length, distance = (width, d) if wall % 2 == 0 else (depth, w)
        turned: list[Mesh] = [
            box((-length / 2, distance - 0.015, 0), (length / 2, distance, 0.09), skirting, 0.4)
        ]
        x = -length / 2 + shop.between(0.3, 0.8)
        while x < length / 2 - 1.0:
            wide, tall = shop.between(0.5, 1.2), shop.between(0.5, 1.0)
            wide = min(wide, length / 2 - 0.2 - x)
            low = shop.between(1.25, 1.45)
            shown = shop.tile(prints.picture(rng), gloss=0.03)
            edge = shop.paint(shop.near((90, 80, 70), 40))
            faces = [edge, edge, shown, edge, edge, edge]
            turned.append(box((x, distance - 0.02, low), (x + wide, distance, low + tall), faces, None))
            x += wide + shop.between(0.3, 1.3)
        parts.append(join(turned).at(yaw=-wall * np.pi / 2))
    return join(parts)


def build(shop: Workshop, seed: int, frames: int, camera: PinholeCamera) -> SyntheticScene:
    """Draw an office."""
    rng = shop.rng
    width, depth, height = shop.between(6.4, 8.0), shop.between(5.2, 6.4), shop.between(2.6, 3.0)
    background = room(shop, width, depth, height)
    plan = Arrangement()
    wood = shop.near((170, 130, 90), 25)
    # Furniture along the walls, side by side; wall 0 is +y, the others follow clockwise.
    spots: list[Spot] = []
    for wall in range(4):
        length, distance = (width, depth / 2) if wall % 2 == 0 else (depth, width / 2)
        x = -length / 2 + (0.15 if wall % 2 == 0 else 1.0)
        end = length / 2 - (0.15 if wall % 2 == 0 else 1.0)
        T_wall = pose(0, 0, 0, -wall * np.pi / 2)
        while end - x > 0.9:
            kind = rng.choice(["desk", "desk", "bookcase", "cabinet"])
            if kind == "desk" and end - x > 1.5:
                w, d, h = (
                    shop.between(1.3, min(1.7, end - x)),
                    shop.between(0.65, 0.8),
                    shop.between(0.71, 0.76),
                )
                T = T_wall @ pose(x + w / 2, distance - d / 2 - 0.03, 0)
                plan.keep(furniture.desk(shop, (w, d, h), shop.near(wood, 10)), T)
                spots += _desk_spots(shop, Area(T @ pose(0, 0, h), w / 2, d / 2), shop.count(2, 4), True)
            elif kind == "bookcase":
                w, d, h = (
                    shop.between(0.8, min(1.2, end - x)),
                    shop.between(0.3, 0.36),
                    shop.between(1.4, 2.0),
                )
                case, levels = furniture.bookcase(shop, (w, d, h), shop.count(4, 5), shop.near(wood, 20))
                T = T_wall @ pose(x + w / 2, distance - d / 2 - 0.02, 0)
                plan.keep(case, T)
                for level in levels:
                    area = Area(T @ pose(0, 0, level), w / 2 - 0.02, d / 2)
                    for side in (-0.25, 0.25):
                        row = furniture.books(shop, max(3, int((w - 0.08) / 2 / 0.045)))
                        T_row = T @ pose(side * (w - 0.06), -0.01, level)
                        spots.append(Spot(T_row, row, area, "shelf", weight=0.35))
            else:
                w, d, h = shop.between(0.7, min(1.1, end - x)), shop.between(0.4, 0.5), shop.between(0.7, 1.1)
                T = T_wall @ pose(x + w / 2, distance - d / 2 - 0.02, 0)
                plan.keep(furniture.cabinet(shop, (w, d, h), shop.near((170, 170, 165), 30)), T)
                spots += _desk_spots(shop, Area(T @ pose(0, 0, h), w / 2, d / 2), shop.count(1, 2), False)
            x += w + shop.between(0.1, 0.6)
    # A table in the middle.
    w, d, h = shop.between(1.2, 1.8), shop.between(0.8, 1.0), 0.73
    middle = pose(rng.normal(0, 0.2), rng.normal(0, 0.2), 0, shop.between(-0.3, 0.3))
    table = furniture.desk(shop, (w, d, h), shop.near(wood, 25))
    plan.keep(table, middle)
    spots += _desk_spots(shop, Area(middle @ pose(0, 0, h), w / 2, d / 2), shop.count(3, 5), False)

    # On the floor, inside the ring of furniture.
    things = [floor_thing(shop) for _ in range(shop.count(9, 13))]
    inner = (width / 2 - 1.05, depth / 2 - 1.05)
    taken = (float(middle[0, 3]), float(middle[1, 3]), float(np.hypot(w, d)) / 2 * 0.85)
    radii = [thing.radius for thing in things]
    places = scatter(rng, (-inner[0], -inner[1]), inner, radii, 0.06, 200, taken=[taken])
    floor = Area(np.eye(4), *inner)
    spots += [
        Spot(pose(place[0], place[1], 0, shop.between(-np.pi, np.pi)), thing, floor, "floor")
        for thing, place in zip(things, places, strict=True)
        if place is not None
    ]

    def substitute(spot: Spot) -> Prop:
        return floor_thing(shop) if spot.group == "floor" else small_thing(shop)

    mix = draw_mix(shop, len(spots), seed % 3 == 0, (0.07, 0.07, 0.12), spare=0.5, jolted=shop.count(0, 3))
    Rearrangement(shop, spots, substitute, [footprint(table.mesh, middle)]).deal(mix, plan)

    partial = shop.count(0, 1)
    paths = tuple(_round(shop, visit == partial, width, depth, frames) for visit in (0, 1))
    return SyntheticScene(
        name="office",
        seed=seed,
        atlas=shop.atlas,
        background=background,
        objects=plan.objects(rng),
        lighting=(room_lighting(shop, width, depth, height), room_lighting(shop, width, depth, height)),
        paths=(paths[0], paths[1]),
        camera=camera,
        sensor=SensorSettings(max_range_m=7.5),
        truth_voxel_m=0.02,
    )


def _desk_spots(shop: Workshop, top: Area, count: int, screen: bool) -> list[Spot]:
    """Things on a table, and maybe a screen at its back, each with room of its own."""
    spots: list[Spot] = []
    if screen:
        shown = furniture.monitor(shop, shop.between(0.48, 0.62))
        at = shop.between(-0.15, 0.15), top.half_depth_m - 0.15
        T = top.T_world_area @ pose(at[0], at[1], 0, float(shop.rng.normal(0, 0.1)))
        spots.append(Spot(T, shown, top, "screen"))
    for _ in range(count):
        thing = small_thing(shop)
        for _ in range(30):
            x, y = (shop.between(-half, half) for half in (top.half_width_m, top.half_depth_m))
            T = top.T_world_area @ pose(x, y, 0, float(shop.rng.normal(0, 0.35)))
            box = footprint(thing.mesh, T)
            others = [footprint(spot.prop.mesh, spot.pose) for spot in spots]
            if top.contains(box) and is_free(box, others, 0.0):
                spots.append(Spot(T, thing, top, "desk"))
                break
    return spots


def _round(shop: Workshop, partial: bool, width: float, depth: float, frames: int) -> np.ndarray:
    """A walk round the middle of the room, looking across it or outwards; a partial one leaves a part out."""
    rng = shop.rng
    outward = rng.random() < 0.25
    laps = shop.between(1.0, 1.15)
    if partial:
        laps = shop.between(0.7, 0.85) if outward else shop.between(0.6, 0.8)
    # Two smaller rounds one above the other now and then.
    rounds = 2 if rng.random() < 0.25 and not partial else 1
    waypoints = 12 * rounds + 1
    start, turn = shop.between(0, 2 * np.pi), rng.choice([-1.0, 1.0])
    angle = start + turn * np.linspace(0, 2 * np.pi * laps * rounds, waypoints)
    reach = shop.between(0.05, 0.12) if outward else shop.between(0.17, 0.28)
    low, high = shop.between(1.25, 1.55), shop.between(1.55, 1.85)
    height = np.linspace(low, high, waypoints) if rounds == 2 else np.full(waypoints, shop.between(low, high))
    positions = np.stack(
        [
            np.cos(angle) * width * reach,
            np.sin(angle) * depth * reach,
            height + rng.normal(0, 0.06, waypoints),
        ],
        axis=1,
    )
    ahead = angle + (0.0 if outward else np.pi) + turn * shop.between(-0.35, 0.35)
    targets = np.stack(
        [
            np.cos(ahead) * width * 0.42,
            np.sin(ahead) * depth * 0.42,
            shop.between(0.45, 0.75) + rng.normal(0, 0.1, waypoints),
        ],
        axis=1,
    )
    return walk(positions, targets, frames, rng, 0.02)
