"""``geojson``: the ground below every object as a polygon, with its row of the table as properties."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from oasisview.export.exporter import ReviewedResult, Steps, chunk_count
from oasisview.export.footprints import Footprint, footprints
from oasisview.export.georeference import Georeference
from oasisview.export.object_rows import object_rows
from oasisview.scene.ground_plan import GroundPlan
from pipeline.progress import Report, silent
from pipeline.store.files import atomic_file

_LOCAL_DECIMALS = 4  # 0.1 mm
_DEGREE_DECIMALS = 9  # 0.1 mm on the ground


class GeoJsonExporter:
    """A FeatureCollection with one feature per object, where the latest visit that saw it saw it.

    Where the archive states an origin, coordinates are longitude and latitude (WGS 84, RFC 7946). Else they
    are metres on level axes, which ``coordinate_frame`` names, and ``"crs": null`` says (as GeoJSON 2008
    has it) that no place on Earth is meant.
    """

    name = "geojson"
    suffix = ".geojson"
    summary = "footprint polygon of every object with label, displacement and confidence, for maps"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the file; see ``Exporter.write``."""
        plan = GroundPlan.of(reviewed.result)
        ground = footprints(reviewed, plan, Steps(report, chunk_count(reviewed)))
        origin = Georeference.of(reviewed.result) if plan.is_world else None
        frame = _local_frame(plan) if origin is None else origin.description()
        head: dict[str, Any] = {"type": "FeatureCollection", "name": reviewed.result.path.stem}
        if origin is None:
            head["crs"] = None
        head["coordinate_frame"] = frame
        sessions = {item.object_id: [s.session for s in item.sightings] for item in reviewed.objects}
        with atomic_file(out_path) as file:
            file.write(_encoded(head)[:-1] + b', "features": [')
            for number, row in enumerate(object_rows(reviewed)):
                seen = sessions[row["id"]]
                footprint = ground.get((row["id"], seen[-1])) if seen else None
                file.write(b"\n" if number == 0 else b",\n")
                file.write(_encoded(_feature(row, footprint, origin)))
            file.write(b"\n]}\n")


def _local_frame(plan: GroundPlan) -> dict[str, Any]:
    frame: dict[str, Any] = {
        "type": "local metric",
        "unit": "m",
        "axes": list(plan.names[:2]),
        "height_axis": plan.names[2],
    }
    if not plan.is_world:
        frame["axes_in_world"] = np.round(plan.axes_world, 9).tolist()
    return frame


def _feature(row: dict[str, Any], footprint: Footprint | None, origin: Georeference | None) -> dict[str, Any]:
    properties = {"id": row["id"], "label": row["label_final"], **row}
    # Flat values only: what tables of maps can show.
    for name in ("sessions_seen", "machine_ids"):
        properties[name] = ";".join(map(str, row[name]))
    properties["notes"] = " | ".join(f"{note['who']}: {note['text']}" for note in row["notes"])
    properties["base_m"] = None if footprint is None else round(footprint.base_m, _LOCAL_DECIMALS)
    properties["top_m"] = None if footprint is None else round(footprint.top_m, _LOCAL_DECIMALS)
    geometry = None
    if footprint is not None:
        geometry = {"type": "Polygon", "coordinates": [_ring(footprint.polygon_m, origin)]}
    return {"type": "Feature", "id": row["id"], "geometry": geometry, "properties": properties}


def _ring(polygon_m: NDArray[np.float64], origin: Georeference | None) -> list[list[float]]:
    """Closed and counter-clockwise, as RFC 7946 wants outlines."""
    closed = np.concatenate([polygon_m, polygon_m[:1]])
    if origin is not None:
        return np.round(origin.to_longitude_latitude(closed), _DEGREE_DECIMALS).tolist()
    return np.round(closed, _LOCAL_DECIMALS).tolist()


def _encoded(value: Any) -> bytes:
    return json.dumps(value, ensure_ascii=False, allow_nan=False).encode()
