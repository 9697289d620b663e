"""The recordings beside the repository, where there are any."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.camera import invert_rigid, is_rigid, transform_points
from pipeline.readers import open_session
from pipeline.readers.check import check_archive
from pipeline.readers.fingerprint import fingerprint
from pipeline.session import Session

REAL = Path(__file__).resolve().parents[4] / "shared" / "real"

pytestmark = [pytest.mark.real, pytest.mark.skipif(not REAL.is_dir(), reason="no real recordings")]


@pytest.mark.parametrize(
    ("folder", "name", "frames", "size"),
    [
        ("livingarea/visit1", "livingarea visit 1", 6, (640, 480)),
        ("kitchen/first", "red kitchen first", 25, (640, 480)),
    ],
)
def test_real_archives_open_whole(folder: str, name: str, frames: int, size: tuple[int, int]) -> None:
    session = open_session(REAL / folder)

    assert (session.name, len(session.frames), session.warnings) == (name, frames, ())
    for frame in session.frames:
        assert (frame.camera.width, frame.camera.height) == size
        assert is_rigid(frame.T_world_camera, tolerance=1e-5)
    last = session.frames[-1]
    assert last.load_rgb().shape == (size[1], size[0], 3)
    assert 0.3 < np.median(last.load_depth()[last.load_depth() > 0]) < 10
    assert len(fingerprint(session)) == 64


def depth_agreement(session: Session, a: int, b: int) -> tuple[float, int]:
    """Median |measured - predicted| depth of frame b, metres, predicted from frame a; and how many pixels."""
    first, second = session.frames[a], session.frames[b]
    depth = first.load_depth()
    points_world = transform_points(first.T_world_camera, first.camera.backproject(depth)[depth > 0])
    pixels, predicted = second.camera.project(
        transform_points(invert_rigid(second.T_world_camera), points_world)
    )
    columns, rows = pixels.round().astype(int).T
    height, width = depth.shape
    inside = (predicted > 0.1) & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    measured = second.load_depth()[rows[inside], columns[inside]]
    both = measured > 0
    return float(np.median(np.abs(measured - predicted[inside])[both])), int(both.sum())


def test_consecutive_real_frames_agree_in_world_space() -> None:
    # Wrong axes, units or undistortion would put the surfaces of two frames apart.
    error_m, pixels = depth_agreement(open_session(REAL / "kitchen/first"), 0, 1)

    assert pixels > 50_000
    assert error_m < 0.03


def test_real_archive_passes_the_check() -> None:
    report = check_archive(REAL / "livingarea/visit1")

    assert report.usable
    assert report.problems == ()
    assert report.keyframes == 6
    assert report.holes is not None
    assert 0 < report.holes < 0.4
