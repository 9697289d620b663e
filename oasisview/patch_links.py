"""Where a patch of a keyframe finds its match on the other visit, who else claims it, and where objects' go.

A result keeps the best match of every patch in both directions. The rivals of a patch are therefore the
patches of the other keyframe that call it their own best match. Pure arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.result import PatchLinks

MAX_RIVALS = 5
MAX_OF_OBJECT = 24
Role = Literal["match", "rival", "object"]
Place = tuple[float, float]


@dataclass(frozen=True)
class PatchPick:
    """A patch that a person chose.

    Attributes:
        session: the visit of the picture that was clicked.
        pair: keyframes of the earlier and the later visit that were shown.
        u, v: where, in [0, 1] of the picture.
    """

    session: int
    pair: tuple[int, int]
    u: float
    v: float


@dataclass(frozen=True)
class DrawnLink:
    """A match to be drawn: patch centres in the earlier and the later picture, (u, v) in [0, 1]."""

    before: Place
    after: Place
    score: float
    role: Role


@dataclass(frozen=True)
class PatchStory:
    """What is known of one patch.

    Attributes:
        match: from the patch to its best match.
        mutual: the best match has this patch as its own best one.
        prefers: score that the best match has with the patch that it prefers; None if mutual.
        rivals: other patches that have this one as their best match, best first.
        size: (width, height) of a patch of the clicked picture, shares of the picture.
    """

    match: DrawnLink
    mutual: bool
    prefers: float | None
    rivals: tuple[DrawnLink, ...]
    size: tuple[float, float]


def story_of(links: PatchLinks, session: int, u: float, v: float) -> PatchStory:
    """The patch under a place of the picture of a visit (0 = the earlier one)."""
    to, to_score, back, back_score, shape, other_shape = _seen_from(links, session)
    row, column = min(int(v * shape[0]), shape[0] - 1), min(int(u * shape[1]), shape[1] - 1)
    patch = row * shape[1] + column
    target = int(to[patch])
    claims = np.flatnonzero(back == patch)
    claims = claims[claims != target]
    claims = claims[np.argsort(-back_score[claims].astype(np.float32), kind="stable")][:MAX_RIVALS]
    mutual = int(back[target]) == patch

    def drawn(other: int, score: float, role: Role) -> DrawnLink:
        here, there = _centre(patch, shape), _centre(other, other_shape)
        return DrawnLink(*((here, there) if session == 0 else (there, here)), score, role)

    return PatchStory(
        match=drawn(target, float(to_score[patch]), "match"),
        mutual=mutual,
        prefers=None if mutual else float(back_score[target]),
        rivals=tuple(drawn(int(q), float(back_score[q]), "rival") for q in claims),
        size=(1 / shape[1], 1 / shape[0]),
    )


def links_of_object(
    links: PatchLinks,
    mask_before: NDArray[np.bool_],
    mask_after: NDArray[np.bool_],
    limit: int = MAX_OF_OBJECT,
) -> tuple[DrawnLink, ...]:
    """The strongest matches of an object's patches between two keyframes.

    Args:
        mask_before, mask_after: where the object is in either picture, any resolution; its matches start in
            the picture that shows more of it.
    """
    patches = (
        _patches_on(mask_before, links.previous_shape),
        _patches_on(mask_after, links.current_shape),
    )
    session = 0 if len(patches[0]) >= len(patches[1]) else 1
    to, score, _, _, shape, other_shape = _seen_from(links, session)
    own = patches[session]
    own = own[np.argsort(-score[own].astype(np.float32), kind="stable")][:limit]
    found = []
    for patch in own.tolist():
        here, there = _centre(patch, shape), _centre(int(to[patch]), other_shape)
        ends = (here, there) if session == 0 else (there, here)
        found.append(DrawnLink(*ends, float(score[patch]), "object"))
    return tuple(found)


def _patches_on(mask: NDArray[np.bool_], shape: tuple[int, int]) -> NDArray[np.intp]:
    """Patches whose middle is on a mask."""
    rows = ((np.arange(shape[0]) + 0.5) / shape[0] * mask.shape[0]).astype(np.int64)
    columns = ((np.arange(shape[1]) + 0.5) / shape[1] * mask.shape[1]).astype(np.int64)
    return np.flatnonzero(mask[np.ix_(rows, columns)].reshape(-1))


def _seen_from(
    links: PatchLinks, session: int
) -> tuple[
    NDArray[np.uint16],
    NDArray[np.float16],
    NDArray[np.uint16],
    NDArray[np.float16],
    tuple[int, int],
    tuple[int, int],
]:
    forward = (links.forward, links.forward_score)
    backward = (links.backward, links.backward_score)
    if session == 0:
        return *forward, *backward, links.previous_shape, links.current_shape
    return *backward, *forward, links.current_shape, links.previous_shape


def _centre(patch: int, shape: tuple[int, int]) -> Place:
    row, column = divmod(patch, shape[1])
    return (column + 0.5) / shape[1], (row + 0.5) / shape[0]
