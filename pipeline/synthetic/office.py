"""An office room: desks with things on them, shelves, cabinets; people rearranged it between the visits."""

from __future__ import annotations

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.synthetic import furniture, prints, textures
from pipeline.synthetic.lighting import room_lighting
from pipeline.synthetic.paths import walk
from pipeline.synthetic.props import Arrangement, Prop, Workshop, fates, nudge, scatter
from pipeline.synthetic.shapes import Mesh, box, join, pose
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
    surfaces: list[tuple[np.ndarray, float, float]] = []  # T_world_surface, width, depth
    for wall in range(4):
        length, distance = (width, depth / 2) if wall % 2 == 0 else (depth, width / 2)
        turn = -wall * np.pi / 2
        x = -length / 2 + (0.15 if wall % 2 == 0 else 1.0)
        end = length / 2 - (0.15 if wall % 2 == 0 else 1.0)
        while end - x > 0.9:
            kind = rng.choice(["desk", "desk", "bookcase", "cabinet"])
            T_wall = pose(0, 0, 0, turn)
            if kind == "desk" and end - x > 1.5:
                w, d, h = (
                    shop.between(1.3, min(1.7, end - x)),
                    shop.between(0.65, 0.8),
                    shop.between(0.71, 0.76),
                )
                T = T_wall @ pose(x + w / 2, distance - d / 2 - 0.03, 0)
                plan.keep(furniture.desk(shop, (w, d, h), shop.near(wood, 10)), T)
                back = distance - d / 2 - 0.03
                T_screen = T_wall @ pose(
                    x + w / 2 + shop.between(-0.15, 0.15), back + 0.15, h, rng.normal(0, 0.1)
                )
                screen = furniture.monitor(shop, shop.between(0.48, 0.62))
                fate = rng.choice(["static", "static", "static", "disappeared", "appeared", "replaced"])
                plan.deal(str(fate), screen, T_screen)
                surfaces.append((T_wall @ pose(x + w * 0.16, back, h), w * 0.3, d))
                surfaces.append((T_wall @ pose(x + w * 0.84, back, h), w * 0.3, d))
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
                    for side in (-0.25, 0.25):
                        surfaces.append((T @ pose(side * (w - 0.06), -0.01, level), (w - 0.08) / 2, -d))
            else:
                w, d, h = shop.between(0.7, min(1.1, end - x)), shop.between(0.4, 0.5), shop.between(0.7, 1.1)
                T = T_wall @ pose(x + w / 2, distance - d / 2 - 0.02, 0)
                plan.keep(furniture.cabinet(shop, (w, d, h), shop.near((170, 170, 165), 30)), T)
                surfaces.append((T @ pose(0, 0, h), w - 0.06, d - 0.04))
            x += w + shop.between(0.1, 0.6)
    # A table in the middle.
    w, d, h = shop.between(1.2, 1.8), shop.between(0.8, 1.0), 0.73
    middle = pose(rng.normal(0, 0.2), rng.normal(0, 0.2), 0, shop.between(-0.3, 0.3))
    plan.keep(furniture.desk(shop, (w, d, h), shop.near(wood, 25)), middle)
    for side in (-0.33, 0, 0.33):
        surfaces.append((middle @ pose(side * w, 0, h), w * 0.3, d * 0.9))

    # Small things: one spot each; a third of the spots stays free for what is moved.
    spots = []
    for T_surface, spot_width, spot_depth in surfaces:
        is_shelf = spot_depth < 0
        thing = furniture.books(shop, max(3, int(spot_width / 0.045))) if is_shelf else small_thing(shop)
        room_x = max(spot_width / 2 - thing.radius, 0)
        room_y = 0 if is_shelf else max(spot_depth / 2 - thing.radius, 0)
        yaw = 0.0 if is_shelf else rng.normal(0, 0.35)
        T = T_surface @ pose(
            shop.between(-room_x, room_x + 1e-9), shop.between(-room_y, room_y + 1e-9), 0, yaw
        )
        spots.append((T, thing, is_shelf))
    _deal_spots(plan, rng, [s for s in spots if not s[2]], moved=shop.between(0.1, 0.24))
    _deal_spots(plan, rng, [s for s in spots if s[2]], moved=0.08)

    # On the floor, inside the ring of furniture.
    things = [floor_thing(shop) for _ in range(shop.count(9, 13))]
    inner = (width / 2 - 1.05, depth / 2 - 1.05)
    table = (float(middle[0, 3]), float(middle[1, 3]), float(np.hypot(w, d)) / 2 * 0.85)
    radii = [thing.radius for thing in things]
    places = scatter(rng, (-inner[0], -inner[1]), inner, radii, 0.06, 200, taken=[table])
    standing = [
        (pose(place[0], place[1], 0, shop.between(-np.pi, np.pi)), thing, False)
        for thing, place in zip(things, places, strict=True)
        if place is not None
    ]
    _deal_spots(plan, rng, standing, moved=0.2)

    paths = tuple(_round(shop, visit, width, depth, frames) for visit in (0, 1))
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


def _deal_spots(
    plan: Arrangement, rng: np.random.Generator, spots: list[tuple[np.ndarray, Prop, bool]], moved: float
) -> None:
    """Give each spot's thing a fate; a moved thing takes over a spot whose own thing is left out."""
    dealt = fates(rng, len(spots), moved=moved, spare=moved, disappeared=0.09, appeared=0.09, replaced=0.12)
    free = [spot[0] for spot, fate in zip(spots, dealt, strict=True) if fate == "spare"]
    for (T, thing, _), fate in zip(spots, dealt, strict=True):
        if fate == "spare":
            continue
        goal = free.pop() if fate == "moved" and free else None
        plan.deal(fate, thing, T, goal, nudge(rng, 0.006, 0.03))


def _round(shop: Workshop, visit: int, width: float, depth: float, frames: int) -> np.ndarray:
    """A walk round the middle of the room, looking across it at the opposite wall."""
    rng = shop.rng
    laps = 1.0 if visit == 0 else shop.between(0.82, 0.95)
    start, turn = shop.between(0, 2 * np.pi), rng.choice([-1.0, 1.0])
    angle = start + turn * np.linspace(0, 2 * np.pi * laps, 13)
    reach = shop.between(0.2, 0.27)
    height = shop.between(1.5, 1.75)
    positions = np.stack(
        [np.cos(angle) * width * reach, np.sin(angle) * depth * reach, height + rng.normal(0, 0.06, 13)],
        axis=1,
    )
    ahead = angle + np.pi + turn * shop.between(-0.35, 0.35)
    targets = np.stack(
        [
            np.cos(ahead) * width * 0.42,
            np.sin(ahead) * depth * 0.42,
            shop.between(0.5, 0.75) + rng.normal(0, 0.1, 13),
        ],
        axis=1,
    )
    return walk(positions, targets, frames, rng, 0.02)
