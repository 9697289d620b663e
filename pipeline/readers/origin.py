"""Where on Earth a recording says that its world frame stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.errors import InputError
from pipeline.readers.assembly import FrameCollector
from pipeline.readers.intrinsics import number
from pipeline.session import GeographicOrigin


def read_origin(session_block: Mapping[str, Any], collector: FrameCollector) -> GeographicOrigin | None:
    """``origin`` of an archive's ``session`` block; a value that cannot be is dropped with a warning."""
    stated = session_block.get("origin")
    if stated is None:
        return None
    if not isinstance(stated, dict):
        collector.warn("'origin' of 'session' is ignored: it is not an object")
        return None
    try:
        origin = GeographicOrigin(
            latitude_deg=number(stated, "latitude_deg", "origin"),
            longitude_deg=number(stated, "longitude_deg", "origin"),
            altitude_m=number(stated, "altitude_m", "origin", 0.0),
            y_axis_azimuth_deg=number(stated, "y_axis_azimuth_deg", "origin", 0.0),
        )
    except InputError as error:
        collector.warn(f"'origin' of 'session' is ignored: {error.what}")
        return None
    if not (abs(origin.latitude_deg) <= 90 and abs(origin.longitude_deg) <= 180):
        collector.warn(
            f"'origin' of 'session' is ignored: latitude {origin.latitude_deg:g} and longitude "
            f"{origin.longitude_deg:g} are not on Earth"
        )
        return None
    return origin
