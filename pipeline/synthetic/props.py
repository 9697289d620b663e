"""What builders of objects share: where they draw from, what they return, what becomes of it later."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.synthetic.atlas import TextureAtlas
from pipeline.synthetic.shapes import Mesh
from pipeline.synthetic.textures import Colour, Tile, mottled
from pipeline.synthetic.world import Pose, SceneObject


@dataclass(frozen=True)
class Prop:
    """A thing to stand somewhere.

    Attributes:
        class_name: for people.
        mesh: standing on z = 0 around the z axis.
        lookalike: makes another of the same family: similar shape and colour, its own texture.
        symmetry_order: of shape and print about the z axis: 1 = none, n = n-fold, 0 = any angle.
        tips: whether it may be found lying on its side.
        plain: whether nothing tells it from its look-alikes.
        sway: for what is soft: its shape at another moment, though nobody touched it.
    """

    class_name: str
    mesh: Mesh
    lookalike: Callable[[], Prop]
    symmetry_order: int = 1
    tips: bool = False
    plain: bool = False
    sway: Callable[[], Mesh] | None = None

    @property
    def height(self) -> float:
        """Metres above what it stands on."""
        return float(self.mesh.bounds[1, 2])

    @property
    def radius(self) -> float:
        """Metres from its axis to its farthest corner, seen from above."""
        return float(np.hypot(*np.abs(self.mesh.bounds[:, :2]).max(0)))


def reprinted(prop: Prop) -> Prop:
    """A thing of the very same shape with other textures; a look-alike where its family varies too much."""
    other = prop.lookalike()
    if len(other.mesh.tile) != len(prop.mesh.tile):
        return other
    mesh = Mesh(prop.mesh.corners, prop.mesh.normals, other.mesh.uv, other.mesh.tile)
    return replace(prop, mesh=mesh, lookalike=other.lookalike)


@dataclass(frozen=True)
class Workshop:
    """Where builders draw numbers and put textures."""

    rng: np.random.Generator
    atlas: TextureAtlas

    def between(self, low: float, high: float) -> float:
        """A number, uniform in [low, high)."""
        return float(self.rng.uniform(low, high))

    def count(self, low: int, high: int) -> int:
        """A whole number, uniform in low..high."""
        return int(self.rng.integers(low, high + 1))

    def tile(self, image: Tile, gloss: float = 0.0, macro: float = 0.0) -> int:
        """Put a texture into the atlas."""
        return self.atlas.add(image, gloss, macro)

    def paint(self, colour: Colour, contrast: float = 0.08, gloss: float = 0.0) -> int:
        """A small mottled tile of one colour, each with its own marks."""
        return self.tile(mottled(self.rng, colour, contrast, size=128), gloss)

    def near(self, colour: Colour, spread: float = 12.0) -> np.ndarray:
        """A colour close to the given one: ``spread`` of 255 in lightness, a quarter of it in hue."""
        lightness, hue = self.rng.normal(0, spread / 100), self.rng.normal(0, spread / 400, 3)
        return np.clip(np.asarray(colour, dtype=np.float64) * (1 + lightness) * (1 + hue), 8, 250)

    def similar(self, sizes: Sequence[float], spread: float = 0.03) -> list[float]:
        """Sizes close to the given ones."""
        return [float(size * np.clip(self.rng.normal(1, spread), 0.9, 1.1)) for size in sizes]


@dataclass(frozen=True)
class Entry:
    """A thing with its poses in both visits, the entry that took its place, and how that came about."""

    prop: Prop
    previous: Pose | None
    current: Pose | None
    successor: int | None = None
    story: str = ""
    mesh_current: Mesh | None = None


@dataclass
class Arrangement:
    """Collects what stands where in each visit; ids are dealt at the end so that they tell nothing."""

    entries: list[Entry] = field(default_factory=list)

    def keep(self, prop: Prop, pose: Pose, mesh_current: Mesh | None = None) -> None:
        """The same thing at the same place in both visits; ``mesh_current`` where it hangs otherwise now."""
        self.entries.append(Entry(prop, pose, pose, mesh_current=mesh_current))

    def vanish(self, prop: Prop, pose: Pose) -> None:
        """There in the previous visit only."""
        self.entries.append(Entry(prop, pose, None))

    def arrive(self, prop: Prop, pose: Pose) -> None:
        """There in the current visit only."""
        self.entries.append(Entry(prop, None, pose))

    def move(self, prop: Prop, before: Pose, after: Pose, story: str = "carried") -> None:
        """Brought from one pose to another."""
        self.entries.append(Entry(prop, before, after, story=story))

    def replace(
        self, prop: Prop, pose: Pose, successor: Prop, successor_pose: Pose, story: str = "look-alike"
    ) -> None:
        """Taken away, and another thing put in its place."""
        self.entries.append(Entry(prop, pose, None, len(self.entries) + 1, story))
        self.entries.append(Entry(successor, None, successor_pose, story=story))

    def objects(self, rng: np.random.Generator) -> tuple[SceneObject, ...]:
        """All objects in the order of their shuffled ids."""
        ids = rng.permutation(len(self.entries)) + 1
        made = [
            SceneObject(
                object_id=int(number),
                class_name=entry.prop.class_name,
                mesh=entry.prop.mesh,
                poses=(entry.previous, entry.current),
                replaced_by=None if entry.successor is None else int(ids[entry.successor]),
                symmetry_order=entry.prop.symmetry_order,
                story=entry.story,
                mesh_current=entry.mesh_current,
            )
            for number, entry in zip(ids, self.entries, strict=True)
        ]
        return tuple(sorted(made, key=lambda thing: thing.object_id))


def scatter(
    rng: np.random.Generator,
    low: tuple[float, float],
    high: tuple[float, float],
    radii: Sequence[float],
    gap: float = 0.02,
    tries: int = 60,
    taken: Sequence[tuple[float, float, float]] = (),
) -> list[tuple[float, float] | None]:
    """Places in a rectangle where discs do not touch each other; None where there was no room.

    Args:
        rng: source of the places.
        low: least x and y, metres.
        high: greatest x and y, metres.
        radii: of the discs, in the order in which they choose.
        gap: least distance between discs, metres.
        tries: places tried for each disc.
        taken: x, y and radius of discs that stand there already.
    """
    discs = list(taken)
    places: list[tuple[float, float] | None] = []
    for radius in radii:
        found = None
        free = [high[i] - low[i] - 2 * radius for i in (0, 1)]
        for _ in range(tries if min(free) > -0.1 else 0):
            x, y = (low[i] + radius + float(rng.random()) * max(free[i], 0.0) for i in (0, 1))
            if all(np.hypot(x - dx, y - dy) > radius + other + gap for dx, dy, other in discs):
                found = (x, y)
                discs.append((x, y, radius))
                break
        places.append(found)
    return places
