import hashlib
import json
from pathlib import Path

import cv2
import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from pipeline.camera import T_OPENGL_OPENCV, PinholeCamera, transform_points
from pipeline.errors import InputError, OasisError, StorageError
from pipeline.ply import NOT_SCORED, read_ply
from pipeline.progress import ProgressEvent
from pipeline.result import ChangeLabel
from pipeline.synthetic import HELD_OUT_SCENES, SCENES, build_scene, generate

SMALL = (160, 120)
FRAMES = 8


def digest(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.fixture(scope="module", params=SCENES + HELD_OUT_SCENES)
def made(request, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("synthetic") / request.param
    generate(request.param, out, 5, FRAMES, size=SMALL)
    return out


def test_the_archives_hold_what_the_contract_says(made):
    for visit in (0, 1):
        folder = made / f"s{visit}"
        index = json.loads((folder / "transforms.json").read_text())
        assert {"fl_x", "fl_y", "cx", "cy", "w", "h", "frames", "session"} <= index.keys()
        assert (index["w"], index["h"], index["depth_unit_scale_factor"]) == (*SMALL, 0.001)
        assert index["session"]["captured_at"] and index["session"]["depth_source"] == "sensor"
        assert len(index["frames"]) == FRAMES
        for frame in index["frames"]:
            image = cv2.imread(str(folder / frame["file_path"]))
            depth = cv2.imread(str(folder / frame["depth_file_path"]), cv2.IMREAD_UNCHANGED)
            assert image.shape == (SMALL[1], SMALL[0], 3) and depth.shape == SMALL[::-1]
            assert depth.dtype == np.uint16
            assert image.std() > 15
            # Under open sky much of a picture has no depth.
            assert 0.2 < (depth > 0).mean() < 1.0
    first, second = (json.loads((made / f"s{v}/transforms.json").read_text())["session"] for v in (0, 1))
    assert first["captured_at"] < second["captured_at"]


def test_depth_and_poses_fall_on_the_ground_truth(made):
    truth = read_ply(made / "gt.ply")
    for visit in (0, 1):
        folder = made / f"s{visit}"
        index = json.loads((folder / "transforms.json").read_text())
        camera = PinholeCamera(*SMALL, index["fl_x"], index["fl_y"], index["cx"], index["cy"])
        tree = cKDTree(truth.points_world[truth.session == visit])
        gaps, depths = [], []
        for frame in index["frames"]:
            depth = cv2.imread(str(folder / frame["depth_file_path"]), cv2.IMREAD_UNCHANGED) / np.float32(
                1000
            )
            T_world_camera = np.array(frame["transform_matrix"]) @ T_OPENGL_OPENCV
            points = transform_points(T_world_camera, camera.backproject(depth)[depth > 0])
            gaps.append(tree.query(points[::7])[0])
            depths.append(depth[depth > 0][::7])
        # Points of truth lie as far apart as every second pixel of these small pictures.
        spacing = 2 * np.median(np.concatenate(depths)) / camera.fx
        assert np.median(np.concatenate(gaps)) < spacing + 0.03


def test_labels_and_identities_are_consistent(made):
    truth = read_ply(made / "gt.ply")
    scene = json.loads((made / "scene.json").read_text())
    assert set(truth.label) <= {1, 2, 3, 4, NOT_SCORED}
    assert not (truth.session[truth.label == ChangeLabel.APPEARED] == 0).any()
    assert not (truth.session[truth.label == ChangeLabel.DISAPPEARED] == 1).any()
    assert set(truth.label[truth.object_id == 0]) <= {1, NOT_SCORED}
    assert (truth.confidence == 1).all()
    moved = set(truth.object_id[truth.label == ChangeLabel.MOVED])
    for number in moved:
        assert set(truth.session[truth.object_id == number]) == {0, 1}
    by_id = {thing["object_id"]: thing for thing in scene["objects"]}
    assert sorted(by_id) == list(range(1, len(by_id) + 1))
    assert moved <= {number for number, thing in by_id.items() if thing["fate"] == "moved"}
    for number in set(truth.object_id) - {0}:
        thing, mine = by_id[number], truth.object_id == number
        for visit in (0, 1):
            if thing["T_world_object"][visit] is None:
                assert not (mine & (truth.session == visit)).any()
        for code in set(truth.label[mine & (truth.label != NOT_SCORED)]):
            name = ChangeLabel(code).name.lower()
            allowed = {"replaced": {"disappeared"}, "moved": {"moved", "appeared", "disappeared"}}
            assert name in allowed.get(thing["fate"], {thing["fate"]})


def test_true_motions_carry_the_points_of_one_visit_onto_the_object_in_the_other(made):
    truth = read_ply(made / "gt.ply")
    answer = json.loads((made / "gt.json").read_text())
    assert answer["schema_version"] == 1
    moved = set(truth.object_id[truth.label == ChangeLabel.MOVED].tolist())
    static = set(truth.object_id[truth.label == ChangeLabel.STATIC].tolist())
    known = {motion["object_id"] for motion in answer["motions"]}
    assert moved <= known <= moved | static
    drawn = build_scene(made.name, 5, FRAMES, SMALL)
    for motion in answer["motions"]:
        thing = drawn.objects[motion["object_id"] - 1]
        assert thing.is_moved == (thing.object_id in moved)
        assert thing.is_moved or thing.story == "jolted"
        T = np.array(motion["T_world_motion"])
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-6)
        mine = truth.object_id == thing.object_id
        before = transform_points(T, truth.points_world[mine & (truth.session == 0)])
        surface = o3d.t.geometry.RaycastingScene()
        corners = thing.mesh.placed(thing.poses[1]).corners.reshape(-1, 3)
        triangles = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
        surface.add_triangles(o3d.core.Tensor(np.ascontiguousarray(corners)), o3d.core.Tensor(triangles))
        gap = surface.compute_distance(o3d.core.Tensor(before.astype(np.float32))).numpy()
        assert gap.max() < 0.004
        assert motion["symmetry_order"] >= 0


def test_what_one_visit_never_looked_at_is_not_scored(made):
    truth = read_ply(made / "gt.ply")
    for visit in (0, 1):
        share = (truth.label[truth.session == visit] == NOT_SCORED).mean()
        assert 0 < share < 0.6


def test_points_of_an_object_lie_on_it_in_each_visit(made):
    truth = read_ply(made / "gt.ply")
    for thing in json.loads((made / "scene.json").read_text())["objects"]:
        reach = np.linalg.norm(thing["extent_m"])
        for visit in (0, 1):
            mine = truth.points_world[(truth.object_id == thing["object_id"]) & (truth.session == visit)]
            if len(mine):
                centre = np.array(thing["T_world_object"][visit])[:3, 3]
                assert np.linalg.norm(mine - centre, axis=1).max() <= reach + 1e-3


def test_a_replacement_stands_where_the_old_thing_stood(made):
    by_id = {t["object_id"]: t for t in json.loads((made / "scene.json").read_text())["objects"]}
    pairs = [(t, by_id[t["replaced_by"]]) for t in by_id.values() if t["replaced_by"]]
    assert pairs
    for old, new in pairs:
        assert (old["fate"], new["fate"]) == ("replaced", "appeared")
        shift = np.subtract(old["T_world_object"][0], new["T_world_object"][1])[:3, 3]
        assert np.linalg.norm(shift) < 0.35 * max(old["extent_m"])
        if old["story"] != "different":
            assert old["class"] == new["class"]
            np.testing.assert_allclose(old["extent_m"], new["extent_m"], rtol=0.8, atol=0.2)


def test_every_kind_of_change_happens(made):
    fates = json.loads((made / "scene.json").read_text())["fates"]
    assert set(fates) == {"static", "appeared", "disappeared", "moved", "replaced"}


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_scene(tmp_path):
    generate("office", tmp_path / "a", 1, 2, size=SMALL)
    generate("office", tmp_path / "c", 2, 2, size=SMALL)
    generate("office", tmp_path / "b", 1, 2, size=SMALL)
    a, b, c = (digest(tmp_path / name) for name in "abc")
    assert a == b
    assert a.keys() == c.keys()
    assert all(a[name] != c[name] for name in a)
    scenes = [json.loads((tmp_path / name / "scene.json").read_text()) for name in "ac"]
    assert scenes[0]["object_count"] != scenes[1]["object_count"]
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a", "b", "c"]


def test_the_number_of_workers_does_not_change_a_byte(tmp_path):
    for workers in (1, 3):
        generate("carpark", tmp_path / str(workers), 4, 4, size=(320, 240), workers=workers)
    assert digest(tmp_path / "1") == digest(tmp_path / "3")


def test_a_failing_keyframe_fails_the_run_and_leaves_nothing(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pipeline.synthetic.generation.ArchiveWriter.add", full)
    with pytest.raises(StorageError, match="No space left"):
        generate("office", tmp_path / "out", 0, 4, size=(64, 48), workers=2)
    assert list(tmp_path.iterdir()) == []


def test_progress_counts_every_keyframe(tmp_path):
    events = []
    generate("office", tmp_path / "out", 0, 2, events.append, size=(64, 48))
    assert all(isinstance(event, ProgressEvent) for event in events)
    assert [(event.done, event.total) for event in events] == [(i, 4) for i in (1, 2, 3, 4)]


def test_what_cannot_be_done_is_said_in_one_line(tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "precious.txt").write_text("keep me")
    (tmp_path / "file").write_text("a file")
    calls = [
        ("desert", tmp_path / "x", 0, 4, "no scene 'desert'.*office"),
        ("office", tmp_path / "x", 0, 1, "1 frames are too few"),
        ("office", tmp_path / "x", -1, 4, "-1 is not a seed"),
        ("office", tmp_path / "full", 0, 4, "not an empty folder"),
        ("office", tmp_path / "file", 0, 4, "not an empty folder"),
        ("office", tmp_path / "file" / "below", 0, 4, "cannot write"),
    ]
    for scene, out, seed, frames, message in calls:
        with pytest.raises(OasisError, match=message) as caught:
            generate(scene, out, seed, frames, size=(64, 48))
        assert "\n" not in str(caught.value)
        assert isinstance(caught.value, InputError)
    assert (tmp_path / "full" / "precious.txt").read_text() == "keep me"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["file", "full"]


def test_an_interrupted_run_leaves_nothing(tmp_path):
    def stop(event):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate("office", tmp_path / "out", 0, 2, stop, size=(64, 48))
    assert list(tmp_path.iterdir()) == []
