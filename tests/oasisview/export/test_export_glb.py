"""The GLB file: its container parsed by hand, its meshes opened by trimesh."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from oasisview.export import export, glb_scene
from oasisview.export.surfels import squares, surface_directions, thinned
from pipeline.store import open_result


@pytest.fixture
def glb_path(reviewed_path: Path, tmp_path: Path) -> Path:
    export(reviewed_path, "glb", tmp_path / "map.glb")
    return tmp_path / "map.glb"


def chunks_of(path: Path) -> tuple[dict, bytes]:
    content = path.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content, 0)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    json_length, json_kind = struct.unpack_from("<I4s", content, 12)
    assert json_kind == b"JSON"
    assert json_length % 4 == 0
    at = 20 + json_length
    bin_length, bin_kind = struct.unpack_from("<I4s", content, at)
    assert bin_kind == b"BIN\x00"
    assert at + 8 + bin_length == len(content)
    return json.loads(content[20:at]), content[at + 8 :]


def test_container_and_structure(glb_path: Path) -> None:
    document, binary = chunks_of(glb_path)
    assert document["asset"]["version"] == "2.0"
    assert len(document["buffers"]) == 1
    assert document["buffers"][0]["byteLength"] <= len(binary)
    assert "uri" not in document["buffers"][0]
    for view in document["bufferViews"]:
        assert view.get("byteOffset", 0) + view["byteLength"] <= len(binary)
    sizes = {5126: 4, 5125: 4, 5123: 2, 5121: 1}
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "VEC2": 2}
    for accessor in document["accessors"]:
        view = document["bufferViews"][accessor["bufferView"]]
        needed = accessor["count"] * sizes[accessor["componentType"]] * width[accessor["type"]]
        assert needed <= view["byteLength"]
    for mesh in document["meshes"]:
        (primitive,) = mesh["primitives"]
        positions = document["accessors"][primitive["attributes"]["POSITION"]]
        assert "min" in positions and "max" in positions  # which glTF demands of positions
        if primitive.get("mode", 4) == 4:
            view = document["bufferViews"][document["accessors"][primitive["indices"]]["bufferView"]]
            start = view.get("byteOffset", 0)
            indices = np.frombuffer(binary[start : start + view["byteLength"]], "<u4")
            assert indices.max() < positions["count"]


def test_extras_say_what_each_mesh_is(glb_path: Path, reviewed_path: Path) -> None:
    document, _ = chunks_of(glb_path)
    meshes = {mesh["name"]: mesh for mesh in document["meshes"]}
    expected = {
        f"object_{item.object_id}_session_{sighting.session}"
        for item in open_result(reviewed_path).objects
        for sighting in item.sightings
    }
    assert expected == {name for name in meshes if name.startswith("object_")}
    extras = meshes["object_6_session_1"]["extras"]
    assert (extras["id"], extras["session"], extras["label"]) == (6, 1, "moved")
    assert (extras["label_machine"], extras["decided_by"]) == ("appeared", "=Ann")
    assert "of its place was in view on the earlier visit" in extras["evidence"]
    assert extras["sigma"] is not None and extras["confidence"] == 0.86
    nodes = {node["name"]: node for node in document["nodes"]}
    assert nodes["object_6_session_1"]["extras"]["label"] == "moved"
    assert nodes["session_0"]["extras"]["captured_at"] == "2026-03-02T09:00:00Z"
    materials = {material.get("name"): material for material in document["materials"]}
    red, green, blue = materials["appeared"]["pbrMetallicRoughness"]["baseColorFactor"][:3]
    # #9d3225 as light: what a viewer turns back into #9d3225 on the screen.
    assert (red, green, blue) == pytest.approx((0.3372, 0.0319, 0.0185), abs=2e-3)
    assert materials["appeared"]["doubleSided"] is True
    material = document["materials"][meshes["object_6_session_1"]["primitives"][0]["material"]]
    assert material["name"] == "moved"


def test_trimesh_finds_the_points_where_they_are(glb_path: Path, reviewed_path: Path) -> None:
    scene = trimesh.load_scene(glb_path)
    result = open_result(reviewed_path)
    for session in result.sessions:
        for object_id in (1, 5):
            name = f"object_{object_id}_session_{session.index}"
            transform, geometry_name = scene.graph[name]
            mesh = scene.geometry[geometry_name]
            assert mesh.metadata["id"] == object_id
            placed = trimesh.transform_points(mesh.vertices, transform)
            back = placed[:, [0, 2, 1]] * [1, -1, 1]  # glTF's y up to the hall's z up
            points = session.points_world[session.object_ids == object_id]
            np.testing.assert_allclose(back.mean(axis=0), points.mean(axis=0), atol=0.1)
            assert (back.min(axis=0) > points.min(axis=0) - 0.15).all()
            assert (back.max(axis=0) < points.max(axis=0) + 0.15).all()
    cloud = scene.geometry["background_session_1"]
    assert len(cloud.vertices) > 100


def test_large_maps_are_thinned_to_the_limit(
    reviewed_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(glb_scene, "MAX_SQUARES", 300)
    export(reviewed_path, "glb", tmp_path / "small.glb")
    scene = trimesh.load_scene(tmp_path / "small.glb")
    triangles = sum(len(g.faces) for g in scene.geometry.values() if isinstance(g, trimesh.Trimesh))
    assert 0 < triangles <= 2 * 300


def test_squares_lie_in_the_surface() -> None:
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(0, 1, (500, 2)), np.zeros(500)])
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3]
    kept = thinned(points, 0.1) @ turn.T
    assert 80 <= len(kept) <= 121
    normals = surface_directions(kept)
    np.testing.assert_allclose(np.abs(normals @ turn[:, 2]), 1, atol=1e-6)
    vertices, triangles = squares(kept, normals, 0.05)
    assert np.abs(vertices @ turn[:, 2]).max() < 1e-5
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    np.testing.assert_allclose(mesh.area, len(kept) * 0.1**2, rtol=1e-4)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_few_points_are_squares_too(count: int) -> None:
    points = np.arange(3.0 * count).reshape(count, 3)
    vertices, triangles = squares(points, surface_directions(points), 0.01)
    assert np.isfinite(vertices).all()
    assert (len(vertices), len(triangles)) == (4 * count, 2 * count)
