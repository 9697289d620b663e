"""Pixel-level comparison of prints: on made-up images, and on a printed wall seen from two places."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fixture_geometry import SMALL_CAMERA, map_in_memory, memory_session, plane_depth, pose
from scipy.ndimage import gaussian_filter, map_coordinates

from pipeline.correspondence.compare import VisitImages
from pipeline.correspondence.pattern import (
    PatternAgreement,
    compare_pattern,
    local_correlation,
    warp_into,
)
from pipeline.correspondence.pattern_comparison import compare_patterns
from pipeline.mapping.colours import log_colour
from pipeline.mapping.front_end import SessionGeometry
from pipeline.mapping.objects import SessionObjects
from pipeline.result import CovisiblePair
from pipeline.settings import PatternSettings, Settings

SETTINGS = PatternSettings()
SHAPE = (80, 100)
EDGE = 12
PLAIN_FROM = 70
ALL = np.ones(SHAPE, bool)


def printed(seed: int, amplitude: float = 0.3) -> np.ndarray:
    """Log colours (h, w, 3) with blotches of a few pixels, wider than the image by EDGE on all sides."""
    rng = np.random.default_rng(seed)
    noise = gaussian_filter(rng.normal(size=(SHAPE[0] + 2 * EDGE, SHAPE[1] + 2 * EDGE, 3)), (1.5, 1.5, 0))
    return (4.5 + amplitude * noise / noise.std()).astype(np.float32)


def view(seed: int, down: int = 0, right: int = 0) -> np.ndarray:
    """(h, w, 3) a print on the left, plain paint on the right, which tells what the noise is."""
    image = printed(seed)[EDGE + down : EDGE + down + SHAPE[0], EDGE + right : EDGE + right + SHAPE[1]].copy()
    image[:, PLAIN_FROM:] = 4.5
    return image


def noise(seed: int, spread: float = 0.01) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, spread, (*SHAPE, 3)).astype(np.float32)


def weighted(own: np.ndarray, other: np.ndarray, shared: np.ndarray = ALL) -> float:
    correlation, weight = local_correlation(own, other, shared, SETTINGS)
    assert ((weight >= 0) & (weight <= 1)).all()
    assert (np.abs(correlation[shared]) <= 1.001).all()
    return float((correlation * weight).sum() / weight.sum())


@pytest.mark.parametrize("shift", [(0, 0), (1, 0), (0, -2), (2, 1), (-2, 2)])
def test_the_same_print_a_pixel_or_two_off_correlates(shift: tuple[int, int]) -> None:
    assert weighted(view(0), view(0, *shift) + noise(1)) > 0.85


def test_the_same_print_further_off_than_the_poses_err_does_not() -> None:
    assert weighted(view(0), view(0, 8, 8)) < 0.6


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_another_print_does_not_correlate(seed: int) -> None:
    assert weighted(view(0), view(seed)) < 0.6


def test_light_and_shading_are_no_pattern() -> None:
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]] / 100.0
    light = (0.4 + 0.5 * row - 0.3 * column**2)[..., None].astype(np.float32) * np.float32([1, 0.8, 0.6])

    assert weighted(view(0), view(0) + light) > 0.9


def test_plain_surfaces_have_no_weight_and_prints_have() -> None:
    _, weight = local_correlation(view(0) + noise(1), view(0) + noise(2), ALL, SETTINGS)

    reach = SETTINGS.window_pixels
    assert weight[:, PLAIN_FROM + reach :].mean() < 0.02
    assert np.median(weight[:, PLAIN_FROM + reach :]) == 0
    assert np.median(weight[reach:-reach, reach : PLAIN_FROM - reach]) == 1


def test_a_print_that_one_visit_lacks_is_lost_not_overlooked() -> None:
    plain = np.full((*SHAPE, 3), 4.5, np.float32)

    for own, other in ((view(0), plain), (plain, view(0))):
        correlation, weight = local_correlation(own + noise(1), other + noise(2), ALL, SETTINGS)
        print_ = (slice(12, -12), slice(12, PLAIN_FROM - 12))
        assert np.median(weight[print_]) == 1
        assert np.median(correlation[print_]) < 0.4


def test_pixels_that_do_not_show_the_same_surface_have_no_say() -> None:
    shared = ALL.copy()
    shared[:, 30:60] = False
    other = view(0).copy()
    other[:, 30:60] = view(9)[:, 30:60]

    _, weight = local_correlation(view(0), other, shared, SETTINGS)

    assert not weight[:, 30:60].any()
    assert weighted(view(0), other, shared) > 0.95


def test_sums_add_up_and_say_nothing_where_nothing_was_compared() -> None:
    total = PatternAgreement.empty(2)
    assert np.isnan(total.mean_correlation).all()

    total.add(PatternAgreement(np.array([0, 4.0, 0]), np.array([0, 3.0, 0])))
    total.add(PatternAgreement(np.array([0, 4.0, 0]), np.array([0, -1.0, 0])))

    assert total.weight.tolist() == [0, 8, 0]
    assert total.mean_correlation[1] == pytest.approx(0.25)
    assert np.isnan(total.mean_correlation[[0, 2]]).all()


# A wall at y = 3 m with a print, painted by position.

CAMERA = SMALL_CAMERA.resized(256, 192)
PAINT = {seed: gaussian_filter(np.random.default_rng(seed).normal(size=(300, 300)), 2.0) for seed in (0, 1)}


def wall(
    folder: Path, xs: list[float], y_camera_m: float = 0.0, y_wall_m: float = 3.0, seed: int = 0
) -> SessionGeometry:
    """A visit that looks along y from the given places; the print has blotches of about 8 cm.

    The wall is printed up to 1.6 m and plain above.
    """
    xs = xs if len(xs) > 1 else [*xs, xs[0] + 0.05]  # a visit has two keyframes at least
    poses = [pose((x, y_camera_m, 1), (0, 1, 0)) for x in xs]
    depths = [plane_depth(CAMERA, T, (0, 1, 0), y_wall_m) for T in poses]
    images = []
    for T, depth in zip(poses, depths, strict=True):
        points = CAMERA.backproject(depth).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
        cells = np.stack([points[:, 2], points[:, 0]]) / 0.02 + 150
        value = map_coordinates(PAINT[seed], cells, order=1, mode="wrap") / PAINT[seed].std()
        value[points[:, 2] > 1.6] = 0
        grey = np.clip(110 + 30 * value, 20, 235).reshape(depth.shape)
        images.append(np.repeat(grey[..., None], 3, axis=2).astype(np.uint8))
    settings = Settings().override("keyframes.submap_size", 2)
    return map_in_memory(memory_session(CAMERA, poses, depths, images), folder, settings, 0.05)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> SessionGeometry:
    return wall(tmp_path_factory.mktemp("first"), [0.0, 0.1])


def test_other_keyframe_is_warped_onto_this_one_by_depth(first: SessionGeometry, tmp_path: Path) -> None:
    other = wall(tmp_path / "other", [0.4])

    warped, is_shared, scale = warp_into(first, 0, other, 0)

    own = log_colour(first.store.rgb(0))
    assert warped.shape == own.shape
    # 0.4 m of a view 3 m * 256 / fx wide are out of view, on the left.
    missing = 0.4 * CAMERA.fx / 3.0 / CAMERA.width
    assert is_shared.mean() == pytest.approx(1 - missing, abs=0.03)
    assert not is_shared[:, 0].any()
    assert is_shared[:, -5:].mean() > 0.9
    assert scale == pytest.approx(1, abs=0.01)
    assert np.abs(warped - own)[is_shared].mean() < 0.03
    assert np.abs(log_colour(other.store.rgb(0)) - own)[is_shared].mean() > 0.2  # unwarped


def test_what_stands_before_the_surface_is_not_shared(first: SessionGeometry, tmp_path: Path) -> None:
    screen = wall(tmp_path / "screen", [0.0], y_wall_m=2.0)

    _, is_shared, scale = warp_into(first, 0, screen, 0)

    assert not is_shared.any()
    assert scale == 1.0


def test_scale_tells_how_much_finer_the_other_keyframe_shows_the_place(
    first: SessionGeometry, tmp_path: Path
) -> None:
    near = wall(tmp_path / "near", [0.0], y_camera_m=1.5)

    assert warp_into(first, 0, near, 0)[2] == pytest.approx(2, rel=0.02)
    assert warp_into(near, 0, first, 0)[2] == pytest.approx(0.5, rel=0.02)
    for own, other in ((first, near), (near, first)):
        found = compare_pattern(own, 0, other, 0, instances_of(own), 2, SETTINGS)
        assert found.mean_correlation[1] > 0.75


def instances_of(geometry: SessionGeometry) -> np.ndarray:
    """1 on the left half of the first keyframe, 2 on the right; nothing in the lowest rows."""
    shape = geometry.store.depth(0).shape
    instances = np.ones(shape, np.int32)
    instances[:, shape[1] // 2 :] = 2
    instances[-10:] = 0
    return instances


def test_print_is_found_again_and_another_print_is_not(first: SessionGeometry, tmp_path: Path) -> None:
    same, another = wall(tmp_path / "same", [0.2]), wall(tmp_path / "another", [0.2], seed=1)
    instances = instances_of(first)

    kept = compare_pattern(first, 0, same, 0, instances, 3, SETTINGS)
    lost = compare_pattern(first, 0, another, 0, instances, 3, SETTINGS)

    assert (kept.weight[1:3] > 300).all()
    assert kept.weight[0] == kept.weight[3] == 0
    assert (kept.mean_correlation[1:3] > 0.85).all()
    assert (lost.mean_correlation[1:3] < 0.5).all()


def test_keyframes_that_share_next_to_nothing_are_not_compared(
    first: SessionGeometry, tmp_path: Path
) -> None:
    aside = wall(tmp_path / "aside", [5.9])

    assert not compare_pattern(first, 0, aside, 0, instances_of(first), 2, SETTINGS).weight.any()


def test_agreement_is_summed_by_the_submaps_of_the_current_visit(
    first: SessionGeometry, tmp_path: Path
) -> None:
    current = wall(tmp_path / "current", [0.0, 0.1, 0.2])  # submaps of 2 keyframes: 0, 0, 1
    visits = [
        VisitImages(geometry, everything(geometry), lambda k: None, lambda k: None)  # type: ignore[arg-type,return-value]
        for geometry in (first, current)
    ]
    covisible = SimpleNamespace(
        of_previous=((CovisiblePair(2, 0.9), CovisiblePair(0, 0.8), CovisiblePair(1, 0.7)), ()),
        of_current=((CovisiblePair(0, 0.8),), (), (CovisiblePair(0, 0.9),)),
    )

    of_previous, of_current = compare_patterns(visits[0], visits[1], covisible, SETTINGS)

    def alone(own: int, k: int, k_other: int) -> float:
        geometry, other = visits[own].geometry, visits[1 - own].geometry
        mask = visits[own].objects.mask(geometry, k)
        return float(compare_pattern(geometry, k, other, k_other, mask, 1, SETTINGS).weight[1])

    # The previous keyframe is compared with its two best: one in either submap.
    assert [a.weight[1] for a in of_previous] == pytest.approx([alone(0, 0, 0), alone(0, 0, 2)])
    assert [a.weight[1] for a in of_current] == pytest.approx([alone(1, 0, 0), alone(1, 2, 0)])
    assert of_previous[0].weight[1] > 300


def everything(geometry: SessionGeometry) -> SessionObjects:
    """One object that is all of the surface."""
    count = len(geometry.surface.points_world)
    return SessionObjects(np.ones(count, np.int32), 1, np.ones((len(geometry.keyframes), 2), np.int32))
