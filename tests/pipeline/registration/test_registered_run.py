"""A whole run over visits whose poses do not fit: the result is in the previous visit's world."""

from __future__ import annotations

import filecmp
import json
from pathlib import Path

import numpy as np
import pytest
from fixture_scene import CAMERA, camera_pose, render
from fixture_shapes import motion

import pipeline.system as run_module
from pipeline.camera import rotation_angle_rad
from pipeline.settings import Settings
from pipeline.synthetic.archive import ArchiveWriter
from pipeline.system import run

SETTINGS = Settings().override("keyframes.submap_size", 2)
KEYFRAMES = 6
T_WRONG_RIGHT = motion((0.015, -0.01, 0.01), (0.5, -0.5, 0.7))


def record(folder: Path, visit: int, T_wrong_right: np.ndarray) -> Path:
    archive = ArchiveWriter(folder, CAMERA, f"hall {visit}", f"2026-02-0{visit + 1}T10:00:00Z")
    for k in range(KEYFRAMES):
        T_world_camera = camera_pose(visit, k)
        view = render(visit, T_world_camera)
        archive.add(k, view.rgb, view.depth_m, T_wrong_right @ T_world_camera, k * 0.5)
    archive.close()
    return folder


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("archives")
    return record(folder / "s0", 0, np.eye(4)), record(folder / "s1", 1, T_WRONG_RIGHT)


def files_of(folder: Path) -> list[Path]:
    return sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())


def test_result_is_in_the_previous_visits_world_and_survives_an_interruption(
    archives: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = run(*archives, settings=SETTINGS, output=tmp_path / "whole.oasis")

    registration = result.manifest["quality"]["registration"]
    assert registration["applied"]
    left = np.array(registration["T_previous_current"]) @ T_WRONG_RIGHT
    assert np.linalg.norm(left[:3, 3]) < 0.02
    assert np.degrees(rotation_angle_rad(np.eye(3), left[:3, :3])) < 0.12
    for k, keyframe in enumerate(result.sessions[1].keyframes):
        np.testing.assert_allclose(keyframe.T_world_camera, camera_pose(1, k), atol=0.02)

    def power_cut(*args: object, **kwargs: object) -> None:
        raise KeyboardInterrupt

    output = tmp_path / "resumed.oasis"
    with monkeypatch.context() as patch:
        patch.setattr(run_module, "compare", power_cut)
        with pytest.raises(KeyboardInterrupt):
            run(*archives, settings=SETTINGS, output=output)
    with monkeypatch.context() as patch:
        patch.setattr(run_module, "register", power_cut)  # it is done, and not done again
        resumed = run(*archives, settings=SETTINGS, output=output)

    assert files_of(result.path) == files_of(resumed.path)
    different = [
        path
        for path in files_of(result.path)
        if not filecmp.cmp(result.path / path, resumed.path / path, shallow=False)
    ]
    assert [str(path) for path in different] in ([], ["result.json"])
    manifests = [json.loads((path / "result.json").read_text()) for path in (result.path, resumed.path)]
    assert manifests[0]["quality"] == manifests[1]["quality"]


def test_registration_can_be_switched_off(archives: tuple[Path, Path], tmp_path: Path) -> None:
    result = run(
        *archives, settings=SETTINGS.override("registration.enabled", "off"), output=tmp_path / "off.oasis"
    )

    assert result.manifest["quality"]["registration"] == {}
    for k, keyframe in enumerate(result.sessions[1].keyframes):
        np.testing.assert_allclose(keyframe.T_world_camera, T_WRONG_RIGHT @ camera_pose(1, k), atol=1e-5)
