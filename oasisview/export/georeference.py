"""From metres of the world frame to longitude and latitude, for recordings that say where they stand."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.result import Result
from pipeline.session import GeographicOrigin

_RADIUS_M, _FLATTENING = 6378137.0, 1 / 298.257223563  # WGS 84
_E2 = _FLATTENING * (2 - _FLATTENING)


@dataclass(frozen=True)
class Georeference:
    """The world frame as a level frame at a place on Earth (exact, not a map projection)."""

    origin: GeographicOrigin

    @classmethod
    def of(cls, result: Result) -> Georeference | None:
        """What the archive of the earliest visit that states an origin says; None where none does."""
        for source in result.manifest.get("inputs", ()):
            if isinstance(source.get("origin"), dict):
                return cls(GeographicOrigin(**source["origin"]))
        return None

    def description(self) -> dict[str, Any]:
        """What the file says about its coordinates."""
        return {"type": "WGS 84", "unit": "degree", "origin": dataclasses.asdict(self.origin)}

    def to_longitude_latitude(self, xy_m: NDArray[np.floating]) -> NDArray[np.float64]:
        """(N, 2) world x and y in metres to (N, 2) longitude and latitude in degrees."""
        latitude, longitude, azimuth = np.radians(
            [self.origin.latitude_deg, self.origin.longitude_deg, self.origin.y_axis_azimuth_deg]
        )
        x, y = np.asarray(xy_m, np.float64).T
        east = x * np.cos(azimuth) + y * np.sin(azimuth)
        north = y * np.cos(azimuth) - x * np.sin(azimuth)
        # East-north-up at the origin to Earth-centred coordinates, and back to latitude (Bowring).
        sin_lat, cos_lat, sin_lon, cos_lon = (
            np.sin(latitude),
            np.cos(latitude),
            np.sin(longitude),
            np.cos(longitude),
        )
        normal = _RADIUS_M / np.sqrt(1 - _E2 * sin_lat**2)
        outward = (normal + self.origin.altitude_m) * cos_lat - north * sin_lat
        ex = outward * cos_lon - east * sin_lon
        ey = outward * sin_lon + east * cos_lon
        ez = (normal * (1 - _E2) + self.origin.altitude_m) * sin_lat + north * cos_lat
        polar_m = _RADIUS_M * (1 - _FLATTENING)
        from_axis = np.hypot(ex, ey)
        parametric = np.arctan2(ez * _RADIUS_M, from_axis * polar_m)
        found_latitude = np.arctan2(
            ez + _E2 / (1 - _E2) * polar_m * np.sin(parametric) ** 3,
            from_axis - _E2 * _RADIUS_M * np.cos(parametric) ** 3,
        )
        return np.degrees(np.stack([np.arctan2(ey, ex), found_latitude], axis=1))
