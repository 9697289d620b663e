import json
from pathlib import Path

import numpy as np
import pytest
from archive_writers import recording, save_transforms, write_image, write_nerfstudio

from pipeline.mapping.keyframes import select_keyframes
from pipeline.readers import open_session
from pipeline.readers.check import check_archive
from pipeline.settings import Settings


def walk(folder: Path, steps_m: list[float]) -> None:
    """A recording whose camera walks along x; the depth of all pixels is 2 m but for a quarter of holes."""
    what = recording(len(steps_m) + 1)
    what.depths[:] = 2000
    what.depths[:, :12, :16] = 0
    what.T_world_cameras[:] = np.eye(4)
    what.T_world_cameras[:, 0, 3] = np.cumsum([0.0, *steps_m])
    write_nerfstudio(folder, what)


def test_report_tells_what_is_inside(tmp_path: Path) -> None:
    walk(tmp_path, [0.1] * 20)

    report = check_archive(tmp_path)

    assert (report.usable, report.format, report.name) == (True, "nerfstudio", tmp_path.name)
    assert (report.frames_used, report.frames_left_out, report.sampled_frames) == (21, 0, 12)
    assert (report.width_px, report.height_px, report.cameras) == (32, 24, 1)
    assert (report.fx_px, report.fy_px, report.cx_px, report.cy_px) == (30.0, 31.0, 15.5, 11.5)
    assert report.span_s == pytest.approx(20 / 30)
    assert report.path_length_m == pytest.approx(2.0)
    assert report.depth_percentiles_m == pytest.approx((2.0, 2.0, 2.0))
    assert report.holes == pytest.approx(0.25)
    assert report.keyframes == len(select_keyframes(open_session(tmp_path), Settings().keyframes))
    assert (report.warnings, report.problems) == ((), ())


def test_lines_are_for_people(tmp_path: Path) -> None:
    walk(tmp_path, [0.1] * 20)
    (tmp_path / "depth/00007.png").unlink()

    report = check_archive(tmp_path)

    assert report.lines() == [
        f"archive     {tmp_path}",
        f"visit       {tmp_path.name}",
        "format      nerfstudio, depth from sensor",
        "frames      20 used, 1 left out",
        "camera      32 x 24, fx 30.0 fy 31.0 cx 15.5 cy 11.5 px, 56 deg wide",
        "path        2.00 m, 0.7 s",
        "depth       2.00 to 2.00 m, median 2.00 m (5th to 95th percentile of 12 frames)",
        "holes       25.0 % of pixels without depth",
        f"keyframes   {report.keyframes} with the default selection",
        f"warning     {tmp_path}: frame images/00007.png is left out: depth image depth/00007.png is missing",
    ]


def test_report_is_plain_json(tmp_path: Path) -> None:
    walk(tmp_path, [0.1] * 3)

    read_back = json.loads(json.dumps(check_archive(tmp_path).to_dict()))

    assert read_back["usable"] is True
    assert read_back["depth_percentiles_m"] == pytest.approx([2.0, 2.0, 2.0])


def test_images_are_optional(tmp_path: Path) -> None:
    walk(tmp_path, [0.1] * 3)

    report = check_archive(tmp_path, images=False)

    assert (report.sampled_frames, report.depth_percentiles_m, report.holes) == (0, (), None)
    assert not any(line.startswith(("depth", "holes")) for line in report.lines())


def test_what_cannot_be_opened_is_a_problem_not_an_exception(tmp_path: Path) -> None:
    report = check_archive(tmp_path / "visit")

    problem = f"there is no archive {tmp_path}/visit: name a folder, .zip, .tar or .tar.gz"
    assert not report.usable
    assert report.problems == (problem,)
    assert report.lines() == [f"archive     {tmp_path}/visit", f"problem     {problem}"]


def test_unreadable_samples_are_problems(tmp_path: Path) -> None:
    walk(tmp_path, [0.1] * 3)
    (tmp_path / "images/00002.png").write_bytes(b"garbage")

    report = check_archive(tmp_path)

    assert report.sampled_frames == 3
    assert report.problems == (
        f"{tmp_path}/images/00002.png is not an image that can be decoded: copy the file again",
    )


def test_doubtful_motion_is_told(tmp_path: Path) -> None:
    walk(tmp_path, [0.1, 0.1, 30.0, 0.1])

    assert check_archive(tmp_path).warnings == (
        f"{tmp_path}: the camera jumps by 30.0 m from frame images/00002.png to images/00003.png: "
        "was tracking lost, or are the poses not metric?",
    )


def test_equal_poses_are_told(tmp_path: Path) -> None:
    walk(tmp_path, [0.0, 0.0])

    assert check_archive(tmp_path).warnings == (
        f"{tmp_path}: all poses are equal: are they missing from the export?",
    )


def test_timestamps_that_go_backwards_are_told(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(3))
    document["frames"][1]["timestamp"] = 0.0
    save_transforms(tmp_path, document)

    assert (
        f"{tmp_path}: timestamps go backwards: frames are used in the order of the archive"
        in check_archive(tmp_path).warnings
    )


def test_mostly_and_entirely_empty_depth_are_told(tmp_path: Path) -> None:
    walk(tmp_path / "few", [0.1])
    walk(tmp_path / "none", [0.1])
    for k in range(2):
        depth = np.zeros((24, 32), np.uint16)
        write_image(tmp_path / f"none/depth/{k:05d}.png", depth)
        depth[:6] = 1500
        write_image(tmp_path / f"few/depth/{k:05d}.png", depth)

    few, none = check_archive(tmp_path / "few"), check_archive(tmp_path / "none")

    assert few.warnings == (f"{tmp_path}/few: 75 % of pixels have no depth: the map will have gaps",)
    assert none.problems == (
        f"{tmp_path}/none: the sampled depth images are empty: check how depth was exported",
    )
