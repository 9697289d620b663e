"""A car park: bays on both sides of an aisle; cars left, came, changed places, or gave way to look-alikes."""

from __future__ import annotations

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.synthetic import goods, prints, street, textures, vehicles
from pipeline.synthetic.changes import Rearrangement
from pipeline.synthetic.footprint import Area
from pipeline.synthetic.lighting import daylight
from pipeline.synthetic.mix import draw_mix
from pipeline.synthetic.paths import walk
from pipeline.synthetic.props import Arrangement, Prop, Workshop
from pipeline.synthetic.shapes import Mesh, box, join, pose
from pipeline.synthetic.spots import Reach, Spot
from pipeline.synthetic.world import SensorSettings, SyntheticScene

_BAY_DEPTH_M = 5.0


def ground(shop: Workshop, bays: int, bay: float, rows: list[float], half_length: float) -> Mesh:
    """Asphalt, bay markings, arrows, kerbs with grass, and houses at a distance."""
    rng = shop.rng
    asphalt = shop.tile(textures.speckled(rng, shop.near((92, 92, 94), 14), 0.28), macro=0.12)
    white = shop.tile(textures.speckled(rng, (214, 214, 208), 0.3, 128))
    stone = shop.tile(textures.masonry(rng, (158, 156, 150), (110, 108, 104), 2, 4), macro=0.05)
    grass = shop.tile(textures.leaves(rng, (84, 116, 56)), macro=0.15)
    edge = max(abs(row) for row in rows) + _BAY_DEPTH_M / 2 + 0.4
    parts = [box((-half_length - 9, -edge - 9, -0.2), (half_length + 9, edge + 9, 0), asphalt, 4.0)]
    for row in rows:
        for line in range(bays + 1):
            x = (line - bays / 2) * bay
            low, high = row - _BAY_DEPTH_M / 2, row + _BAY_DEPTH_M / 2
            parts.append(box((x - 0.06, low, 0), (x + 0.06, high, 0.004), white, 0.7, line * 0.37))
    for x in np.arange(-half_length + 2, half_length - 1, shop.between(6, 8)):
        parts.append(box((x, -0.09, 0), (x + 1.6, 0.09, 0.004), white, 0.7))
        parts.append(box((-0.5, -0.09, 0), (0.5, 0.09, 0.004), white, 0.7).at(x + 1.5, 0.25, yaw=-0.8))
        parts.append(box((-0.5, -0.09, 0), (0.5, 0.09, 0.004), white, 0.7).at(x + 1.5, -0.25, yaw=0.8))
    for side in (-1, 1):
        y = side * edge
        low, high = sorted((y, y + side * 0.18))
        parts.append(box((-half_length - 3, low, 0), (half_length + 3, high, 0.14), stone, 1.0))
        low, high = sorted((y + side * 0.18, y + side * 4.0))
        parts.append(box((-half_length - 3, low, 0), (half_length + 3, high, 0.1), grass, 1.5))
        row_of_houses = street.facade_row(shop, 2 * half_length + 10, shop.between(6, 9))
        parts.append(row_of_houses.at(0, side * (edge + 4.5), 0, 0.0 if side > 0 else np.pi))
        end = street.facade_row(shop, 2 * edge + 8, shop.between(5, 8))
        parts.append(end.at(side * (half_length + 7.5), 0, 0, -side * np.pi / 2))
    return join(parts)


def build(shop: Workshop, seed: int, frames: int, camera: PinholeCamera) -> SyntheticScene:
    """Draw a car park."""
    rng = shop.rng
    bays, bay = shop.count(9, 11), shop.between(2.55, 2.75)
    aisle = shop.between(6.2, 7.2)
    near = aisle / 2 + _BAY_DEPTH_M / 2
    rows = [-near, near, near + _BAY_DEPTH_M + 0.6]
    half_length = bays * bay / 2
    plan = Arrangement()
    spots: list[Spot] = []

    def other_car() -> Prop:
        paint = vehicles.PAINTS[int(rng.integers(len(vehicles.PAINTS)))]
        return vehicles.car(shop, str(rng.choice(list(vehicles.FAMILIES))), shop.near(paint, 8))

    favourites = [
        (str(rng.choice(list(vehicles.FAMILIES))), vehicles.PAINTS[int(rng.integers(len(vehicles.PAINTS)))])
        for _ in range(shop.count(4, 6))
    ]
    taken = shop.between(0.82, 0.95)
    for row in rows:
        for number in range(bays):
            if rng.random() > taken:
                continue
            family, paint = favourites[int(rng.integers(len(favourites)))]
            car = other_car() if rng.random() < 0.4 else vehicles.car(shop, family, shop.near(paint, 8))
            heading = np.pi / 2 if rng.random() < 0.5 else -np.pi / 2
            middle = pose((number + 0.5 - bays / 2) * bay, row, 0)
            T = middle @ pose(rng.normal(0, 0.08), rng.normal(0, 0.12), 0, heading + rng.normal(0, 0.02))
            lot = Area(middle, bay / 2 + 0.1, _BAY_DEPTH_M / 2 + 0.3)
            spots.append(Spot(T, car, lot, "bay", weight=1.5 if row is not rows[2] else 0.7))

    # Small things along the aisle, out of the way of cars.
    for x in np.arange(-half_length + 1, half_length - 1, shop.between(1.6, 2.4)):
        side = rng.choice([-1, 1])
        lane = Area(pose(0, float(side) * (aisle / 2 - 0.55), 0), half_length, 0.6)
        T = lane.T_world_area @ pose(x, shop.between(-0.2, 0.2), 0, shop.between(-np.pi, np.pi))
        spots.append(Spot(T, lane_thing(shop), lane, "lane", weight=0.8))

    def substitute(spot: Spot) -> Prop:
        return other_car() if spot.group == "bay" else lane_thing(shop)

    mix = draw_mix(shop, len(spots), seed % 3 == 2, (0.09, 0.09, 0.18), spare=0.7)
    reach = Reach(shift_m=(0.15, 0.6), nudge_m=0.06, nudge_rad=0.015)
    Rearrangement(shop, spots, substitute, reach=reach).deal(mix, plan)

    edge = rows[2] + _BAY_DEPTH_M / 2 + 0.4
    for x in np.linspace(-half_length + 1, half_length - 1, shop.count(2, 4)):
        plan.keep(street.lamppost(shop, shop.between(4, 6)), pose(x, -near - _BAY_DEPTH_M / 2 - 0.2, 0))
    for x in rng.uniform(-half_length, half_length, shop.count(3, 5)):
        side = rng.choice([-1, 1])
        plan.keep(street.tree(shop, shop.between(3.5, 5.5)), pose(x, side * (edge + 2.2), 0))
    partial = shop.count(0, 1)
    return SyntheticScene(
        name="carpark",
        seed=seed,
        atlas=shop.atlas,
        background=ground(shop, bays, bay, rows, half_length),
        objects=plan.objects(rng),
        lighting=(daylight(shop), daylight(shop)),
        paths=(
            _tour(shop, partial == 0, half_length, aisle, frames),
            _tour(shop, partial == 1, half_length, aisle, frames),
        ),
        camera=camera,
        sensor=OUTDOOR_SENSOR,
        truth_voxel_m=0.05,
    )


# A scanning depth camera: noise grows more slowly with distance than a stereo camera's.
OUTDOOR_SENSOR = SensorSettings(
    min_range_m=0.5,
    max_range_m=35.0,
    depth_noise_m=0.008,
    depth_noise_per_m=0.00012,
    disparity_step_m=0.00015,
)


def lane_thing(shop: Workshop) -> Prop:
    """Something that stands about in a car park."""
    match int(shop.rng.integers(6)):
        case 0 | 1:
            return goods.cone(shop)
        case 2:
            return street.trolley(shop, prints.vivid(shop.rng, 60, 200))
        case 3:
            return street.wheelie_bin(shop, prints.vivid(shop.rng, 40, 130))
        case 4:
            size = (shop.between(0.5, 0.8), shop.between(0.4, 0.6), shop.between(0.3, 0.6))
            return goods.crate(shop, size, shop.near((160, 120, 78), 24))
        case _:
            return goods.pallet(shop)


def _tour(shop: Workshop, partial: bool, half_length: float, aisle: float, frames: int) -> np.ndarray:
    """Up the aisle on one side looking obliquely at the other, and back; a partial one begins late."""
    rng = shop.rng
    height = shop.between(2.5, 3.7)
    ahead, offset = shop.between(2.0, 5.5), aisle / 2 * shop.between(0.2, 0.6)
    begin = -half_length * shop.between(0.3, 0.7) if partial else -half_length - shop.between(1.5, 3.0)
    first = float(rng.choice([-1, 1]))  # the side walked along first
    far = {1.0: 3.2, -1.0: 2.6}
    positions, targets = [], []
    for x in np.linspace(begin, half_length - 0.5, 6):
        positions.append((x, -first * offset, height))
        targets.append((x + ahead, first * (aisle / 2 + far[first]), 0.4))
    positions.append((half_length + 1.0, 0, height))
    targets.append((half_length - 3.0, first * (aisle / 2 + 1), 0.5))
    positions.append((half_length + 1.2, first * offset * 0.7, height))
    targets.append((half_length - 5.0, -first * aisle / 2, 0.5))
    stop = begin + (0.4 * half_length if partial else 0.0)
    for x in np.linspace(half_length, stop, 6):
        positions.append((x, first * offset, height + shop.between(-0.2, 0.2)))
        targets.append((x - ahead, -first * (aisle / 2 + far[-first]), 0.4))
    order = slice(None) if rng.random() < 0.5 else slice(None, None, -1)
    return walk(np.array(positions)[order], np.array(targets)[order], frames, rng, 0.04)
