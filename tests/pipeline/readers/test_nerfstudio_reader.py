import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from archive_writers import Recording, recording, save_transforms, write_nerfstudio

from pipeline.camera import PinholeCamera, is_rigid
from pipeline.readers import open_session


def test_round_trip_of_images_poses_and_what_is_said_about_the_visit(tmp_path: Path) -> None:
    what = recording(4)
    visit = {"name": "first floor", "captured_at": "2026-03-01T10:00:00+00:00", "depth_source": "lidar"}
    write_nerfstudio(tmp_path, what, depth_unit_scale_factor=0.0005, session=visit)

    session = open_session(tmp_path)

    assert (session.name, session.format) == ("first floor", "nerfstudio")
    assert (session.captured_at, session.depth_source) == ("2026-03-01T10:00:00+00:00", "lidar")
    assert session.warnings == ()
    assert session.metadata_files == (tmp_path / "transforms.json",)
    assert [frame.index for frame in session.frames] == [0, 1, 2, 3]
    for k, frame in enumerate(session.frames):
        np.testing.assert_array_equal(frame.load_rgb(), what.colours[k])
        np.testing.assert_allclose(frame.load_depth(), what.depths[k] * 0.0005, rtol=1e-6)
        np.testing.assert_allclose(frame.T_world_camera, what.T_world_cameras[k], atol=1e-12)
        assert frame.load_depth().dtype == np.float32
        assert frame.timestamp_s == pytest.approx(100 + k / 30)
        assert frame.camera == PinholeCamera(32, 24, 30.0, 31.0, 15.5, 11.5)
        assert frame.files == (tmp_path / f"images/{k:05d}.png", tmp_path / f"depth/{k:05d}.png")


def test_what_lies_ahead_of_an_opengl_camera_has_positive_depth_in_ours(tmp_path: Path) -> None:
    # A camera at the origin of an OpenGL world looks along -z with +y up.
    document = write_nerfstudio(tmp_path, recording(2))
    document["frames"][0]["transform_matrix"] = np.eye(4).tolist()
    save_transforms(tmp_path, document)

    T_world_camera = open_session(tmp_path).frames[0].T_world_camera

    ahead_and_up_in_camera = np.linalg.inv(T_world_camera) @ [0.0, 0.5, -2.0, 1.0]
    np.testing.assert_allclose(ahead_and_up_in_camera, [0.0, -0.5, 2.0, 1.0])


def test_images_stay_unread_until_asked_for(tmp_path: Path) -> None:
    what = recording(2, (8, 6))
    document = write_nerfstudio(tmp_path, what)
    first = document["frames"][0]
    frames = [first]
    for k in range(1, 1000):
        (tmp_path / f"images/{k:05d}.png").write_bytes(b"garbage")
        (tmp_path / f"depth/{k:05d}.png").write_bytes(b"garbage")
        paths = {"file_path": f"images/{k:05d}.png", "depth_file_path": f"depth/{k:05d}.png"}
        frames.append({**first, **paths})
    document["frames"] = frames
    save_transforms(tmp_path, document)

    session = open_session(tmp_path)

    assert len(session.frames) == 1000
    assert session.warnings == ()


def test_intrinsics_of_a_frame_override_the_shared_ones(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(3), cx=None)
    for frame, cx in zip(document["frames"], (10.0, 11.0, 12.0), strict=True):
        frame["cx"] = cx
    document["frames"][1]["fl_x"] = 40.0
    save_transforms(tmp_path, document)

    cameras = [frame.camera for frame in open_session(tmp_path).frames]

    assert [(camera.cx, camera.fx) for camera in cameras] == [(10.0, 30.0), (11.0, 40.0), (12.0, 30.0)]
    assert {camera.fy for camera in cameras} == {31.0}


def test_distorted_images_become_those_of_a_pinhole_camera(tmp_path: Path) -> None:
    # Images whose pixels tell the ray that they saw: after undistortion each must tell its pinhole ray.
    width, height = 160, 120
    camera = PinholeCamera(width, height, 130.0, 132.0, 81.0, 58.0)
    lens = {"k1": -0.15, "k2": 0.03, "p1": 0.002, "p2": -0.001, "k3": 0.01}
    seen_x = np.broadcast_to((np.arange(width) - camera.cx) / camera.fx, (height, width))
    seen_y = np.broadcast_to(((np.arange(height) - camera.cy) / camera.fy)[:, None], (height, width))
    x, y = seen_x, seen_y
    for _ in range(50):  # Brown-Conrady inverted by fixed-point iteration
        r2 = x**2 + y**2
        radial = 1 + lens["k1"] * r2 + lens["k2"] * r2**2 + lens["k3"] * r2**3
        shift_x = 2 * lens["p1"] * x * y + lens["p2"] * (r2 + 2 * x**2)
        shift_y = lens["p1"] * (r2 + 2 * y**2) + 2 * lens["p2"] * x * y
        x, y = (seen_x - shift_x) / radial, (seen_y - shift_y) / radial

    def tilted_plane(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return 2000 + 900 * x + 400 * y

    depth = tilted_plane(x, y).round().astype(np.uint16)
    colour = np.clip(np.stack([127 + 200 * x, 127 + 200 * y, 0 * x], -1).round(), 0, 255).astype(np.uint8)
    what = Recording(np.stack([colour] * 2), np.stack([depth] * 2), recording(2).T_world_cameras)
    intrinsics = {"fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    write_nerfstudio(tmp_path, what, **intrinsics, **lens)

    frame = open_session(tmp_path).frames[0]

    inner = (slice(15, -15), slice(15, -15))
    x, y = seen_x, seen_y  # the pinhole camera has the same K
    # Nearest sampling is up to half a pixel off along either axis.
    slack_m = 0.5e-3 * (900 / camera.fx + 400 / camera.fy) * 1.3 + 1e-3
    assert np.abs(frame.load_depth()[inner] - tilted_plane(x, y)[inner] / 1000).max() < slack_m
    assert np.abs(frame.load_rgb()[inner][..., 0] - (127 + 200 * x[inner])).max() < 1.5
    assert frame.camera == camera
    undone = np.abs(depth[inner] / 1000 - tilted_plane(x, y)[inner] / 1000).max()
    assert undone > 2 * slack_m  # the distortion was not too weak to notice


def test_depth_of_the_same_shape_is_resized_by_nearest_with_a_warning(tmp_path: Path) -> None:
    what = recording(2, (32, 24), (16, 12))
    write_nerfstudio(tmp_path, what)

    session = open_session(tmp_path)

    expected = what.depths[0].repeat(2, axis=0).repeat(2, axis=1) * np.float32(0.001)
    np.testing.assert_allclose(session.frames[0].load_depth(), expected)
    assert session.warnings == (
        f"{tmp_path}: depth images are 16 x 12 and are resized (nearest) to the colour images' 32 x 24",
    )


def test_saturated_counts_are_no_measurement(tmp_path: Path) -> None:
    what = recording(2)
    what.depths[0, 3, 4] = 65535
    write_nerfstudio(tmp_path, what)

    depth = open_session(tmp_path).frames[0].load_depth()

    assert depth[3, 4] == 0
    assert depth.max() < 6


def test_rotations_written_with_few_digits_are_made_orthonormal(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(2))
    for frame in document["frames"]:
        frame["transform_matrix"] = np.round(frame["transform_matrix"], 4).tolist()
    save_transforms(tmp_path, document)

    for frame in open_session(tmp_path).frames:
        assert is_rigid(frame.T_world_camera, tolerance=1e-12)


def test_exif_orientation_does_not_turn_the_image(tmp_path: Path) -> None:
    what = recording(2)
    document = write_nerfstudio(tmp_path, what)
    jpeg = cv2.imencode(".jpg", np.ascontiguousarray(what.colours[0]))[1].tobytes()
    # TIFF header, one IFD entry: tag 0x0112 (orientation), SHORT, 1 value, 6 = turn by 90 degrees.
    exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0\x06\0\0\0\0\0\0\0"
    tagged = jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:]
    (tmp_path / "images/turned.jpg").write_bytes(tagged)
    assert cv2.imread(str(tmp_path / "images/turned.jpg")).shape == (32, 24, 3)  # the tag works
    document["frames"][0]["file_path"] = "images/turned.jpg"
    save_transforms(tmp_path, document)

    assert open_session(tmp_path).frames[0].load_rgb().shape == (24, 32, 3)


def test_point_cloud_belongs_to_the_session(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, recording(2), ply_file_path="./sparse.ply")
    (tmp_path / "sparse.ply").write_text("ply\n")

    assert open_session(tmp_path).metadata_files == (tmp_path / "transforms.json", tmp_path / "sparse.ply")


def test_frames_keep_their_number_when_others_are_left_out(tmp_path: Path) -> None:
    what = recording(5)
    document = write_nerfstudio(tmp_path, what)
    document["frames"][1]["transform_matrix"][0][3] = float("nan")
    (tmp_path / "depth/00003.png").unlink()
    save_transforms(tmp_path, document)

    session = open_session(tmp_path)

    assert [frame.index for frame in session.frames] == [0, 2, 4]
    assert session.frames_left_out == 2
    assert session.warnings == (
        f"{tmp_path}: frame images/00001.png is left out: its pose is not finite",
        f"{tmp_path}: frame images/00003.png is left out: depth image depth/00003.png is missing",
    )


def test_many_frames_of_one_fault_do_not_flood_the_reader(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(2))
    document["frames"] += [{**document["frames"][1], "file_path": f"images/x{k}.png"} for k in range(40)]
    save_transforms(tmp_path, document)

    warnings = open_session(tmp_path).warnings

    assert len(warnings) == 11
    assert warnings[-1] == f"{tmp_path}: 30 more frames are left out: its colour image is missing"


def test_duplicated_frames_are_fine(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(2))
    document["frames"] += document["frames"]
    save_transforms(tmp_path, document)

    assert len(open_session(tmp_path).frames) == 4


def test_unreadable_first_image_does_not_cost_the_archive(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path, recording(3))
    (tmp_path / "images/00000.png").write_bytes(b"garbage")

    session = open_session(tmp_path)

    assert [frame.index for frame in session.frames] == [1, 2]
    assert len(session.warnings) == 1


def test_unnamed_visit_is_called_as_its_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_nerfstudio(tmp_path / "ward.3", recording(2))
    monkeypatch.chdir(tmp_path / "ward.3")

    assert open_session(tmp_path / "ward.3").name == "ward.3"
    assert open_session(".").name == "ward.3"


def test_recording_in_the_only_folder_of_the_archive_is_found(tmp_path: Path) -> None:
    write_nerfstudio(tmp_path / "export/visit", recording(2))

    session = open_session(tmp_path)

    assert session.path == tmp_path
    assert session.frames[0].files[0] == tmp_path / "export/visit/images/00000.png"


def test_byte_order_mark_and_dot_slash_paths_are_read(tmp_path: Path) -> None:
    document = write_nerfstudio(tmp_path, recording(2))
    document["frames"][0]["file_path"] = "./images/00000.png"
    (tmp_path / "transforms.json").write_text(json.dumps(document), encoding="utf-8-sig")

    assert len(open_session(tmp_path).frames) == 2


def test_wide_colour_and_depth_of_almost_the_same_shape_are_paired(tmp_path: Path) -> None:
    # 1920 x 1440 colour with 256 x 192 depth is the usual pair of a phone; here at a tenth.
    what = recording(2, (192, 144), (26, 19))
    write_nerfstudio(tmp_path, what, fl_x=150.0, fl_y=150.0)

    assert open_session(tmp_path).frames[0].load_depth().shape == (144, 192)
