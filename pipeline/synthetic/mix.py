"""How many things of a scene meet each fate between the visits."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.synthetic.props import Workshop


@dataclass(frozen=True)
class Mix:
    """How many things meet each fate; the rest stays.

    ``spare`` places stay empty for what is moved; ``twins`` are things alike in shape and print, one of
    each pair moved, and ``reprints`` things alike in shape only.
    """

    moved: int
    spare: int
    appeared: int
    disappeared: int
    replaced: int
    jolted: int = 0
    twins: int = 0
    reprints: int = 0


def draw_mix(
    shop: Workshop,
    count: int,
    many: bool,
    shares: tuple[float, float, float],
    spare: float = 0.6,
    jolted: int = 0,
) -> Mix:
    """Fates of ``count`` things.

    Args:
        shop: source of the numbers.
        count: things in all.
        many: whether this is a scene of many moves (13 to 17 rather than 3 to 9).
        shares: appeared, disappeared, replaced, of all things.
        spare: places left empty, per moved thing.
        jolted: things moved by less than counts as a move.
    """
    moved = min(shop.count(13, 17) if many else shop.count(3, 9), count // 2)
    appeared, disappeared, replaced = (max(1, round(share * count)) for share in shares)
    return Mix(
        moved=moved,
        spare=round(spare * moved),
        appeared=appeared,
        disappeared=disappeared,
        replaced=replaced,
        jolted=jolted,
        twins=shop.count(1, 2) if moved > 2 else 0,
        reprints=shop.count(2, 4),
    )
