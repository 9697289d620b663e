"""``laz``: the labelled points of all visits as compressed LAS 1.4, in chunks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from oasisview.export.exporter import ReviewedResult, Steps, chunk_count, point_chunks
from oasisview.palette import LIGHT, label_table
from pipeline.progress import Report, silent
from pipeline.store.files import atomic_file

if TYPE_CHECKING:
    import laspy

# 0.1 mm: finer than any sensor, and 200 km reach in 32 bits around the offset.
SCALE_M = 1e-4
POINT_FORMAT = 7  # the plainest of LAS 1.4 that has colours
EXTRA_DIMENSIONS = (
    ("session", "uint8", "visit: 0 previous, 1 current"),
    ("label", "uint8", "0 unknown 1 same 2 new 3 gone 4 move"),
    ("object_id", "int32", "0 = background"),
    ("confidence", "float32", "of the label, 0 to 1"),
)


class LazExporter:
    """LAS 1.4, point format 7: x y z, colours of the final labels, and ``EXTRA_DIMENSIONS``.

    Coordinates are metres of the recordings' world frame; the file names no coordinate system, since the
    recordings have none.
    """

    name = "laz"
    suffix = ".laz"
    summary = "points of all visits as compressed LAS 1.4 with session, label, object_id, confidence"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the file; see ``Exporter.write``."""
        import laspy

        labels, confidences = reviewed.label_of_object(), reviewed.confidence_of_object()
        colours = label_table(LIGHT)
        header = _header(reviewed)
        steps = Steps(report, chunk_count(reviewed))
        with (
            atomic_file(out_path) as file,
            laspy.open(file, mode="w", header=header, do_compress=True, closefd=False) as writer,
        ):
            for session, chosen in point_chunks(reviewed):
                object_id = reviewed.object_ids(session, chosen)
                points = laspy.ScaleAwarePointRecord.zeros(len(object_id), header=header)
                points.x, points.y, points.z = np.asarray(session.points_world[chosen], np.float64).T
                points.session[:] = session.index
                _fill(points, object_id, labels, confidences, colours)
                writer.write_points(points)
                steps.step()


def _header(reviewed: ReviewedResult) -> laspy.LasHeader:
    import laspy

    header = laspy.LasHeader(version="1.4", point_format=POINT_FORMAT)
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name, kind, about[:31]) for name, kind, about in EXTRA_DIMENSIONS]
    )
    header.scales = np.full(3, SCALE_M)
    header.offsets = np.floor(_low_corner(reviewed))
    header.system_identifier = "OTHER"
    header.generating_software = "oasisview"
    header.global_encoding.wkt = True  # what LAS 1.4 asks of its point formats, with or without a system
    return header


def _low_corner(reviewed: ReviewedResult) -> NDArray[np.float64]:
    corners = [session.points_world[chosen].min(axis=0) for session, chosen in point_chunks(reviewed)]
    return np.min(corners, axis=0).astype(np.float64) if corners else np.zeros(3)


def _fill(
    points: laspy.ScaleAwarePointRecord,
    object_id: NDArray[np.int32],
    labels: NDArray[np.uint8],
    confidences: NDArray[np.float32],
    colours: NDArray[np.uint8],
) -> None:
    label = labels[object_id]
    rgb = colours[label].astype(np.uint16) * 257  # 8 to 16 bits, white stays white
    points.red, points.green, points.blue = rgb.T
    points.return_number[:] = 1
    points.number_of_returns[:] = 1
    points.label[:] = label
    points.object_id[:] = object_id
    points.confidence[:] = confidences[object_id]
