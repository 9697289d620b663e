from pathlib import Path

import numpy as np
import pytest
from archive_writers import Recording, recording, write_tum
from scipy.spatial.transform import Rotation

from pipeline.errors import InputError
from pipeline.readers import open_session


def vga(count: int = 2) -> Recording:
    return recording(count, (640, 480))


def test_round_trip_with_the_third_camera(tmp_path: Path) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg3_office"
    what = vga(3)
    write_tum(folder, what)

    session = open_session(folder)

    assert (session.format, session.name, session.warnings) == ("tum", folder.name, ())
    assert [path.name for path in session.metadata_files] == ["rgb.txt", "depth.txt", "groundtruth.txt"]
    for k, frame in enumerate(session.frames):
        assert (frame.index, frame.timestamp_s) == (k, pytest.approx(1305031102.0 + k / 10))
        np.testing.assert_array_equal(frame.load_rgb(), what.colours[k])
        np.testing.assert_allclose(frame.load_depth(), what.depths[k] / 5000, rtol=1e-6)
        np.testing.assert_allclose(frame.T_world_camera, what.T_world_cameras[k], atol=1e-9)
        assert (frame.camera.fx, frame.camera.cy) == (535.4, 247.6)


@pytest.mark.parametrize(
    ("name", "fx"), [("freiburg1_xyz", 517.3), ("x_freiburg2", 520.9), ("fr3_office", 535.4)]
)
def test_camera_follows_the_name(tmp_path: Path, name: str, fx: float) -> None:
    write_tum(tmp_path / name, vga())

    session = open_session(tmp_path / name)

    assert session.frames[0].camera.fx == fx
    assert session.warnings == ()


def test_colour_and_depth_of_the_first_camera_are_undistorted(tmp_path: Path) -> None:
    what = vga()
    write_tum(tmp_path / "freiburg1", what)

    frame = open_session(tmp_path / "freiburg1").frames[0]

    assert (frame.load_rgb() != what.colours[0]).mean() > 0.5
    centre = (slice(253, 258), slice(316, 321))  # the lens bends nothing at its centre
    np.testing.assert_allclose(frame.load_depth()[centre], what.depths[0][centre] / 5000, rtol=1e-6)


def test_unknown_camera_is_assumed_with_a_warning(tmp_path: Path) -> None:
    write_tum(tmp_path / "kitchen", vga())

    session = open_session(tmp_path / "kitchen")

    assert session.frames[0].camera.fx == 525.0
    assert session.warnings == (
        f"{tmp_path}/kitchen: intrinsics are unknown and taken as ROS's defaults (525, 525, 319.5, 239.5): "
        "name the folder after its camera (freiburg1, 2 or 3) or add calibration.txt with `fx fy cx cy`",
    )


def test_calibration_file_gives_the_camera_of_any_size(tmp_path: Path) -> None:
    write_tum(tmp_path / "eth", recording(2, (64, 40)))
    (tmp_path / "eth/calibration.txt").write_text("60.5 61 31 19.5\n")

    session = open_session(tmp_path / "eth")

    camera = session.frames[0].camera
    assert (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy) == (
        64,
        40,
        60.5,
        61,
        31,
        19.5,
    )
    assert session.metadata_files[-1].name == "calibration.txt"


def poses_text(*rows: tuple[float, np.ndarray, Rotation]) -> str:
    return "".join(
        f"{time:.6f} {t[0]} {t[1]} {t[2]} " + " ".join(f"{x:.17g}" for x in rotation.as_quat()) + "\n"
        for time, t, rotation in rows
    )


def test_poses_are_interpolated_between_neighbours(tmp_path: Path) -> None:
    folder = tmp_path / "freiburg3"
    write_tum(folder, vga())
    start, turn = Rotation.from_euler("y", 10, degrees=True), Rotation.from_rotvec([0, 0, 0.2])
    rows = []
    for time in (1305031102.0, 1305031102.1):
        rows += [
            (time - 0.010, np.array([1.0, 2.0, 3.0]), start),
            (time + 0.030, np.array([1.4, 2.0, 2.0]), start * turn),
        ]
    (folder / "groundtruth.txt").write_text(poses_text(*rows))

    T = open_session(folder).frames[0].T_world_camera

    np.testing.assert_allclose(T[:3, 3], [1.1, 2.0, 2.75], atol=1e-5)
    np.testing.assert_allclose(T[:3, :3], (start * Rotation.from_rotvec([0, 0, 0.05])).as_matrix(), atol=1e-5)


def test_nearest_pose_is_taken_where_tracking_paused(tmp_path: Path) -> None:
    folder = tmp_path / "freiburg3"
    write_tum(folder, vga())
    one = Rotation.identity()
    times = (1305031102.0 - 0.01, 1305031102.1 + 0.005)  # 115 ms apart: not to be bridged
    rows = [(time, np.array([k, 0.0, 0.0]), one) for k, time in enumerate(times)]
    (folder / "groundtruth.txt").write_text(poses_text(*rows))

    session = open_session(folder)

    assert [frame.T_world_camera[0, 3] for frame in session.frames] == [0.0, 1.0]


def test_frames_without_near_depth_or_pose_are_left_out(tmp_path: Path) -> None:
    folder = tmp_path / "freiburg3"
    write_tum(folder, vga(5))
    for name, gone in (("depth.txt", 1), ("groundtruth.txt", 2)):
        lines = (folder / name).read_text().splitlines()
        del lines[1 + gone]
        (folder / name).write_text("\n".join(lines))
    lines = (folder / "groundtruth.txt").read_text().splitlines()
    lines[-1] = lines[-1].split()[0] + " 0 0 0 0 0 0 3"
    (folder / "groundtruth.txt").write_text("\n".join(lines))

    session = open_session(folder)

    assert [frame.index for frame in session.frames] == [0, 3]
    assert session.warnings == (
        f"{folder}: frame rgb/1305031102.100000.png is left out: no depth image within 0.02 s",
        f"{folder}: frame rgb/1305031102.200000.png is left out: no pose within 0.02 s",
        f"{folder}: frame rgb/1305031102.400000.png is left out: "
        "its pose is not rigid (quaternion of length 3)",
    )


def test_missing_ground_truth_is_told(tmp_path: Path) -> None:
    write_tum(tmp_path, vga())
    (tmp_path / "groundtruth.txt").unlink()

    with pytest.raises(InputError) as caught:
        open_session(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path}/groundtruth.txt is missing: poses are needed: `timestamp tx ty tz qx qy qz qw`"
    )
