from __future__ import annotations

import numpy as np
import pytest

from oasisview.scene import outlines
from pipeline.camera import PinholeCamera, invert_rigid, transform_points

CAMERA = PinholeCamera(64, 48, 50.0, 52.0, 31.5, 23.5)


def test_a_box_has_twelve_edges_of_its_side_lengths() -> None:
    edges = outlines.box_segments([0, 0, 0], [1, 2, 3])
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    assert sorted(lengths.tolist()) == [1.0] * 4 + [2.0] * 4 + [3.0] * 4
    grown = outlines.box_segments([0, 0, 0], [1, 2, 3], margin_m=0.5)
    assert grown.min() == -0.5 and grown.max() == 3.5


def test_dashes_cover_half_of_a_line_and_end_inside_it() -> None:
    line = np.array([[[0, 0, 0], [2, 0, 0]]], np.float32)
    dashes = outlines.dashed(line, 0.1)
    assert len(dashes) == 10
    assert np.linalg.norm(dashes[:, 1] - dashes[:, 0], axis=1).sum() == pytest.approx(1.0, rel=1e-5)
    assert dashes.min() >= 0 and dashes[..., 0].max() <= 2


def test_frustum_corners_project_to_the_image_corners() -> None:
    T = np.eye(4)
    T[:3, :3] = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], float)
    T[:3, 3] = [1, 2, 3]
    corners = outlines.frustum_corners(CAMERA, T, 2.0)
    assert corners[0] == pytest.approx([1, 2, 3])
    pixels, depth = CAMERA.project(transform_points(invert_rigid(T), corners[1:].astype(np.float64)))
    assert depth == pytest.approx([2.0] * 4)
    assert pixels == pytest.approx(
        np.array([[-0.5, -0.5], [63.5, -0.5], [63.5, 47.5], [-0.5, 47.5]]), abs=1e-4
    )
    assert outlines.frustum_segments(CAMERA, T, 2.0).shape == (8, 2, 3)


def test_a_path_has_a_segment_less_than_positions() -> None:
    path = outlines.path_segments(np.arange(12.0).reshape(4, 3))
    assert path.shape == (3, 2, 3) and (path[:-1, 1] == path[1:, 0]).all()


def test_the_box_mesh_is_closed_and_faces_outward() -> None:
    vertices, faces = outlines.box_mesh()
    triangles = vertices[faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    assert (np.einsum("ij,ij->i", normals, triangles.mean(axis=1)) > 0).all()
    assert np.linalg.norm(normals, axis=1).sum() / 2 == pytest.approx(6.0)
