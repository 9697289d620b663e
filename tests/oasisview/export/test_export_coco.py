"""The COCO file, read by pycocotools, and the packing of masks by a decoder of the test's own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from pycocotools import mask as coco_mask
from pycocotools.coco import COCO

from oasisview.export import export
from oasisview.export.coco_masks import full_size
from oasisview.export.run_lengths import packed, run_lengths
from pipeline.store import open_result


def unpacked(text: str, height: int, width: int) -> np.ndarray:
    """Decoder after the description of COCO's format, one character at a time."""
    runs: list[int] = []
    at = 0
    while at < len(text):
        value, shift, more = 0, 0, True
        while more:
            group = ord(text[at]) - 48
            at += 1
            value |= (group & 31) << shift
            shift += 5
            more = bool(group & 32)
            if not more and group & 16:
                value -= 1 << shift
        runs.append(value + (runs[-2] if len(runs) > 2 else 0))
    flat = np.concatenate([np.full(run, i % 2, bool) for i, run in enumerate(runs)] or [np.zeros(0, bool)])
    return flat.reshape((height, width), order="F")


def test_runs_by_hand() -> None:
    mask = np.array([[0, 1, 1], [0, 1, 0]], bool)  # down the columns: 0 0 1 1 1 0
    assert run_lengths(mask).tolist() == [2, 3, 1]
    assert run_lengths(~mask).tolist() == [0, 2, 3, 1]
    assert packed(np.array([2, 3, 1])) == "231"
    assert packed(np.array([0, 2, 3, 1])) == "023O"  # the fourth: 1 - 2 = -1


@given(arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=40)))
def test_masks_survive_packing(mask: np.ndarray) -> None:
    height, width = mask.shape
    text = packed(run_lengths(mask))
    np.testing.assert_array_equal(unpacked(text, height, width), mask)
    np.testing.assert_array_equal(coco_mask.decode({"size": [height, width], "counts": text}), mask)


@given(st.integers(1, 300), st.integers(1, 300), st.integers(0, 100))
def test_long_runs_survive_packing(height: int, width: int, seed: int) -> None:
    mask = np.zeros((height, width), bool)
    rng = np.random.default_rng(seed)
    top, left = rng.integers(height), rng.integers(width)
    mask[top : top + 50, left : left + 120] = True
    text = packed(run_lengths(mask))
    np.testing.assert_array_equal(coco_mask.decode({"size": [height, width], "counts": text}), mask)


def test_pycocotools_reads_every_mask(reviewed_path: Path, tmp_path: Path, capsys) -> None:
    export(reviewed_path, "coco", tmp_path / "masks.json")
    coco = COCO(tmp_path / "masks.json")
    result = open_result(reviewed_path)
    assert len(coco.getImgIds()) == sum(len(s.keyframes) for s in result.sessions)
    names = {c["id"]: c["name"] for c in coco.loadCats(coco.getCatIds())}
    assert names == {1: "static", 2: "appeared", 3: "disappeared", 4: "moved", 5: "unknown"}
    seen = 0
    for image in coco.loadImgs(coco.getImgIds()):
        session = result.sessions[image["session"]]
        k = next(i for i, r in enumerate(session.keyframes) if r.frame_index == image["frame_index"])
        camera = session.keyframes[k].camera
        assert (image["width"], image["height"]) == (camera.width, camera.height)
        assert (reviewed_path / image["file_name"]).read_bytes()[:2] == b"\xff\xd8"
        truth = session.object_mask(k)
        annotations = coco.loadAnns(coco.getAnnIds(imgIds=image["id"]))
        assert {a["attributes"]["object_id"] for a in annotations} == set(np.unique(truth).tolist()) - {0}
        for annotation in annotations:
            seen += 1
            mask = coco.annToMask(annotation).astype(bool)
            expected = truth == annotation["attributes"]["object_id"]
            np.testing.assert_array_equal(mask[::2, ::2], expected)
            assert mask.sum() == annotation["area"] == coco_mask.area(annotation["segmentation"])
            np.testing.assert_array_equal(coco_mask.toBbox(annotation["segmentation"]), annotation["bbox"])
            assert annotation["attributes"]["label"] == names[annotation["category_id"]]
            assert annotation["iscrowd"] == 0
    assert seen > 20


def test_labels_are_the_final_ones(reviewed_path: Path, tmp_path: Path) -> None:
    export(reviewed_path, "coco", tmp_path / "masks.json")
    document = json.loads((tmp_path / "masks.json").read_text())
    assert [a["id"] for a in document["annotations"]] == list(range(1, len(document["annotations"]) + 1))
    six = [a for a in document["annotations"] if a["attributes"]["object_id"] == 6]
    assert {a["category_id"] for a in six} == {4}
    assert {a["attributes"]["label_machine"] for a in six} == {"appeared"}
    assert {a["attributes"]["decided_by"] for a in six} == {"=Ann"}
    assert document["info"]["sessions"][1]["captured_at"] == "2026-03-09T09:30:00Z"


@pytest.mark.parametrize(("height", "width"), [(4, 6), (5, 7)])
def test_masks_of_odd_sizes_are_enlarged_to_the_image(height: int, width: int) -> None:
    ids = np.arange(((height + 1) // 2) * ((width + 1) // 2), dtype=np.uint16)
    small = ids.reshape((height + 1) // 2, (width + 1) // 2)
    large = full_size(small, height, width)
    assert large.shape == (height, width)
    np.testing.assert_array_equal(large[::2, ::2], small)
    np.testing.assert_array_equal(large[1::2, 1::2], small[: height // 2, : width // 2])
