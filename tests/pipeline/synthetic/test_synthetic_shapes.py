import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.synthetic.atlas import TextureAtlas
from pipeline.synthetic.paths import look_at
from pipeline.synthetic.shapes import box, cylinder, lathe, pose, prism, sphere
from pipeline.synthetic.textures import noise

length = st.floats(0.05, 3.0)


def volume(mesh) -> float:
    """Signed volume by the normals' side: positive when normals point outwards."""
    a, b, c = (mesh.corners[:, i].astype(float) for i in range(3))
    cross = np.cross(b - a, c - a)
    side = np.sign(np.einsum("ij,ij->i", cross, mesh.normals.mean(1)))
    return float((np.einsum("ij,ij->i", a, cross) * side).sum() / 6)


@settings(max_examples=25, deadline=None)
@given(length, length, length)
def test_a_box_is_closed_and_its_normals_point_outwards(width, depth, height):
    assert volume(box((0, 0, 0), (width, depth, height), 0)) == pytest.approx(
        width * depth * height, rel=1e-4
    )


@settings(max_examples=25, deadline=None)
@given(length, length)
def test_a_cylinder_is_closed_and_its_normals_point_outwards(radius, height):
    exact = 20 / 2 * np.sin(2 * np.pi / 20) * radius**2 * height  # of the 20-sided prism
    assert volume(cylinder(radius, height, 0)) == pytest.approx(exact, rel=1e-3)


def test_a_sphere_and_a_prism_have_their_volume():
    assert volume(sphere(1.0, 0)) == pytest.approx(4 / 3 * np.pi, rel=0.1)
    assert volume(prism([(0, 0), (2, 0), (0, 1)], 3.0, 0)) == pytest.approx(3.0, rel=1e-4)


def test_print_is_upright_and_not_mirrored_on_every_side_of_a_box():
    mesh = box((0, 0, 0), (1, 1, 1), [0, 1, 2, 3, 4, 5], None)
    for face in range(4):  # the upright faces
        chosen = mesh.tile == face
        corners, uv = mesh.corners[chosen].reshape(-1, 3), mesh.uv[chosen].reshape(-1, 2)
        normal = mesh.normals[chosen][0, 0]
        right = np.cross(-normal, [0, 0, 1])
        np.testing.assert_allclose(np.ptp(uv[:, 0] - corners @ right), 0, atol=1e-6)
        np.testing.assert_allclose(uv[:, 1], 1 - corners[:, 2], atol=1e-6)


def test_a_profile_that_touches_the_axis_leaves_no_empty_triangles():
    mesh = lathe([[0, 0], [1, 0], [0, 1]], 0)
    area = np.linalg.norm(
        np.cross(mesh.corners[:, 1] - mesh.corners[:, 0], mesh.corners[:, 2] - mesh.corners[:, 0]), axis=1
    )
    assert area.min() > 1e-6
    assert np.isfinite(mesh.normals).all()


@settings(max_examples=30, deadline=None)
@given(st.tuples(*[st.floats(-5, 5)] * 3), st.floats(0.5, 5), st.floats(-3, 3), st.floats(-0.3, 0.3))
def test_look_at_is_rigid_and_sees_its_target_ahead(eye, away, yaw, roll):
    target = np.add(eye, [away * np.cos(yaw), away * np.sin(yaw), 0.2])
    T = look_at(np.array(eye), target, roll)
    np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
    ahead = T[:3, :3].T @ (target - T[:3, 3])
    np.testing.assert_allclose(ahead, [0, 0, np.hypot(away, 0.2)], atol=1e-9)
    assert T[2, 1] < 0  # the image's y axis points down


def test_the_atlas_interpolates_and_wraps():
    atlas = TextureAtlas()
    image = np.zeros((4, 4, 3), dtype=np.uint8)
    image[1, 2] = 255
    atlas.add(np.full((8, 8, 3), 51, dtype=np.uint8))
    tile = atlas.add(image)
    uv = np.array(
        [[2.5 / 4, 1.5 / 4], [2.5 / 4 + 3, 1.5 / 4 - 2], [3.0 / 4, 1.5 / 4], [0.1, 0.9]], dtype=np.float32
    )
    colour = atlas.sampler().sample(np.full(4, tile), uv.T, np.full(4, 0.01, np.float32)).T
    np.testing.assert_allclose(colour[:, 0], [1, 1, 0.25, 0], atol=1e-5)
    coarse = atlas.sampler().sample(np.full(1, tile), uv[:1].T, np.full(1, 1.0, np.float32)).T
    np.testing.assert_allclose(coarse[0, 0], (255 / 16 / 255) ** 2, atol=1e-3)


def test_the_atlas_refuses_other_sizes():
    with pytest.raises(ValueError, match="power of two"):
        TextureAtlas().add(np.zeros((12, 12, 3), dtype=np.uint8))


def test_noise_has_no_seam():
    field = noise(np.random.default_rng(0), 64, 1.5)
    across_seam = np.abs(field[:, 0] - field[:, -1]).mean()
    inside = np.abs(np.diff(field, axis=1)).mean()
    assert across_seam < 1.5 * inside
    assert field.std() == pytest.approx(1, abs=1e-3)


def test_pose_composes():
    np.testing.assert_allclose(pose(1, 0, 0, 0.3) @ pose(0, 0, 0, -0.3), pose(1, 0, 0), atol=1e-12)
