"""The painted hall as archives, and the finished result of each baseline on it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from fixture_scene import CAMERA, camera_pose, render

from pipeline.result import Result
from pipeline.settings import Settings
from pipeline.synthetic.archive import ArchiveWriter
from pipeline.system import run

KEYFRAMES = 6
# Six keyframes see most things twice; published values are for video.
HALL = Settings().override("keyframes.submap_size", 2).override("baseline.min_detections", 2)


@pytest.fixture(scope="session")
def hall_archives(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folders = []
    for visit in (0, 1):
        folder = tmp_path_factory.mktemp(f"hall-archive-{visit}")
        archive = ArchiveWriter(folder, CAMERA, f"hall {visit}", f"2026-02-0{visit + 1}T10:00:00Z")
        for k in range(KEYFRAMES):
            T_world_camera = camera_pose(visit, k)
            view = render(visit, T_world_camera)
            archive.add(k, view.rgb, view.depth_m, T_world_camera, k * 0.5)
        archive.close()
        folders.append(folder)
    return folders[0], folders[1]


@pytest.fixture(scope="session")
def result_of(
    hall_archives: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Result]:
    """The hall as a method sees it; run once."""

    @cache
    def of(method: str) -> Result:
        output = tmp_path_factory.mktemp(method) / "hall.oasis"
        return run(*hall_archives, settings=HALL.override("run.method", method), output=output)

    return of
