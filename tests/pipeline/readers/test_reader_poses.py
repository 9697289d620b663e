import numpy as np
import pytest
from archive_writers import opengl_from_opencv, random_poses
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.camera import is_rigid
from pipeline.errors import InputError
from pipeline.readers.filetree import normalised
from pipeline.readers.poses import checked_pose, opencv_from_opengl
from pipeline.readers.tum import nearest

patient = settings(deadline=None)  # shared machines pause for longer than any deadline
seeds = st.integers(0, 2**32 - 1)


@patient
@given(seeds)
def test_opengl_and_opencv_cameras_see_the_same_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T_world_opengl = random_poses(rng, 1)[0]
    x, y, z = rng.uniform(-3, 3, 3)

    T_world_opencv = opencv_from_opengl(T_world_opengl)

    np.testing.assert_allclose(T_world_opencv @ [x, y, z, 1], T_world_opengl @ [x, -y, -z, 1], atol=1e-12)
    assert is_rigid(T_world_opencv, tolerance=1e-9)
    np.testing.assert_allclose(opengl_from_opencv(T_world_opencv), T_world_opengl, atol=1e-12)


@patient
@given(seeds)
def test_rigid_poses_pass_unchanged(seed: int) -> None:
    T = random_poses(np.random.default_rng(seed), 1)[0]

    np.testing.assert_array_equal(checked_pose(T.tolist()), T)
    np.testing.assert_array_equal(checked_pose(T[:3].tolist()), T)


@patient
@given(seeds, st.floats(1e-5, 2e-3))
def test_rounded_rotations_become_the_nearest_rotation(seed: int, noise: float) -> None:
    rng = np.random.default_rng(seed)
    T = random_poses(rng, 1)[0]
    rounded = T.copy()
    rounded[:3, :3] += rng.uniform(-noise, noise, (3, 3))

    repaired = checked_pose(rounded)

    assert is_rigid(repaired, tolerance=1e-9)
    assert np.abs(repaired[:3, :3] - T[:3, :3]).max() < 4 * noise
    np.testing.assert_array_equal(repaired[:3, 3], T[:3, 3])


@patient
@given(seeds, st.floats(0.01, 100).filter(lambda scale: abs(scale - 1) > 0.05))
def test_scaled_rotations_are_named_as_such(seed: int, scale: float) -> None:
    T = random_poses(np.random.default_rng(seed), 1)[0]
    T[:3, :3] *= scale

    with pytest.raises(InputError) as caught:
        checked_pose(T)
    assert str(caught.value) == (
        f"its pose is not rigid (rotation scaled by {scale:.3g}; poses must be metric and unscaled)"
    )


@pytest.mark.parametrize(
    ("matrix", "clause"),
    [
        (None, "its pose is missing"),
        ("identity", "its pose is not a matrix of numbers"),
        ([[1, 2], [3]], "its pose is not a matrix of numbers"),
        (np.eye(3), "its pose has shape (3, 3) instead of (4, 4)"),
        (np.full((4, 4), np.nan), "its pose is not finite"),
        (np.diag([1, 1, np.inf, 1]), "its pose is not finite"),
        (np.diag([1.0, 1, 1, 2]), "its pose is not rigid (the last row is not 0 0 0 1)"),
        (np.diag([1.0, 1, -1, 1]), "its pose is not rigid (mirrored axes)"),
        (np.diag([1.0, 1, 3, 1]), "its pose is not rigid (the rotation is not orthonormal)"),
        (np.diag([0.0, 0, 0, 1]), "its pose is not rigid (the rotation is not orthonormal)"),
    ],
)
def test_broken_poses_say_why(matrix: object, clause: str) -> None:
    with pytest.raises(InputError) as caught:
        checked_pose(matrix)
    assert str(caught.value) == clause


@patient
@given(st.lists(st.floats(0, 100), min_size=1, max_size=30), st.floats(-10, 110))
def test_nearest_time_is_nearest(times: list[float], time: float) -> None:
    ascending = np.sort(times)

    assert abs(ascending[nearest(ascending, time)] - time) == np.abs(ascending - time).min()


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("images/0.png", "images/0.png"),
        ("./images//0.png", "images/0.png"),
        ("images\\0.png", "images/0.png"),
        ("a/../b.png", "b.png"),
        ("../b.png", None),
        ("a/../../b.png", None),
        ("/b.png", None),
        ("C:/b.png", None),
        ("..", None),
    ],
)
def test_names_never_lead_outside(name: str, expected: str | None) -> None:
    assert normalised(name) == expected
