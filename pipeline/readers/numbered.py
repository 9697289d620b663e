"""Files named ``frame-000000.color.*``, ``.depth.*`` and ``.pose.txt``, as 7-Scenes and 3RScan have them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.readers.assembly import FrameCollector
from pipeline.readers.filetree import FileTree
from pipeline.readers.poses import checked_pose

PREFIX = "frame-"


@dataclass(frozen=True)
class NumberedFrame:
    """One frame whose files exist and whose pose is rigid."""

    index: int
    stem: str
    colour: str
    depth: str
    pose: str
    T_world_camera: NDArray[np.float64]  # (4, 4), of the camera as stored


def has_frames(tree: FileTree, folder: str, colour_suffix: str) -> bool:
    """Whether a folder holds any colour image of such a name."""
    return any(name.startswith(PREFIX) and name.endswith(colour_suffix) for name in tree.entries(folder)[0])


def numbered_frames(
    collector: FrameCollector, folder: str, colour_suffix: str, depth_suffix: str
) -> Iterator[NumberedFrame]:
    """Usable frames in the order of their numbers; the others are noted in the collector."""
    tree = collector.tree
    prefix = f"{folder}/" if folder else ""
    stems = sorted(
        name.partition(".")[0]
        for name in tree.entries(folder)[0]
        if name.startswith(PREFIX) and name.endswith(colour_suffix)
    )
    for index, stem in enumerate(stems):
        colour, depth, pose = (f"{prefix}{stem}{end}" for end in (colour_suffix, depth_suffix, ".pose.txt"))
        absent = next(((k, f) for k, f in (("depth image", depth), ("pose", pose)) if not tree.has(f)), None)
        if absent:
            collector.leave_out(stem, f"its {absent[0]} is missing", f"{absent[0]} {absent[1]} is missing")
            continue
        try:
            T_world_camera = checked_pose(_parse_matrix(tree.read(pose)))
        except InputError as error:
            collector.leave_out(stem, str(error))
            continue
        yield NumberedFrame(index, stem, colour, depth, pose, T_world_camera)


def _parse_matrix(text: bytes) -> list[list[float]]:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        raise InputError("its pose is not a matrix of numbers") from None
    if len(values) != 16:
        raise InputError(f"its pose has {len(values)} numbers instead of 16")
    return [values[4 * row : 4 * row + 4] for row in range(4)]
