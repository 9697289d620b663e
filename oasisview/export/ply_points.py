"""``ply``: the labelled points of all visits in one file, in chunks so that a map of any size fits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from oasisview.export.exporter import ReviewedResult, Steps, chunk_count, point_chunks
from oasisview.palette import LIGHT, label_table
from pipeline.ply import VERTEX_DTYPE, ply_header
from pipeline.progress import Report, silent
from pipeline.store.files import atomic_file


class PlyExporter:
    """Binary little-endian PLY in the schema of ``pipeline.ply``, coloured by final label."""

    name = "ply"
    suffix = ".ply"
    summary = "points of all visits with label, object and confidence"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the file; see ``Exporter.write``."""
        labels, confidences = reviewed.label_of_object(), reviewed.confidence_of_object()
        colours = label_table(LIGHT)
        total = sum(len(session.points_world) for session in reviewed.result.sessions)
        steps = Steps(report, chunk_count(reviewed))
        with atomic_file(out_path) as file:
            file.write(ply_header(total))
            for session, chosen in point_chunks(reviewed):
                points, object_id = session.points_world[chosen], reviewed.object_ids(session, chosen)
                vertices = _vertices(points, object_id, labels, confidences, colours)
                vertices["session"] = session.index
                file.write(vertices.tobytes())
                steps.step()


def _vertices(
    points: NDArray[np.float32],
    object_id: NDArray[np.int32],
    labels: NDArray[np.uint8],
    confidences: NDArray[np.float32],
    colours: NDArray[np.uint8],
) -> NDArray[np.void]:
    label = labels[object_id]
    vertices = np.empty(len(points), dtype=VERTEX_DTYPE)
    for axis, name in enumerate(("x", "y", "z")):
        vertices[name] = points[:, axis]
    for channel, name in enumerate(("red", "green", "blue")):
        vertices[name] = colours[label, channel]
    vertices["label"] = label
    vertices["object_id"] = object_id
    vertices["confidence"] = confidences[object_id]
    return vertices
