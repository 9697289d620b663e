import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from archive_writers import Recording, random_poses, recording, write_threerscan
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.camera import PinholeCamera, invert_rigid, is_rigid, transform_points
from pipeline.errors import InputError
from pipeline.readers import open_session
from pipeline.readers.threerscan import upright_camera, upright_pose

patient = settings(deadline=None)  # shared machines pause for longer than any deadline

# The calibration of a real scan at a tenth of its size: depth pixels are not square.
COLOUR = PinholeCamera(96, 54, 75.69, 75.62, 47.7, 26.4)
DEPTH = PinholeCamera(22, 17, 17.65, 24.07, 11.1, 8.3)


def scan(count: int = 2) -> Recording:
    return recording(count, (COLOUR.width, COLOUR.height), (DEPTH.width, DEPTH.height))


def depth_by_hand(counts: np.ndarray) -> np.ndarray:
    """Depth of every colour pixel of the image as stored, metres, pixel by pixel."""
    depth_m = np.zeros((COLOUR.height, COLOUR.width))
    for v in range(COLOUR.height):
        for u in range(COLOUR.width):
            column = round((u - COLOUR.cx) / COLOUR.fx * DEPTH.fx + DEPTH.cx)
            row = round((v - COLOUR.cy) / COLOUR.fy * DEPTH.fy + DEPTH.cy)
            if 0 <= column < DEPTH.width and 0 <= row < DEPTH.height:
                depth_m[v, u] = counts[row, column] / 1000
    return depth_m


def test_frames_are_turned_upright(tmp_path: Path) -> None:
    what = scan()
    # A bright bar at the left of the stored image is at the top of the upright one.
    what.colours[:] = 20
    what.colours[:, :, :16] = 230
    write_threerscan(tmp_path / "sequence", what, COLOUR, DEPTH)

    session = open_session(tmp_path)

    frame = session.frames[0]
    assert (session.format, session.name, session.warnings) == ("3rscan", tmp_path.name, ())
    assert (frame.camera.width, frame.camera.height) == (54, 96)
    assert frame.load_rgb().shape == (96, 54, 3)
    assert frame.load_depth().shape == (96, 54)
    assert frame.load_rgb()[:12].min() > 200
    assert frame.load_rgb()[20:].max() < 50
    assert [file.name for file in frame.files] == [
        "frame-000000.color.jpg", "frame-000000.depth.pgm", "frame-000000.pose.txt"
    ]  # fmt: skip


def test_world_points_are_those_of_the_stored_images(tmp_path: Path) -> None:
    what = scan()
    write_threerscan(tmp_path / "sequence", what, COLOUR, DEPTH)

    for frame, counts, T_stored in zip(
        open_session(tmp_path).frames, what.depths, what.T_world_cameras, strict=True
    ):
        stored_m = depth_by_hand(counts)
        v, u = np.indices(stored_m.shape)
        rays = np.stack(
            [(u - COLOUR.cx) / COLOUR.fx, (v - COLOUR.cy) / COLOUR.fy, np.ones_like(stored_m)], -1
        )
        expected = (rays * stored_m[..., None]) @ T_stored[:3, :3].T + T_stored[:3, 3]

        depth = frame.load_depth()
        points = transform_points(frame.T_world_camera, frame.camera.backproject(depth))

        as_stored = np.rot90(points, k=1)  # back to the pixel order of the file
        np.testing.assert_allclose(np.rot90(depth, k=1), stored_m, atol=1e-6)
        np.testing.assert_allclose(as_stored, expected, atol=2e-5)
    assert (stored_m > 0).mean() > 0.7


@patient
@given(seed=st.integers(0, 2**32 - 1))
def test_a_point_lands_on_the_turned_pixel(seed: int) -> None:
    rng = np.random.default_rng(seed)
    width, height = (int(size) for size in rng.integers(20, 2000, 2))
    stored = PinholeCamera(width, height, *rng.uniform(50, 2000, 2), *rng.uniform(0, 20, 2))
    T_world_stored = random_poses(rng, 1)[0]
    point_stored = np.array([*rng.uniform(-2, 2, 2), rng.uniform(0.5, 9)])
    point_world = transform_points(T_world_stored, point_stored)

    T_world_upright = upright_pose(T_world_stored)
    pixel, depth = stored.project(point_stored)
    turned, turned_depth = upright_camera(stored).project(
        transform_points(invert_rigid(T_world_upright), point_world)
    )

    assert is_rigid(T_world_upright, tolerance=1e-9)
    np.testing.assert_allclose(turned, [height - 1 - pixel[1], pixel[0]], atol=1e-6, rtol=1e-9)
    assert turned_depth == pytest.approx(depth)


@pytest.mark.parametrize("prefix", ["", "sequence/"])
def test_packed_sequence_gives_the_same_frames(tmp_path: Path, prefix: str) -> None:
    write_threerscan(tmp_path / "sequence", scan(), COLOUR, DEPTH)
    unpacked = open_session(tmp_path).frames
    expected = [(frame.load_rgb(), frame.load_depth(), frame.T_world_camera) for frame in unpacked]
    with zipfile.ZipFile(tmp_path / "sequence.zip", "w") as archive:
        for file in (tmp_path / "sequence").iterdir():
            archive.write(file, prefix + file.name)
    shutil.rmtree(tmp_path / "sequence")

    session = open_session(tmp_path)

    assert session.path == tmp_path
    assert session.metadata_files == (tmp_path / "sequence.zip",)
    for frame, (colour, depth, T) in zip(session.frames, expected, strict=True):
        np.testing.assert_array_equal(frame.load_rgb(), colour)
        np.testing.assert_array_equal(frame.load_depth(), depth)
        np.testing.assert_array_equal(frame.T_world_camera, T)


def test_archive_inside_an_archive_is_told(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "scan.zip", "w") as archive:
        archive.writestr("sequence.zip", b"")

    with pytest.raises(InputError) as caught:
        open_session(tmp_path / "scan.zip")
    assert str(caught.value) == (
        f"{tmp_path}/scan.zip/sequence.zip is an archive inside an archive: unpack {tmp_path}/scan.zip"
    )


def test_frames_that_lack_a_file_are_left_out(tmp_path: Path) -> None:
    write_threerscan(tmp_path, scan(4), COLOUR, DEPTH)
    (tmp_path / "frame-000001.depth.pgm").unlink()
    pgm = tmp_path / "frame-000002.depth.pgm"
    pgm.write_bytes(pgm.read_bytes()[:-100])

    session = open_session(tmp_path)

    assert [frame.index for frame in session.frames] == [0, 2, 3]
    assert session.warnings == (
        f"{tmp_path}: frame frame-000001 is left out: depth image frame-000001.depth.pgm is missing",
    )
    with pytest.raises(InputError) as caught:
        session.frames[1].load_depth()
    assert str(caught.value) == f"{pgm} is not an image that can be decoded: copy the file again"


def test_depth_shift_is_counts_per_metre(tmp_path: Path) -> None:
    what = scan()
    write_threerscan(tmp_path, what, COLOUR, DEPTH, shift=2000)

    depth = open_session(tmp_path).frames[0].load_depth()

    np.testing.assert_allclose(np.rot90(depth, k=1), depth_by_hand(what.depths[0]) / 2, atol=1e-6)


@pytest.mark.parametrize(
    ("line", "replacement", "message"),
    [
        ("m_colorWidth = 96", "", "'m_colorWidth' is missing or malformed: 1 number(s) are expected"),
        ("m_depthShift = 1000", "m_depthShift = 0", "m_depthShift is 0: counts per metre are > 0"),
        (
            "m_calibrationDepthExtrinsic = 1 0 0 0",
            "m_calibrationDepthExtrinsic = 1 0 0 0.05",
            "m_calibrationDepthExtrinsic is not the identity: depth must be registered to colour",
        ),
        (
            "m_calibrationColorIntrinsic = 75",
            "m_calibrationColorIntrinsic = -75",
            "wrong intrinsics, fx is -75.69: fx, fy, cx, cy are in pixels of the stored image",
        ),
    ],
)
def test_faults_of_the_calibration_are_told(
    tmp_path: Path, line: str, replacement: str, message: str
) -> None:
    write_threerscan(tmp_path, scan(), COLOUR, DEPTH)
    info = tmp_path / "_info.txt"
    assert line in info.read_text()
    info.write_text(info.read_text().replace(line, replacement))

    with pytest.raises(InputError) as caught:
        open_session(tmp_path)
    assert str(caught.value) == f"{info}: {message}"
