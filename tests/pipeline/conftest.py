"""Two small mapped visits of the painted hall, for tests that need surfaces, submaps and stores."""

from __future__ import annotations

import hypothesis
import pytest

from pipeline.mapping.front_end import SessionGeometry
from pipeline.settings import Settings

# Deadlines would fail tests on a busy machine; the same examples every time keep failures repeatable.
hypothesis.settings.register_profile("engine", deadline=None, derandomize=True, max_examples=60)
hypothesis.settings.load_profile("engine")

HALL_VOXEL_M = 0.04


@pytest.fixture(scope="session")
def hall(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionGeometry, SessionGeometry]:
    """Both visits of ``fixture_scene`` mapped with submaps of 2 keyframes; read-only."""
    from fixture_geometry import map_in_memory, memory_session
    from fixture_scene import CAMERA, camera_pose, render

    settings = Settings().override("keyframes.submap_size", 2)
    mapped = []
    for visit in (0, 1):
        poses = [camera_pose(visit, k) for k in range(6)]
        views = [render(visit, pose) for pose in poses]
        session = memory_session(CAMERA, poses, [v.depth_m for v in views], [v.rgb for v in views])
        folder = tmp_path_factory.mktemp(f"hall-{visit}")
        mapped.append(map_in_memory(session, folder, settings, HALL_VOXEL_M))
    return mapped[0], mapped[1]
