"""The GeoJSON file: outlines checked by matplotlib, places on Earth by lengths from tables."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline

from oasisview.export import export, exporter
from oasisview.export.georeference import Georeference
from oasisview.scene.ground_plan import GroundPlan
from pipeline.session import GeographicOrigin
from pipeline.store import open_result


def features_of(path: Path) -> tuple[dict, dict[int, dict]]:
    document = json.loads(path.read_text("utf-8"))
    assert document["type"] == "FeatureCollection"
    return document, {feature["id"]: feature for feature in document["features"]}


def signed_area(ring: list[list[float]]) -> float:
    (x, y) = np.array(ring).T
    return float(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1]) / 2)


def test_one_outline_per_object_around_all_its_points(
    reviewed_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exporter, "CHUNK_POINTS", 3000)  # objects are spread over chunks
    export(reviewed_path, "geojson", tmp_path / "map.geojson")
    document, features = features_of(tmp_path / "map.geojson")
    result = open_result(reviewed_path)
    assert set(features) == {item.object_id for item in result.objects}
    for item in result.objects:
        session = result.sessions[item.sightings[-1].session]
        points = session.points_world[session.object_ids == item.object_id]
        (ring,) = features[item.object_id]["geometry"]["coordinates"]
        assert ring[0] == ring[-1]
        assert signed_area(ring) > 0  # counter-clockwise
        assert Outline(ring).contains_points(points[:, :2], radius=2e-4).all()
        properties = features[item.object_id]["properties"]
        assert properties["base_m"] == pytest.approx(points[:, 2].min(), abs=1e-3)
        assert properties["top_m"] == pytest.approx(points[:, 2].max(), abs=1e-3)
    assert document["crs"] is None
    assert document["coordinate_frame"] == {
        "type": "local metric",
        "unit": "m",
        "axes": ["world x", "world y"],
        "height_axis": "world z",
    }


def test_properties_are_flat_and_final(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "geojson", tmp_path / "map.geojson")
    _, features = features_of(tmp_path / "map.geojson")
    six = features[6]["properties"]
    assert (six["id"], six["label"], six["label_machine"]) == (6, "moved", "appeared")
    assert six["decided_by"] == "=Ann"
    assert six["sessions_seen"] == "1"
    five = features[5]["properties"]
    assert five["label"] == "moved" and five["displacement_m"] > 0.1 and 0 < five["confidence"] < 1
    for feature in features.values():
        assert all(
            value is None or isinstance(value, str | int | float) for value in feature["properties"].values()
        )


def with_origin(result_path: Path, **origin: float) -> None:
    manifest = json.loads((result_path / "result.json").read_text())
    manifest["inputs"][0]["origin"] = origin
    (result_path / "result.json").write_text(json.dumps(manifest))


def test_where_the_archive_says_where_it_stands(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "geojson", tmp_path / "local.geojson")
    with_origin(reviewed_path, latitude_deg=45.0, longitude_deg=7.0, altitude_m=0.0, y_axis_azimuth_deg=0.0)
    export(reviewed_path, "geojson", tmp_path / "earth.geojson")
    _, local = features_of(tmp_path / "local.geojson")
    document, earth = features_of(tmp_path / "earth.geojson")
    assert "crs" not in document  # RFC 7946: longitude and latitude on WGS 84
    assert document["coordinate_frame"]["type"] == "WGS 84"
    for object_id, feature in earth.items():
        degrees = np.array(feature["geometry"]["coordinates"][0]) - [7.0, 45.0]
        metres = np.array(local[object_id]["geometry"]["coordinates"][0])
        # Length of a degree at latitude 45 on WGS 84: 78846.8 m of longitude, 111131.8 m of latitude.
        np.testing.assert_allclose(degrees * [78846.8, 111131.8], metres, atol=2e-3)


def test_origins_on_the_equator_and_turned() -> None:
    at = Georeference(GeographicOrigin(0.0, 0.0))
    # Length of a degree at the equator: 111319.49 m of longitude, 110574.3 m of latitude.
    np.testing.assert_allclose(
        at.to_longitude_latitude(np.array([[111.31949, 110.5743]])), [[1e-3, 1e-3]], atol=1e-8
    )
    turned = Georeference(GeographicOrigin(0.0, 0.0, y_axis_azimuth_deg=90.0))  # y points east, x south
    found = turned.to_longitude_latitude(np.array([[0.0, 111.31949], [110.5743, 0.0]]))
    np.testing.assert_allclose(found, [[1e-3, 0], [0, -1e-3]], atol=1e-8)


@given(st.floats(-89, 89), st.floats(-179, 179), st.floats(0, 4000), st.floats(-180, 180), st.floats(1, 2000))
def test_distances_on_earth_are_those_of_the_place(
    latitude: float, longitude: float, altitude: float, azimuth: float, distance: float
) -> None:
    at = Georeference(GeographicOrigin(latitude, longitude, 0.0 * altitude, azimuth))
    points = distance * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    lon, lat = np.radians(at.to_longitude_latitude(points)).T
    # Radii of curvature of the ellipsoid, from its axes 6378137 m and 6356752.314 m.
    a2, b2 = 6378137.0**2, 6356752.314245**2
    bend = a2 * np.cos(lat[0]) ** 2 + b2 * np.sin(lat[0]) ** 2
    north = (lat - lat[0]) * a2 * b2 / bend**1.5
    east = (lon - lon[0]) * np.cos((lat + lat[0]) / 2) * a2 / bend**0.5
    np.testing.assert_allclose(np.hypot(east, north)[1:], distance, rtol=4e-3)
    turned = np.degrees(np.arctan2(east[2], north[2]))
    assert abs((turned - azimuth + 180) % 360 - 180) < 1.2


@pytest.mark.parametrize("up", [(0, 0, 1), (0.1, 0, 0.99), (0, -1, 0), (1, 0, 0), (0, 0, -1)])
def test_plans_of_any_world_are_level_and_right_handed(small_result, up) -> None:
    up = np.array(up, float) / np.linalg.norm(up)
    for session in small_result.sessions:
        session.up_world = up
    plan = GroundPlan.of(small_result)
    np.testing.assert_allclose(plan.axes_world @ plan.axes_world.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(plan.axes_world) == pytest.approx(1)
    assert plan.axes_world[2] @ up > 0.96
    assert plan.is_world == (up[2] > 0.96)
