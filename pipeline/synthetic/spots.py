"""Places on level supports, and how far things are taken from them."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.synthetic.footprint import Area
from pipeline.synthetic.props import Prop
from pipeline.synthetic.world import Pose


@dataclass(frozen=True)
class Spot:
    """A place with the thing that stands there before anything happens.

    Attributes:
        pose: T_world_object.
        prop: the thing.
        area: where the thing may be put nearby; None = it can only be turned or taken away.
        group: things are carried to places of the same group only.
        weight: how likely it is to be moved, relative to others.
    """

    pose: Pose
    prop: Prop
    area: Area | None = None
    group: str = ""
    weight: float = 1.0


@dataclass(frozen=True)
class Reach:
    """How far things go: short moves (metres, least and most), and what replaces a thing off its place."""

    shift_m: tuple[float, float] = (0.08, 0.45)
    nudge_m: float = 0.007
    nudge_rad: float = 0.03
    footprint_scale: float = 1.0
