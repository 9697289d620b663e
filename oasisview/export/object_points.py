"""The map points of each object, read a part of the map at a time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from oasisview.export.exporter import ReviewedResult, Steps, point_chunks

Key = tuple[int, int]  # visit, object id


def object_parts(
    reviewed: ReviewedResult, steps: Steps | None = None
) -> Iterator[tuple[Key, NDArray[np.float32]]]:
    """Points (N, 3) of one object in one part of the map, world, metres; an object may come several times."""
    for session, chosen in point_chunks(reviewed):
        ids = reviewed.object_ids(session, chosen)
        on_object = np.flatnonzero(ids > 0)
        if len(on_object):
            by_object = on_object[np.argsort(ids[on_object], kind="stable")]
            points = session.points_world[chosen][by_object]
            found, starts = np.unique(ids[by_object], return_index=True)
            for object_id, part in zip(found.tolist(), np.split(points, starts[1:]), strict=True):
                yield (session.index, object_id), part
        if steps is not None:
            steps.step()
