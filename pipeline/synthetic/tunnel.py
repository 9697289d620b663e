"""A service tunnel: a curved vault over a bowl-shaped floor, with pipes, hanging cables, signs and gauges.

For held-out checks only: nothing is tuned on it. There is no level support, no straight wall, and much of
what changes is print alone.
"""

from __future__ import annotations

import numpy as np

from pipeline.camera import PinholeCamera
from pipeline.synthetic import furniture, piping, prints, textures
from pipeline.synthetic.bore import SPRING_M, Bore, Bowl, Crown, Pipe, Wall, upright_axes
from pipeline.synthetic.lighting import white
from pipeline.synthetic.mix import draw_mix
from pipeline.synthetic.paths import walk
from pipeline.synthetic.perches import Perch, PerchChanges, Support, settle
from pipeline.synthetic.props import Arrangement, Prop, Workshop
from pipeline.synthetic.shapes import Mesh, box, join
from pipeline.synthetic.sheets import sheet, tube
from pipeline.synthetic.world import Lamp, Lighting, SensorSettings, SyntheticScene


def shell(shop: Workshop, bore: Bore, pipes: list[Pipe]) -> Mesh:
    """Vault, floor, ends, pipes with flanges, conduits, and a walkway of bars."""
    rng = shop.rng
    lining = shop.tile(
        textures.masonry(
            rng, shop.near((150, 140, 128), 16), (96, 92, 86), shop.count(8, 12), shop.count(4, 6), 512
        ),
        macro=0.16,
    )
    concrete = shop.tile(textures.speckled(rng, shop.near((118, 116, 112), 12), 0.3), gloss=0.05, macro=0.16)
    steel = shop.paint((112, 114, 118), 0.2, 0.08)
    vault = bore.section(np.linspace(0, np.pi, 25))
    left = np.linspace(bore.half_width_m, -bore.half_width_m, 21)
    bowl = np.stack([left, bore.floor(left)], axis=1)
    steps, end = 36, bore.length_m
    parts = [
        sheet(bore.sweep(vault, steps, -0.6, end + 0.6), lining, 1.8),
        sheet(bore.sweep(bowl, steps, -0.6, end + 0.6), concrete, 2.2),
    ]
    for s in (-0.55, end + 0.55):  # bulkheads
        door = shop.tile(prints.picture(rng, 256))
        rim = np.concatenate([vault, bowl[::-1][1:-1], vault[:1]])
        middle = np.array([0.0, 0.9])
        disc = np.stack([middle + (rim - middle) * share for share in (0.02, 0.5, 1.0)])
        grid = np.array([[bore.at(s, *point) for point in row] for row in disc])
        parts.append(sheet(grid, concrete, 1.5))
        plate = np.array(
            [[bore.at(s * 0.98 if s > 0 else s + 0.1, x, z) for x in (0.6, -0.6)] for z in (1.9, 0.1)]
        )
        parts.append(sheet(plate, door, None))
    for pipe in pipes:
        coat = shop.tile(textures.mottled(rng, prints.vivid(rng, 70, 190), 0.16, 1.3), gloss=0.08, macro=0.1)
        parts.append(tube(pipe.path(40), pipe.radius_m, coat, 0.8, 14, caps=False))
        for s in np.arange(shop.between(0.6, 1.5), end, shop.between(2.2, 3.2)):
            collar = np.stack([bore.at(s + d, pipe.left, pipe.up) for d in (-0.04, 0.0, 0.04)])
            parts.append(tube(collar, pipe.radius_m * 1.35, steel, 0.3, 14))
            foot = np.stack([bore.at(s, pipe.left * (1 + 0.12 * k), pipe.up - 0.12 * k) for k in range(3)])
            parts.append(tube(foot, 0.03, steel, 0.3, 6))
    for angle in (0.95, 1.02, 2.2):  # conduits along the vault
        at = bore.section(np.array([angle])) * 0.985
        line = bore.sweep(at, 40, 0.0, end)[:, 0]
        parts.append(tube(line, 0.022, shop.paint(shop.near((70, 72, 76), 30)), 0.3, 6, caps=False))
    for side in (0.42, -0.42):  # walkway
        stringer = bore.sweep(np.array([[side, -0.12]]), 30, 0.0, end)[:, 0]
        parts.append(tube(stringer, 0.03, steel, 0.3, 6))
    for s in np.arange(0.05, end, 0.09):
        centre, ahead, _ = bore.frame(float(s))
        bar = box((-0.018, -0.42, -0.13), (0.018, 0.42, -0.1), steel, 0.4)
        T = upright_axes(ahead, np.array([0, 0, 1.0]), centre, 0.0)
        parts.append(bar.placed(T))
    return join(parts)


def build(shop: Workshop, seed: int, frames: int, camera: PinholeCamera) -> SyntheticScene:
    """Draw a service tunnel."""
    rng = shop.rng
    bore = Bore(
        radius_m=float(rng.choice([-1, 1])) * shop.between(11, 20),
        length_m=shop.between(13, 16),
        half_width_m=shop.between(1.9, 2.3),
        rise_m=shop.between(1.9, 2.2),
        climb=shop.between(-0.03, 0.03),
    )
    pipes: list[Pipe] = []
    for side in (1, -1):
        for up in (shop.between(0.5, 0.65), shop.between(1.0, 1.15)):
            if rng.random() < 0.8:
                radius = shop.between(0.06, 0.13)
                wide = bore.half_width_m * np.sqrt(1 - (max(up - SPRING_M, 0) / bore.rise_m) ** 2)
                left = side * float(wide - radius - shop.between(0.06, 0.14))
                pipes.append(Pipe(bore, left, up, radius, f"pipe {len(pipes)}"))
    walls = [Wall(bore, side, (0.42, 0.85)) for side in (1, -1)]
    bowls = [Bowl(bore, side) for side in (1, -1)]
    crown = Crown(bore)

    def on_wall() -> Prop:
        match int(rng.integers(5)):
            case 0:
                return piping.junction(shop, (shop.between(0.3, 0.45), shop.between(0.35, 0.5)))
            case 1:
                return piping.gauge(shop, shop.between(0.12, 0.18))
            case _:
                return piping.sign(shop, (shop.between(0.4, 0.6), shop.between(0.35, 0.5)))

    def on_floor() -> Prop:
        match int(rng.integers(7)):
            case 0:
                return piping.bucket(shop, prints.vivid(rng, 60, 210))
            case 1:
                return piping.extinguisher(shop)
            case 2:
                return piping.spool(shop, prints.vivid(rng, 60, 200))
            case 3:
                return piping.bottle(shop, prints.vivid(rng, 60, 180))
            case 4:
                return piping.hose_coil(shop, prints.vivid(rng, 80, 220))
            case 5:
                return furniture.bag(shop, prints.vivid(rng, 50, 180))
            case _:
                size = (shop.between(0.3, 0.5), shop.between(0.22, 0.34), shop.between(0.2, 0.34))
                return furniture.carton(shop, size, prints.vivid(rng, 90, 220), prints.vivid(rng, 20, 90))

    def hung() -> Prop:
        if rng.random() < 0.45:
            return piping.pendant(shop, prints.vivid(rng, 80, 220))
        return piping.slack_cable(shop, prints.vivid(rng, 70, 220))

    def around(pipe: Pipe) -> Prop:
        if rng.random() < 0.55:
            return piping.valve(shop, pipe.radius_m, prints.vivid(rng, 110, 230))
        return piping.sleeve(shop, pipe.radius_m)

    plan = Arrangement()
    perches: list[Perch] = []

    def add(prop: Prop, supports: list[Support], weight: float = 1.0) -> None:
        perch = settle(shop, prop, supports, [one.ball for one in perches], weight)
        if perch is not None:
            perches.append(perch)

    for _ in range(shop.count(12, 16)):
        add(on_wall(), [*walls])
    for pipe in pipes:
        for _ in range(shop.count(3, 4)):
            add(around(pipe), [pipe], 0.7)
    for _ in range(shop.count(8, 11)):
        add(hung(), [crown])
    for _ in range(shop.count(16, 22)):
        add(on_floor(), [*bowls], 1.4)

    def substitute(perch: Perch) -> Prop:
        if isinstance(perch.support, Pipe):
            return around(perch.support)
        if perch.support.group == "wall":
            return on_wall()
        return hung() if perch.support.group == "crown" else on_floor()

    mix = draw_mix(shop, len(perches), seed % 3 == 1, (0.11, 0.11, 0.18), jolted=shop.count(0, 3))
    PerchChanges(shop, perches, substitute).deal(mix, plan)
    partial = shop.count(0, 1)
    return SyntheticScene(
        name="tunnel",
        seed=seed,
        atlas=shop.atlas,
        background=shell(shop, bore, pipes),
        objects=plan.objects(rng),
        lighting=(_lamps(shop, bore), _lamps(shop, bore)),
        paths=(_inspection(shop, bore, partial == 0, frames), _inspection(shop, bore, partial == 1, frames)),
        camera=camera,
        sensor=SensorSettings(max_range_m=8.5),
        truth_voxel_m=0.025,
    )


def _lamps(shop: Workshop, bore: Bore) -> Lighting:
    """A few lamps along the crown, some of them dead, and light thrown back by the lining."""
    warm = shop.between(-0.5, 0.9)
    places = np.linspace(0.12, 0.88, 4)[shop.rng.permutation(4)[: shop.count(3, 4)]]
    lamps = tuple(
        Lamp(
            bore.at(float(s * bore.length_m), shop.between(-0.4, 0.4), SPRING_M + bore.rise_m * 0.93),
            white(shop, warm) * shop.between(0.7, 1.1),
            reach=shop.between(2.2, 3.2),
        )
        for s in places
    )
    ambient = white(shop, warm * 0.6) * shop.between(0.25, 0.4)
    return Lighting(lamps, ambient, ambient * 0.6, ambient, exposure=shop.between(0.9, 1.3))


def _inspection(shop: Workshop, bore: Bore, partial: bool, frames: int) -> np.ndarray:
    """Along the walkway and back, looking at one wall and then at the other; a partial one turns early."""
    rng = shop.rng
    height, ahead = shop.between(1.2, 1.6), shop.between(1.6, 3.0)
    first = float(rng.choice([-1, 1]))
    span = np.array([0.9, bore.length_m - 0.9])
    if partial:
        left_out = shop.between(0.2, 0.35) * bore.length_m
        span += np.array([left_out, 0.0] if rng.random() < 0.5 else [0.0, -left_out])
    positions, targets = [], []
    for side, heading in ((first, 1.0), (-first, -1.0)):
        way = np.linspace(span[0], span[1], 7)[:: int(heading)]
        for s in way:
            positions.append(bore.at(float(s), -side * 0.3, height))
            # At the ends the camera turns to the wall instead of facing the bulkhead.
            at = float(np.clip(s + heading * ahead, 1.4, bore.length_m - 1.4))
            targets.append(bore.at(at, side * bore.half_width_m * 0.85, shop.between(0.5, 1.6)))
    order = slice(None) if rng.random() < 0.5 else slice(None, None, -1)
    return walk(np.array(positions)[order], np.array(targets)[order], frames, rng, 0.025)
