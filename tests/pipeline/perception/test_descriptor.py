from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.perception.embedded.descriptor import GradientColourDescriptor, log_gain
from pipeline.perception.embedded.masks import DiscoveredMasks
from pipeline.perception.protocols import PatchWarp
from pipeline.settings import DescriptorSettings, DiscoverySettings

EXTRACTOR = GradientColourDescriptor(DescriptorSettings())


def noise_image(seed: int, size: tuple[int, int] = (96, 128)) -> np.ndarray:
    rng = np.random.default_rng(seed)
    coarse = rng.integers(40, 200, (size[0] // 8, size[1] // 8, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(coarse, (size[1], size[0]), interpolation=cv2.INTER_CUBIC))


def correlation(a: np.ndarray, b: np.ndarray, light: np.ndarray | None = None) -> np.ndarray:
    f0, f1 = EXTRACTOR.comparable(EXTRACTOR.describe(a), EXTRACTOR.describe(b), light)
    return f0 @ f1.T


def identity_warp(rows: int, columns: int) -> PatchWarp:
    row, column = np.mgrid[:rows, :columns]
    return PatchWarp(np.stack([column, row], axis=-1).astype(np.float32), np.ones((rows, columns), bool))


def test_patches_cover_the_whole_image_row_by_row() -> None:
    stored = EXTRACTOR.describe(noise_image(0))

    assert stored.shape == (6, 8, 75)
    assert stored.dtype == np.float16
    f0, f1 = EXTRACTOR.comparable(stored, stored, None)
    assert f0.shape == f1.shape == (48, 168)


def test_features_are_unit_vectors() -> None:
    f0, _ = EXTRACTOR.comparable(*[EXTRACTOR.describe(noise_image(1))] * 2, None)

    assert np.linalg.norm(f0, axis=1) == pytest.approx(1, abs=2e-3)


def test_every_patch_matches_itself_best_and_fully() -> None:
    c = correlation(noise_image(2), noise_image(2))

    assert np.diag(c) == pytest.approx(1, abs=3e-3)
    assert (c.argmax(axis=1) == np.arange(len(c))).all()


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_plain_and_overexposed_places_match_themselves_too(grey: int) -> None:
    # Without any gradient the histogram is empty; a white wall is still the same white wall.
    plain = np.full((96, 128, 3), grey, np.uint8)

    assert np.diag(correlation(plain, plain)) == pytest.approx(1, abs=3e-3)


def test_print_on_a_plain_surface_is_a_change() -> None:
    plain, printed = np.full((96, 128, 3), 128, np.uint8), np.full((96, 128, 3), 128, np.uint8)
    printed[32:64:4, 48:80] = 60

    same, different = correlation(plain, plain), correlation(plain, printed)

    assert different[2 * 8 + 3, 2 * 8 + 3] < same[2 * 8 + 3, 2 * 8 + 3] - 0.2


def test_another_colour_of_the_same_shape_correlates_less() -> None:
    image = noise_image(3)
    tinted = np.clip(image.astype(float) * [1.6, 0.7, 0.5], 0, 255).astype(np.uint8)

    assert np.diag(correlation(image, tinted)).mean() < EXTRACTOR.similarity.threshold
    assert np.diag(correlation(image, image)).mean() > EXTRACTOR.similarity.threshold


def test_light_is_measured_and_taken_out() -> None:
    before = noise_image(4, (192, 256))
    after = np.clip(before * np.array([0.8, 0.9, 1.1]), 0, 255).round().astype(np.uint8)
    stored = EXTRACTOR.describe(before), EXTRACTOR.describe(after)

    light = EXTRACTOR.light(*stored, identity_warp(12, 16))

    # What brings the current light to the previous one; stored channels are BGR.
    assert light == pytest.approx(-np.log([1.1, 0.9, 0.8]), abs=0.02)
    assert np.diag(correlation(before, after, light)).mean() > np.diag(correlation(before, after)).mean()
    assert np.diag(correlation(before, after, light)).mean() > 0.99


def test_changed_things_do_not_bend_the_light() -> None:
    rng = np.random.default_rng(5)
    colours = rng.uniform(40, 120, (12, 16, 3)).astype(np.float32)
    other = colours * 1.5
    other[:3] = 30.0  # a quarter of the image is something else

    assert log_gain(colours, other, identity_warp(12, 16)) == pytest.approx(-np.log(1.5), abs=0.1)


def test_light_of_images_that_share_nothing_is_zero() -> None:
    stored = EXTRACTOR.describe(noise_image(6))
    nowhere = PatchWarp(np.full((6, 8, 2), np.nan, np.float32), np.zeros((6, 8), bool))

    assert EXTRACTOR.light(stored, stored, nowhere).tolist() == [0, 0, 0]


def other_light(image: np.ndarray) -> np.ndarray:
    """Less saturated, brighter on the right, another white: what one gain per channel cannot undo."""
    colours = image.astype(np.float32) / 255
    grey = colours.mean(axis=-1, keepdims=True)
    colours = (grey + 0.6 * (colours - grey)) * np.array([0.8, 0.9, 1.0], np.float32)
    colours *= np.linspace(0.6, 1.2, image.shape[1], dtype=np.float32)[None, :, None]
    return np.clip(colours * 255, 0, 255).astype(np.uint8)


def relit_correlation(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    stored = EXTRACTOR.describe(before), EXTRACTOR.describe(after)
    f0, f1 = EXTRACTOR.relit(*stored, identity_warp(*stored[0].shape[:2]))
    assert np.linalg.norm(np.concatenate([f0, f1]), axis=1) == pytest.approx(1, abs=2e-3)
    return np.asarray((f0 * f1).sum(axis=1).reshape(stored[0].shape[:2]))


def test_light_that_differs_over_the_image_is_taken_out_of_one_pair() -> None:
    before = noise_image(8, (192, 256))
    after = other_light(before)
    stored = EXTRACTOR.describe(before), EXTRACTOR.describe(after)
    light = EXTRACTOR.light(*stored, identity_warp(12, 16))

    one_gain = 1 - np.diag(correlation(before, after, light)).mean()
    assert 1 - relit_correlation(before, after).mean() < 0.7 * one_gain


def test_relighting_a_pair_does_not_explain_away_what_changed() -> None:
    before = noise_image(9, (192, 256))
    changed = before.copy()
    changed[64:112, 96:160] = (200, 40, 30)
    relit = relit_correlation(before, other_light(changed))

    is_changed = np.zeros((12, 16), bool)
    is_changed[4:7, 6:10] = True
    well_inside = np.zeros_like(is_changed)
    well_inside[5, 7:9] = True
    apart = cv2.dilate(is_changed.astype(np.uint8), np.ones((5, 5))) == 0
    assert relit[well_inside].max() < np.quantile(relit[apart], 0.02)


def test_relighting_images_that_share_nothing_leaves_them() -> None:
    stored = EXTRACTOR.describe(noise_image(11))
    nowhere = PatchWarp(np.full((6, 8, 2), np.nan, np.float32), np.zeros((6, 8), bool))

    for relit, plain in zip(
        EXTRACTOR.relit(stored, stored, nowhere), EXTRACTOR.comparable(stored, stored, None), strict=True
    ):
        assert relit == pytest.approx(plain, abs=1e-6)


def test_same_image_gives_the_same_bytes() -> None:
    image = noise_image(7)
    again = GradientColourDescriptor(DescriptorSettings())

    assert EXTRACTOR.describe(image).tobytes() == again.describe(image).tobytes()


def test_discovered_masks_are_the_segments_of_the_voxels(monkeypatch: pytest.MonkeyPatch) -> None:
    from pipeline.perception.embedded import discovery

    monkeypatch.setattr(
        discovery, "discover_objects", lambda surface, settings: np.array([4, 0, 9], np.int32)
    )
    masks = DiscoveredMasks(DiscoverySettings())

    def no_pixels() -> np.ndarray:
        raise AssertionError("geometry needs no image")

    voxels = np.array([[0, 1], [2, -1]], np.int32)
    assert not masks.masks(no_pixels, voxels).any()  # nothing prepared, nothing found
    masks.prepare(None)  # type: ignore[arg-type]
    assert masks.masks(no_pixels, voxels).tolist() == [[4, 0], [9, 0]]
    assert masks.masks_are_tracks
