"""Every message about a bad archive, word for word: what, where, how to mend it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from archive_writers import recording, save_transforms, write_image, write_nerfstudio

from pipeline.errors import InputError
from pipeline.readers import open_session

Document = dict[str, Any]
INTRINSICS_HINT = "fx, fy, cx, cy are in pixels of the stored image"


def set_all(document: Document, **values: Any) -> None:
    for frame in document["frames"]:
        frame.update(values)


def scale_rotations(document: Document, factor: float) -> None:
    for frame in document["frames"]:
        T = np.array(frame["transform_matrix"])
        T[:3, :3] *= factor
        frame["transform_matrix"] = T.tolist()


# (change of a good document of three frames, the whole message; {root} is the archive)
REFUSED: dict[str, tuple[Callable[[Document], object], str]] = {
    "no frames": (
        lambda d: d.pop("frames"),
        "{root}/transforms.json: 'frames' is missing or empty: a list of frames is expected",
    ),
    "empty frames": (
        lambda d: d["frames"].clear(),
        "{root}/transforms.json: 'frames' is missing or empty: a list of frames is expected",
    ),
    "one frame": (
        lambda d: d["frames"].__delitem__(slice(1, None)),
        "{root} has only one usable frame: a session needs at least 2 frames",
    ),
    "one good frame": (
        lambda d: [d["frames"][k].update(transform_matrix=[[float("nan")] * 4] * 4) for k in (0, 2)],
        "{root} has only one usable frame (2 left out: its pose is not finite): "
        "a session needs at least 2 frames",
    ),
    "no depth at all": (
        lambda d: [frame.pop("depth_file_path") for frame in d["frames"]],
        "{root}/transforms.json: no frame has 'depth_file_path': "
        "a depth estimator is needed for colour-only archives",
    ),
    "missing focal length": (
        lambda d: d.pop("fl_x"),
        "{root}/transforms.json: 'fl_x' is missing: a number is expected",
    ),
    "missing width": (lambda d: d.pop("w"), "{root}/transforms.json: 'w' is missing: a number is expected"),
    "text as number": (
        lambda d: d.update(cx="middle"),
        "{root}/transforms.json: 'cx' is 'middle': a finite number is expected",
    ),
    "NaN as number": (
        lambda d: d.update(fl_y=float("nan")),
        "{root}/transforms.json: 'fl_y' is nan: a finite number is expected",
    ),
    "negative focal length": (
        lambda d: d.update(fl_x=-30),
        "{root}/transforms.json: wrong intrinsics, fx is -30: " + INTRINSICS_HINT,
    ),
    "no height": (
        lambda d: d.update(h=0),
        "{root}/transforms.json: wrong intrinsics, height is 0: " + INTRINSICS_HINT,
    ),
    "absurdly wide": (
        lambda d: d.update(fl_x=0.9),
        "{root}/transforms.json: wrong intrinsics, fx = 0.9 means a field of view of 173.6 deg: "
        + INTRINSICS_HINT,
    ),
    "absurdly narrow": (
        lambda d: d.update(fl_y=5000),
        "{root}/transforms.json: wrong intrinsics, fy = 5000 means a field of view of 0.3 deg: "
        + INTRINSICS_HINT,
    ),
    "centre outside": (
        lambda d: d.update(cx=320),
        "{root}/transforms.json: wrong intrinsics, cx = 320 lies far outside the image of 32 px: "
        + INTRINSICS_HINT,
    ),
    "intrinsics of every frame wrong": (
        lambda d: set_all(d, fl_x=-1),
        "{root}: none of the 3 frames can be used: frame images/00000.png: "
        "{root}/transforms.json, frame images/00000.png: wrong intrinsics, fx is -1: " + INTRINSICS_HINT,
    ),
    "depth unit": (
        lambda d: d.update(depth_unit_scale_factor=0),
        "{root}/transforms.json: 'depth_unit_scale_factor' is 0: metres per count are > 0",
    ),
    "fisheye": (
        lambda d: d.update(camera_model="OPENCV_FISHEYE"),
        "{root}/transforms.json: camera model 'OPENCV_FISHEYE' is not supported: "
        "undistort the images to OPENCV or PINHOLE first",
    ),
    "all poses NaN": (
        lambda d: set_all(d, transform_matrix=[[float("nan")] * 4] * 4),
        "{root}: none of the 3 frames can be used: frame images/00000.png: its pose is not finite",
    ),
    "poses of a scaled world": (
        lambda d: scale_rotations(d, 0.25),
        "{root}: none of the 3 frames can be used: frame images/00000.png: its pose is not rigid "
        "(rotation scaled by 0.25; poses must be metric and unscaled)",
    ),
    "no image exists": (
        lambda d: set_all(d, file_path="elsewhere.png"),
        "{root}: none of the 3 frames can be used: frame elsewhere.png: "
        "colour image elsewhere.png is missing",
    ),
    "size differs from w": (
        lambda d: d.update(w=30),
        "{root}: none of the 3 frames can be used: frame images/00000.png: "
        "colour image {root}/images/00000.png is 32 x 24, but its intrinsics are for 30 x 24: "
        "the intrinsics must belong to the stored images",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_archive_is_refused(tmp_path: Path, case: str) -> None:
    change, message = REFUSED[case]
    document = write_nerfstudio(tmp_path, recording(3))
    change(document)
    save_transforms(tmp_path, document)

    with pytest.raises(InputError) as caught:
        open_session(tmp_path)
    assert str(caught.value) == message.format(root=tmp_path)


# (change of the second of three frames, what the warning says after the frame's name)
LEFT_OUT: dict[str, tuple[Callable[[Document], object], str, str]] = {
    "missing colour": (
        lambda f: f.update(file_path="images/x.png"),
        "images/x.png",
        "colour image images/x.png is missing",
    ),
    "missing depth": (
        lambda f: f.update(depth_file_path="depth/x.png"),
        "images/00001.png",
        "depth image depth/x.png is missing",
    ),
    "no depth stated": (
        lambda f: f.pop("depth_file_path"),
        "images/00001.png",
        "it has no depth ('depth_file_path')",
    ),
    "no file stated": (lambda f: f.pop("file_path"), "#1", "'file_path' is missing"),
    "outside": (
        lambda f: f.update(depth_file_path="../../depth.png"),
        "images/00001.png",
        "../../depth.png lies outside the archive",
    ),
    "no pose": (lambda f: f.pop("transform_matrix"), "images/00001.png", "its pose is missing"),
    "sheared pose": (
        lambda f: f["transform_matrix"][0].__setitem__(0, 7.0),
        "images/00001.png",
        "its pose is not rigid (the rotation is not orthonormal)",
    ),
    "own intrinsics": (
        lambda f: f.update(cy=-500),
        "images/00001.png",
        "{root}/transforms.json, frame images/00001.png: wrong intrinsics, "
        "cy = -500 lies far outside the image of 24 px: " + INTRINSICS_HINT,
    ),
}


@pytest.mark.parametrize("case", LEFT_OUT)
def test_frame_is_left_out(tmp_path: Path, case: str) -> None:
    change, name, reason = LEFT_OUT[case]
    document = write_nerfstudio(tmp_path, recording(3))
    change(document["frames"][1])
    save_transforms(tmp_path, document)

    session = open_session(tmp_path)

    assert [frame.index for frame in session.frames] == [0, 2]
    assert session.warnings == (f"{tmp_path}: frame {name} is left out: {reason.format(root=tmp_path)}",)


# (what goes wrong with the second frame's file, loader, the whole message)
UNREADABLE: dict[str, tuple[str, str, Callable[[Path], object], str]] = {
    "not an image": (
        "load_rgb",
        "images/00001.png",
        lambda file: file.write_bytes(b"garbage"),
        "{file} is not an image that can be decoded: copy the file again",
    ),
    "empty": (
        "load_rgb",
        "images/00001.png",
        lambda file: file.write_bytes(b""),
        "{file} is not an image that can be decoded: copy the file again",
    ),
    "truncated PNG": (
        "load_depth",
        "depth/00001.png",
        lambda file: file.write_bytes(file.read_bytes()[:-60]),
        "image {file} is truncated: copy the file again",
    ),
    "vanished": (
        "load_rgb",
        "images/00001.png",
        lambda file: file.unlink(),
        "cannot read {file}: No such file or directory",
    ),
    "colour of another size": (
        "load_rgb",
        "images/00001.png",
        lambda file: write_image(file, np.zeros((20, 32, 3), np.uint8)),
        "colour image {file} is 32 x 20, but its intrinsics are for 32 x 24: "
        "the intrinsics must belong to the stored images",
    ),
    "depth of another shape": (
        "load_depth",
        "depth/00001.png",
        lambda file: write_image(file, np.zeros((20, 32), np.uint16)),
        "depth image {file} is 32 x 20, but the colour image is 32 x 24: "
        "register the depth to the colour image",
    ),
    "depth of 8 bit": (
        "load_depth",
        "depth/00001.png",
        lambda file: write_image(file, np.zeros((24, 32), np.uint8)),
        "depth image {file} has 1 channel(s) of 8 bit: depth is stored as 16-bit single-channel PNG",
    ),
    "depth in colour": (
        "load_depth",
        "depth/00001.png",
        lambda file: write_image(file, np.zeros((24, 32, 3), np.uint16)),
        "depth image {file} has 3 channel(s) of 16 bit: depth is stored as 16-bit single-channel PNG",
    ),
}


@pytest.mark.parametrize("case", UNREADABLE)
def test_image_is_named_when_it_is_asked_for(tmp_path: Path, case: str) -> None:
    loader, name, spoil, message = UNREADABLE[case]
    write_nerfstudio(tmp_path, recording(3))
    session = open_session(tmp_path)
    spoil(tmp_path / name)

    with pytest.raises(InputError) as caught:
        getattr(session.frames[1], loader)()
    assert str(caught.value) == message.format(file=tmp_path / name)


def test_truncated_jpeg_is_not_filled_with_grey(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(3))
    smooth = np.add.outer(np.arange(24), np.arange(32)).astype(np.uint8)
    jpeg = cv2.imencode(".jpg", np.stack([smooth] * 3, -1))[1].tobytes()
    file = tmp_path / "images/00001.jpg"
    file.write_bytes(jpeg[: len(jpeg) - 40])
    document["frames"][1]["file_path"] = "images/00001.jpg"
    save_transforms(tmp_path, document)

    with pytest.raises(InputError) as caught:
        open_session(tmp_path).frames[1].load_rgb()
    assert str(caught.value) == f"image {file} is truncated: copy the file again"


def test_all_images_unreadable(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, recording(8))
    for file in (tmp_path / "images").iterdir():
        file.write_bytes(b"garbage")

    with pytest.raises(InputError) as caught:
        open_session(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path}/images/00004.png is not an image that can be decoded: copy the file again"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            b'{\n "w": 640,\n "h" 480}',
            "is not valid JSON: Expecting ':' delimiter in line 3, column 6: export the archive again",
        ),
        (b"", "is not valid JSON: Expecting value in line 1, column 1: export the archive again"),
        (b'{"w": "\xff"}', "is not text in UTF-8: export the archive again"),
        (b"[]", "does not hold a JSON object: export the archive again"),
    ],
)
def test_broken_json(tmp_path: Path, text: bytes, message: str) -> None:
    (tmp_path / "transforms.json").write_bytes(text)

    with pytest.raises(InputError) as caught:
        open_session(tmp_path)
    assert str(caught.value) == f"{tmp_path}/transforms.json {message}"


def test_nothing_there(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        open_session(tmp_path / "visit")
    assert str(caught.value) == f"there is no archive {tmp_path}/visit: name a folder, .zip, .tar or .tar.gz"


def test_path_that_no_file_can_have() -> None:
    with pytest.raises(InputError) as caught:
        open_session("x" * 300)
    assert str(caught.value) == f"cannot open {'x' * 300}: File name too long"


def test_null_means_not_stated(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(2))
    document.update(session=None, k1=None, depth_unit_scale_factor=None, ply_file_path=None)
    save_transforms(tmp_path, document)

    session = open_session(tmp_path)

    assert (len(session.frames), session.warnings) == (2, ())


def test_nothing_known_inside(tmp_path: Path) -> None:
    (tmp_path / "holiday.jpg").write_bytes(b"")

    with pytest.raises(InputError) as caught:
        open_session(tmp_path)
    assert str(caught.value) == (
        f"{tmp_path} holds no recording of a known format: looked for transforms.json (nerfstudio); "
        "rgb.txt, depth.txt and groundtruth.txt (tum); "
        "_info.txt, sequence/_info.txt or sequence.zip (3rscan); frame-*.color.png (7scenes)"
    )


@pytest.mark.parametrize(
    ("block", "message"),
    [
        (
            {"depth_source": "radar"},
            "depth_source 'radar' is unknown and read as 'sensor': choose one of sensor, lidar, learned",
        ),
        ({"captured_at": 20260301}, "captured_at 20260301 is ignored: it is not an ISO 8601 date"),
        ({"captured_at": "last week"}, "captured_at 'last week' is ignored: it is not an ISO 8601 date"),
        (["first"], "'session' in transforms.json is ignored: it is not an object"),
    ],
)
def test_odd_words_about_the_visit_are_dropped(tmp_path: Path, block: object, message: str) -> None:
    write_nerfstudio(tmp_path, recording(2), session=block)

    session = open_session(tmp_path)

    assert session.warnings == (f"{tmp_path}: {message}",)
    assert (session.depth_source, session.captured_at) == ("sensor", None)


def test_missing_point_cloud_is_a_warning(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, recording(2), ply_file_path="sparse.ply")

    assert open_session(tmp_path).warnings == (f"{tmp_path}: point cloud sparse.ply is missing and ignored",)


def test_numbers_too_large_for_floats_are_not_finite(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(2))
    (tmp_path / "transforms.json").write_text(json.dumps(document).replace('"fl_x": 30.0', '"fl_x": 1e999'))

    with pytest.raises(InputError, match="'fl_x' is inf: a finite number is expected"):
        open_session(tmp_path)
