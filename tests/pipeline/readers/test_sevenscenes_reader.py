from pathlib import Path

import numpy as np
import pytest
from archive_writers import recording, write_sevenscenes

from pipeline.camera import PinholeCamera
from pipeline.errors import InputError
from pipeline.readers import open_session


def test_round_trip_with_invalid_depth(tmp_path: Path) -> None:
    what = recording(3, (640, 480))
    what.depths[:, 10:20, 30:50] = 65535
    write_sevenscenes(tmp_path / "seq-01", what)

    session = open_session(tmp_path / "seq-01")

    assert (session.format, session.name, session.warnings) == ("7scenes", "seq-01", ())
    for k, frame in enumerate(session.frames):
        expected = np.where(what.depths[k] == 65535, 0, what.depths[k]) / 1000
        np.testing.assert_array_equal(frame.load_rgb(), what.colours[k])
        np.testing.assert_allclose(frame.load_depth(), expected, rtol=1e-6)
        np.testing.assert_allclose(frame.T_world_camera, what.T_world_cameras[k], atol=1e-12)
        assert frame.camera == PinholeCamera(640, 480, 585.0, 585.0, 320.0, 240.0)
        assert [path.suffixes[0] for path in frame.files] == [".color", ".depth", ".pose"]


def test_frames_with_broken_poses_are_left_out(tmp_path: Path) -> None:
    write_sevenscenes(tmp_path, recording(5, (640, 480)))
    (tmp_path / "frame-000001.pose.txt").write_text("nan " * 16)
    (tmp_path / "frame-000002.pose.txt").write_text("1 0 0")
    (tmp_path / "frame-000003.pose.txt").unlink()

    session = open_session(tmp_path)

    assert [frame.index for frame in session.frames] == [0, 4]
    assert session.warnings == (
        f"{tmp_path}: frame frame-000001 is left out: its pose is not finite",
        f"{tmp_path}: frame frame-000002 is left out: its pose has 3 numbers instead of 16",
        f"{tmp_path}: frame frame-000003 is left out: pose frame-000003.pose.txt is missing",
    )


def test_scene_of_several_sequences_is_not_one_visit(tmp_path: Path) -> None:
    for name in ("seq-01", "seq-02"):
        write_sevenscenes(tmp_path / name, recording(2, (640, 480)))

    with pytest.raises(InputError) as caught:
        open_session(tmp_path)
    assert str(caught.value) == f"{tmp_path} holds 2 recordings: name one of them: seq-01, seq-02"
