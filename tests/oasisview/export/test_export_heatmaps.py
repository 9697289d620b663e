from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st

from oasisview.export import export
from oasisview.export.heatmaps import enlarged_bilinear, enlarged_nearest
from pipeline.errors import InputError
from pipeline.store import open_result

NAN = np.nan


def test_bilinear_by_hand() -> None:
    enlarged = enlarged_bilinear(np.array([[0.0, 1.0]]), 1, 4)
    np.testing.assert_allclose(enlarged, [[0.0, 0.25, 0.75, 1.0]])
    # The unseen middle has no value and no weight: its neighbours keep theirs.
    enlarged = enlarged_bilinear(np.array([[0.4, NAN, 0.8]]), 1, 6)
    np.testing.assert_allclose(enlarged, [[0.4, 0.4, NAN, NAN, 0.8, 0.8]])
    assert enlarged.dtype == np.float32


def test_nearest_by_hand() -> None:
    enlarged = enlarged_nearest(np.array([[1.5, NAN], [-2.0, 0.25]], dtype=np.float16), 4, 4)
    np.testing.assert_array_equal(enlarged[0], [1.5, 1.5, NAN, NAN])
    np.testing.assert_array_equal(enlarged[3], [-2.0, -2.0, 0.25, 0.25])


@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(1, 7), st.integers(0, 40), st.integers(0, 40))
def test_bilinear_stays_within_what_was_measured(
    seed: int, rows: int, columns: int, more_rows: int, more_columns: int
) -> None:
    generator = np.random.default_rng(seed)
    grid = generator.uniform(0, 1, (rows, columns))
    grid[generator.uniform(size=grid.shape) < 0.3] = NAN
    height, width = rows + more_rows, columns + more_columns
    enlarged = enlarged_bilinear(grid, height, width)
    np.testing.assert_array_equal(np.isnan(enlarged), np.isnan(enlarged_nearest(grid, height, width)))
    seen = enlarged[np.isfinite(enlarged)]
    if len(seen):
        assert seen.min() >= np.nanmin(grid) - 1e-6
        assert seen.max() <= np.nanmax(grid) + 1e-6


def test_every_keyframe_in_four_files(small_result_path: Path, tmp_path: Path) -> None:
    out = tmp_path / "maps"
    export(small_result_path, "heatmaps", out)
    names = {path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file()}
    assert names == {
        f"{session}/{4 * k:05d}.{kind}.{suffix}"
        for session in (0, 1)
        for k in range(6)
        for kind in ("semantic", "geometric")
        for suffix in ("tif", "png")
    }
    nan_seen = 0
    for session in open_result(small_result_path).sessions:
        for k, record in enumerate(session.keyframes):
            stem = out / str(session.index) / f"{record.frame_index:05d}"
            semantic = tifffile.imread(f"{stem}.semantic.tif")
            geometric = tifffile.imread(f"{stem}.geometric.tif")
            assert semantic.dtype == geometric.dtype == np.float32
            assert semantic.shape == geometric.shape == (record.camera.height, record.camera.width)
            np.testing.assert_array_equal(geometric[::2, ::2], session.geometric_heatmap(k))
            grid = session.semantic_heatmap(k)
            np.testing.assert_array_equal(np.isnan(semantic[8::16, 8::16]), np.isnan(grid))
            assert np.nanmin(semantic) >= 0
            assert np.nanmax(semantic) <= 1
            nan_seen += np.isnan(semantic).sum()
            other_reader = cv2.imread(f"{stem}.geometric.tif", cv2.IMREAD_UNCHANGED)
            if other_reader is not None:
                np.testing.assert_array_equal(other_reader, geometric)
            for kind, values in (("semantic", semantic), ("geometric", geometric)):
                image = cv2.imread(f"{stem}.{kind}.png")
                assert image.shape == (*values.shape, 3)
                unseen = image[np.isnan(values)]
                assert np.ptp(unseen.astype(int), axis=1).max(initial=0) == 0  # grey: never taken for a value
    assert nan_seen > 0


def test_an_earlier_export_is_replaced_whole(small_result_path: Path, tmp_path: Path) -> None:
    out = tmp_path / "maps"
    out.mkdir()  # an empty folder is fine
    export(small_result_path, "heatmaps", out)
    stale = out / "1" / "99999.semantic.tif"
    stale.write_bytes(b"of an earlier export")
    export(small_result_path, "heatmaps", out)
    assert not stale.exists()
    assert len(list(out.rglob("*.tif"))) == 24
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize("stranger", ["notes.txt", "0/00000.semantic.tif.txt", "photos/1.jpg", ".hidden"])
def test_a_folder_with_anything_else_is_refused(
    small_result_path: Path, tmp_path: Path, stranger: str
) -> None:
    out = tmp_path / "maps"
    (out / stranger).parent.mkdir(parents=True)
    (out / stranger).write_text("precious")
    with pytest.raises(InputError, match="which no earlier export wrote"):
        export(small_result_path, "heatmaps", out)
    assert (out / stranger).read_text() == "precious"
    assert len([path for path in out.rglob("*") if path.is_file()]) == 1


def test_a_file_in_the_way_is_refused(small_result_path: Path, tmp_path: Path) -> None:
    (tmp_path / "maps").write_text("precious")
    with pytest.raises(InputError, match="is not a folder"):
        export(small_result_path, "heatmaps", tmp_path / "maps")
    assert (tmp_path / "maps").read_text() == "precious"
