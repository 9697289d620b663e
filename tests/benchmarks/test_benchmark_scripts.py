from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.camera import is_rigid, rotation_angle_rad
from pipeline.errors import InputError

SCRIPTS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(autouse=True)
def _scripts_can_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(SCRIPTS)


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    folder = tmp_path / "s1"
    for name in ("images", "depth"):
        (folder / name).mkdir(parents=True)
    frames = []
    for k in range(5):
        pose = np.eye(4)
        pose[:3, 3] = [k, 10, 2]
        frames.append({"file_path": f"images/{k}.jpg", "transform_matrix": pose.tolist()})
    (folder / "transforms.json").write_text(json.dumps({"fl_x": 500, "frames": frames}))
    return folder


def poses(folder: Path) -> np.ndarray:
    frames = json.loads((folder / "transforms.json").read_text())["frames"]
    return np.array([frame["transform_matrix"] for frame in frames])


def test_an_offset_moves_the_whole_visit_by_these_amounts(archive: Path, tmp_path: Path) -> None:
    from pose_noise import disturb

    T = disturb(archive, tmp_path / "wrong", "offset", 0.02, np.radians(1), np.random.default_rng(0))
    right, wrong = poses(archive), poses(tmp_path / "wrong")
    np.testing.assert_allclose(wrong, T @ right)
    assert np.degrees(rotation_angle_rad(right[0, :3, :3], wrong[0, :3, :3])) == pytest.approx(1)
    middle = right[:, :3, 3].mean(axis=0)
    assert np.linalg.norm(T[:3, :3] @ middle + T[:3, 3] - middle) == pytest.approx(0.02)
    assert (tmp_path / "wrong" / "images").resolve() == archive / "images"


def test_jitter_moves_every_frame_on_its_own(archive: Path, tmp_path: Path) -> None:
    from pose_noise import disturb

    T = disturb(archive, tmp_path / "wrong", "jitter", 0.02, np.radians(1), np.random.default_rng(0))
    np.testing.assert_array_equal(T, np.eye(4))
    errors = np.linalg.inv(poses(archive)) @ poses(tmp_path / "wrong")
    assert all(is_rigid(error) for error in errors)
    np.testing.assert_allclose(np.linalg.norm(errors[:, :3, 3], axis=1), 0.02)
    assert len(np.unique(errors[:, 0, 3].round(6))) == 5
    disturb(archive, tmp_path / "again", "jitter", 0.02, np.radians(1), np.random.default_rng(0))
    np.testing.assert_array_equal(poses(tmp_path / "again"), poses(tmp_path / "wrong"))


def test_what_is_left_of_an_offset_is_told_at_the_middle_of_the_path(archive: Path, tmp_path: Path) -> None:
    from pose_noise import disturb, left_over

    T = disturb(archive, tmp_path / "wrong", "offset", 0.02, np.radians(1), np.random.default_rng(0))
    uncorrected = left_over({"quality": {"registration": {}}}, T, tmp_path / "wrong")
    assert uncorrected == pytest.approx((20, 1))
    undone = {"quality": {"registration": {"T_previous_current": np.linalg.inv(T).tolist()}}}
    assert left_over(undone, T, tmp_path / "wrong") == pytest.approx((0, 0), abs=1e-5)


def test_settings_are_named_in_full() -> None:
    from scene_pairs import settings_with

    assert settings_with(["change.rule=paper"]).change.rule == "paper"
    with pytest.raises(InputError, match="names no value"):
        settings_with(["change.rule"])


def test_figures_are_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from plot_methods import draw

    row = {"mean": {"change F1": 0.5}, "worst": {"change F1": None}}
    bins = [{"mean_confidence": 0.9, "accuracy": 0.8}]
    measured = {
        "means": {"oasis": {"office": row, "all": row}},
        "calibration": {"oasis": {"bins": bins, "ece": None}},
        "abstention": {"oasis": {"curve": [{"coverage": 1.0, "precision": 0.8}]}},
    }
    paths = draw(measured, tmp_path / "figures")
    assert [path.name for path in paths] == ["change_f1.png", "confidence.png"]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in paths)
