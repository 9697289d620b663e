"""Where a recording stands on Earth reaches the result's description."""

from __future__ import annotations

import json
from pathlib import Path

from fixture_scene import CAMERA, camera_pose, render

from pipeline.settings import Settings
from pipeline.synthetic.archive import ArchiveWriter
from pipeline.system import run

ORIGIN = {"latitude_deg": 48.1, "longitude_deg": 11.5, "altitude_m": 520.0, "y_axis_azimuth_deg": 12.0}


def record(folder: Path, visit: int) -> Path:
    archive = ArchiveWriter(folder, CAMERA, f"hall {visit}", f"2026-02-0{visit + 1}T10:00:00Z")
    for k in range(2):
        view = render(visit, camera_pose(visit, k))
        archive.add(k, view.rgb, view.depth_m, camera_pose(visit, k), k * 0.5)
    archive.close()
    return folder


def test_origin_of_one_visit_stands_in_the_manifest(tmp_path: Path) -> None:
    visits = [record(tmp_path / f"s{visit}", visit) for visit in (0, 1)]
    transforms = visits[0] / "transforms.json"
    document = json.loads(transforms.read_text())
    document["session"]["origin"] = ORIGIN
    transforms.write_text(json.dumps(document))
    settings = Settings().override("surface.voxel_size_m", 0.06)
    result = run(*visits, settings=settings, output=tmp_path / "hall.oasis")
    assert result.manifest["inputs"][0]["origin"] == ORIGIN
    assert "origin" not in result.manifest["inputs"][1]
