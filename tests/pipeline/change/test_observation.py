"""What counts as seen, seen through and occluded; coverage of objects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fixture_geometry import SMALL_CAMERA, map_in_memory, memory_session, plane_depth, pose
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_matrix

from pipeline.change.appearance import AppearanceResidual
from pipeline.change.evidence import ObjectEvidence, object_evidence
from pipeline.change.observation import DepthWindow, Glimpse, Observation, glimpse
from pipeline.change.observe import observe
from pipeline.change.prints import PrintSupport
from pipeline.correspondence.pattern import PatternAgreement
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.surface import FusedSurface
from pipeline.settings import ObservationSettings, Settings

CAMERA = SMALL_CAMERA
SETTINGS = ObservationSettings()
VOXEL_M = 0.02


def voxels_at(*depths_m: float, normal: tuple[float, float, float] = (0, 0, -1)) -> FusedSurface:
    """Voxels on the optical axis of a camera at the origin that looks along z."""
    points = np.array([[0, 0, z] for z in depths_m], np.float32)
    count = len(points)
    return FusedSurface(
        voxel_size_m=VOXEL_M,
        points_world=points,
        normals_world=np.tile(np.array(normal, np.float32), (count, 1)),
        lab=np.zeros((count, 3), np.float32),
        sample_count=np.ones(count, np.int32),
        neighbours=csr_matrix((count, count)),
        up_world=np.array([0.0, 0, 1]),
        camera_positions_world=np.zeros((1, 3)),
    )


def look(surface: FusedSurface, depth: np.ndarray, gain: float = 0.0) -> Glimpse:
    rgb = np.full((*depth.shape, 3), 100, np.uint8)
    return glimpse(
        surface,
        np.arange(len(surface.points_world)),
        DepthWindow.of(depth.astype(np.float32)),
        rgb,
        np.full(3, gain),
        CAMERA,
        np.eye(4),
        SETTINGS,
    )


def flat(depth_m: float) -> np.ndarray:
    return np.full((CAMERA.height, CAMERA.width), depth_m, np.float32)


def test_seen_seen_through_and_occluded() -> None:
    # A surface at 2 m: a voxel at 1 m was seen through, one at 2 m was hit, one at 3 m is hidden behind it.
    seen = look(voxels_at(1.0, 2.0, 3.0), flat(2.0))

    assert seen.voxels.tolist() == [0, 1]
    assert seen.is_free.tolist() == [True, False]


def test_tolerance_of_the_hit_grows_with_the_voxel() -> None:
    # At least 35 mm and 6 mm per metre: 0.047 m at 2 m.
    seen = look(voxels_at(1.94, 1.96, 2.04, 2.06), flat(2.0))

    assert dict(zip(seen.voxels.tolist(), seen.is_free.tolist(), strict=True)) == {
        0: True,
        1: False,
        2: False,
    }


def test_pixels_without_depth_observe_nothing() -> None:
    assert len(look(voxels_at(1.0, 2.0), flat(0.0)).voxels) == 0


def test_nothing_is_seen_through_beside_a_hole_in_the_depth() -> None:
    # The missing pixel next to it may be the rim of something nearer.
    depth = flat(3.0)
    depth[CAMERA.height // 2, CAMERA.width // 2 + 1] = 0

    assert len(look(voxels_at(1.0), depth).voxels) == 0
    assert look(voxels_at(3.0), depth).is_free.tolist() == [False]


def test_voxels_behind_the_camera_too_near_or_outside_are_not_judged() -> None:
    surface = voxels_at(-1.0, 0.1, 2.0)
    surface.points_world[2] = [5.0, 0, 2.0]

    assert len(look(surface, flat(3.0)).voxels) == 0


def test_colours_are_read_off_hit_surfaces_that_face_the_camera_exposure_taken_out() -> None:
    facing = look(voxels_at(1.0, 2.0), flat(2.0), gain=0.25)
    away = look(voxels_at(2.0, normal=(0, 0, 1)), flat(2.0))

    assert facing.colour_voxels.tolist() == [1]
    assert facing.log_colours[0] == pytest.approx(np.log(100) - 0.25, abs=1e-5)
    assert len(away.colour_voxels) == 0


@given(st.floats(0.3, 8), st.floats(0.3, 8))
def test_a_voxel_is_free_only_before_and_never_observed_behind_the_surface(
    z: float, surface_m: float
) -> None:
    seen = look(voxels_at(z), flat(surface_m))
    tolerance = max(SETTINGS.tolerance_voxels * VOXEL_M, SETTINGS.tolerance_m) + 0.006 * z

    if z < surface_m - tolerance - 1e-4:
        assert seen.is_free.tolist() == [True]
    elif z > surface_m + tolerance + 1e-4:
        assert len(seen.voxels) == 0
    elif abs(z - surface_m) < tolerance - 1e-4:
        assert seen.is_free.tolist() == [False]


def test_one_stray_pixel_does_not_empty_a_voxel_that_others_hit() -> None:
    observation = Observation(5)
    for free, hit, voxel in ((1, 0, 0), (1, 1, 1), (2, 1, 2), (3, 2, 3), (0, 4, 4)):
        observation.free_count[voxel], observation.hit_count[voxel] = free, hit

    # 60 % is the least: 2 of 3 is more, 3 of 5 is not.
    assert observation.is_seen_through(SETTINGS).tolist() == [True, False, True, False, False]
    assert observation.is_observed.all()


def test_observations_replay_from_their_sparse_parts() -> None:
    rng = np.random.default_rng(0)
    whole, replayed = Observation(40), Observation(40)
    for _ in range(4):
        part = Observation(40)
        voxels = rng.choice(40, 12, replace=False).astype(np.int32)
        colour_voxels = voxels[:5]
        seen = Glimpse(
            voxels, rng.random(12) < 0.5, colour_voxels, rng.normal(size=(5, 3)).astype(np.float32)
        )
        part.add(seen)
        whole.add(seen)
        replayed.add_sparse(part.to_sparse())

    assert (whole.free_count == replayed.free_count).all()
    assert (whole.hit_count == replayed.hit_count).all()
    assert (whole.has_colour == replayed.has_colour).all()
    assert whole.log_colours == pytest.approx(replayed.log_colours, abs=1e-6)


def evidence(
    instances: list[int],
    observed: list[bool],
    through: list[bool],
    met: list[bool] | None = None,
    pattern: PatternAgreement | None = None,
) -> ObjectEvidence:
    count = len(instances)
    residual = AppearanceResidual(np.zeros(count, bool), np.zeros((count, 3), np.float32), 0.03, np.zeros(3))
    points = np.stack([np.arange(count), np.zeros(count), np.zeros(count)], axis=1).astype(np.float32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (count, 1))
    return object_evidence(
        np.array(instances, np.int32),
        max(instances),
        np.ones(count, bool) if met is None else np.array(met),
        np.array(observed),
        np.array(through),
        residual,
        np.zeros((count, 3), np.float32),
        normals,
        points,
        np.full(max(instances) + 1, np.nan),
        PatternAgreement.empty(max(instances)) if pattern is None else pattern,
        PrintSupport(np.zeros(max(instances) + 1), np.arange(max(instances) + 1.0)),
    )


def test_coverage_is_the_observed_fraction_and_seen_through_a_share_of_that() -> None:
    # Object 1: four voxels; two hit, one seen through, one occluded. Object 2: nobody looked.
    found = evidence([1, 1, 1, 1, 2, 0], [1, 1, 1, 0, 0, 1], [0, 0, 1, 0, 0, 0])

    assert found.coverage[1:].tolist() == [0.75, 0.0]
    assert found.seen_through[1:] == pytest.approx([1 / 3, 0.0])
    assert found.voxel_count.tolist() == [1, 4, 1]
    assert found.centroid_world[1].tolist() == [1.5, 0, 0]


def test_evidence_counts_only_what_was_met_so_far() -> None:
    found = evidence([1, 1, 1, 1], [1, 1, 0, 0], [0, 0, 0, 0], met=[True, False, True, False])

    assert found.voxel_count[1] == 2
    assert found.coverage[1] == 0.5
    assert found.centroid_world[1].tolist() == [1.0, 0, 0]


def test_evidence_keeps_the_pattern_of_its_moment_while_the_sums_go_on_growing() -> None:
    pattern = PatternAgreement(np.array([0.0, 4.0]), np.array([0.0, 3.0]))
    found = evidence([1, 1], [1, 1], [0, 0], pattern=pattern)
    pattern.add(pattern)

    assert (found.pattern_pixels[1], found.pattern_correlation[1]) == (4, 0.75)
    assert np.isnan(found.pattern_correlation[0])


def _wall_visit(folder: Path, y_m: float, xs: list[float]) -> SessionGeometry:
    poses = [pose((x, 0, 1), (0, 1, 0)) for x in xs]
    camera = CAMERA.resized(128, 96)
    depths = [plane_depth(camera, T, (0, 1, 0), y_m) for T in poses]
    settings = Settings().override("keyframes.submap_size", 2)
    return map_in_memory(memory_session(camera, poses, depths), folder, settings, 0.05)


def test_visits_observe_each_other_and_remember_what_each_submap_saw(tmp_path: Path) -> None:
    # A screen at 2 m in the current visit hides the previous wall at 3 m, and was not there before.
    previous = _wall_visit(tmp_path / "a", 3.0, [0, 0.2, 0.4])
    current = _wall_visit(tmp_path / "b", 2.0, [0, 0.2, 3.0])

    mutual = observe(previous, current, Settings(), lambda done: None)

    assert mutual.of_current.is_seen_through(SETTINGS).mean() > 0.4  # the part around x = 0
    assert mutual.of_previous.is_observed.mean() < 0.05  # occluded is not observed
    assert len(mutual.by_submap) == current.submap_count == 2
    assert len(mutual.by_submap[1]["voxels"]) <= len(mutual.by_submap[0]["voxels"])


def test_unchanged_visits_hit_nearly_everything_and_see_through_nothing(
    hall: tuple[SessionGeometry, SessionGeometry],
) -> None:
    previous, _ = hall

    mutual = observe(previous, previous, Settings(), lambda done: None)

    assert mutual.of_current.is_observed.mean() > 0.97
    assert mutual.of_current.is_seen_through(SETTINGS).mean() < 0.01
    total = Observation(len(previous.surface.points_world))
    for part in mutual.by_submap:
        total.add_sparse(part)
    assert (total.hit_count == mutual.of_previous.hit_count).all()
