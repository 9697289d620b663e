"""The result folder: what is written is read, whatever goes wrong in between."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from fixture_result import write_small_result

from pipeline.errors import InputError, ResultError, StorageError
from pipeline.result import ChangeLabel, PatchLinks, Result
from pipeline.store import ResultWriter, files, finished_result, open_result
from pipeline.store.files import write_array, write_bytes


def _all_bytes(root: Path) -> dict[str, bytes]:
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def _change_json(path: Path, **values: object) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


# What is written is read


def test_objects_survive_the_round_trip(small_result: Result) -> None:
    assert [item.object_id for item in small_result.objects] == list(range(1, 13))
    moved = small_result.object(4)
    assert moved.label is ChangeLabel.MOVED
    assert moved.displacement_m == pytest.approx(np.hypot(0.8, 0.2), abs=1e-6)
    assert [sighting.session for sighting in moved.sightings] == [0, 1]
    assert moved.sightings[0].extent_m == pytest.approx((0.4, 0.4, 0.4))
    assert small_result.object(8).replaced_by == 7
    assert small_result.replaced[0].overlap == pytest.approx(8 / 9, abs=1e-3)
    with pytest.raises(KeyError):
        small_result.object(99)


def test_arrays_keep_dtype_and_are_mapped(small_result: Result) -> None:
    session = small_result.sessions[1]
    assert isinstance(session.points_world, np.memmap)
    assert not session.points_world.flags.writeable
    assert (session.points_world.dtype, session.colours.dtype, session.object_ids.dtype) == (
        np.float32,
        np.uint8,
        np.int32,
    )
    assert len(session.points_world) == len(session.colours) == len(session.object_ids) > 0
    assert small_result.score_matrix.match_count.dtype == np.int32
    assert small_result.score_matrix.sigma.shape == (8, 9)


def test_keyframes_hold_what_was_rendered(small_result: Result) -> None:
    session = small_result.sessions[0]
    keyframe = session.keyframes[2]
    assert (keyframe.frame_index, keyframe.submap) == (8, 0)
    assert session.image_path(2).name == "00008.jpg"
    mask = session.object_mask(2)
    assert mask.shape == (keyframe.camera.height // 2, keyframe.camera.width // 2)
    assert {4, 8, 9} <= set(np.unique(mask).tolist())
    semantic, geometric = session.semantic_heatmap(2), session.geometric_heatmap(2)
    assert semantic.dtype == geometric.dtype == np.float32
    assert 0 <= np.nanmin(semantic) <= np.nanmax(semantic) <= 1
    assert np.nanmean(geometric[mask == 9]) < -0.3  # it disappeared: the current visit sees past it


def test_moves_are_read_where_a_method_wrote_them(tmp_path: Path) -> None:
    path = write_small_result(tmp_path)
    assert open_result(path).moves is None  # as in results of before there were any

    names = ("previous_object_id", "current_object_id", "log_odds")
    rows = np.array([(4, 4, 1.5), (5, 12, -2.0)], list(zip(names, ("<i4", "<i4", "<f4"), strict=True)))
    for written in (rows, rows[:0]):  # none were alike enough is not the same as never looked
        write_array(path / "moves.npy", written)
        moves = open_result(path).moves
        assert moves.dtype == rows.dtype
        assert moves.tolist() == written.tolist()

    (path / "moves.npy").write_bytes(b"not an array")
    with pytest.raises(ResultError, match=r"moves\.npy"):
        _ = open_result(path).moves


def test_masks_agree_with_the_map(small_result: Result) -> None:
    for session in small_result.sessions:
        in_masks = {
            i for k in range(len(session.keyframes)) for i in np.unique(session.object_mask(k)).tolist()
        }
        assert in_masks == set(np.unique(session.object_ids).tolist())
        assert in_masks - {0} == {o.object_id for o in small_result.objects if o.sighting(session.index)}


def test_links_are_by_position_and_absent_where_not_compared(small_result: Result) -> None:
    links = small_result.links(3, 1)
    assert links is not None
    assert links.previous_shape == links.current_shape == (15, 20)
    assert len(links.forward) == 300 and links.forward.max() < 300
    assert small_result.links(0, 5) is None


def test_belief_ends_in_the_final_labels(small_result: Result) -> None:
    assert small_result.belief[-1].tolist() == [item.label for item in small_result.objects]


def test_manifest_is_completed(small_result: Result) -> None:
    manifest = small_result.manifest
    assert manifest["schema_version"] == 1
    assert manifest["summary"] == {"unknown": 2, "static": 3, "appeared": 3, "disappeared": 2, "moved": 2}
    assert {"python", "numpy", "torch", "open3d", "opencv", "oasisview"} <= set(manifest["versions"])


def test_nothing_is_pickled(small_result_path: Path) -> None:
    suffixes = {path.suffix for path in small_result_path.rglob("*") if path.is_file()}
    assert suffixes == {".json", ".npy", ".npz", ".png", ".jpg"}
    with pytest.raises(ValueError, match="pickle"):
        write_array(small_result_path / "x.npy", np.array([{}], dtype=object))


def test_same_content_gives_the_same_bytes(tmp_path: Path) -> None:
    first = _all_bytes(write_small_result(tmp_path / "a"))
    second = _all_bytes(write_small_result(tmp_path / "b"))
    assert first == second


@pytest.mark.parametrize("shape", [(), (0,), (0, 3), (5,), (2, 3)])
def test_arrays_of_any_shape(tmp_path: Path, shape: tuple[int, ...]) -> None:
    array = np.arange(np.prod(shape), dtype=np.float16).reshape(shape)
    with ResultWriter(tmp_path / "r.oasis", "k") as writer:
        writer.save_array("deep/er", array)
        read = writer.load_array("deep/er")
    assert read.shape == shape and read.dtype == array.dtype
    np.testing.assert_array_equal(read, array)


def test_fortran_order_is_written_as_what_it_means(tmp_path: Path) -> None:
    array = np.arange(6, dtype=np.int32).reshape(2, 3).T
    write_array(tmp_path / "a.npy", array)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), array)


# Opening what is not a result


def test_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match=r"there is no result at .*gone\.oasis: make one with"):
        open_result(tmp_path / "gone.oasis")


def test_folder_without_manifest(tmp_path: Path) -> None:
    with pytest.raises(ResultError, match=r"is not a result: it has no result\.json"):
        open_result(tmp_path)


def test_other_schema(small_result_path: Path) -> None:
    _change_json(small_result_path / "result.json", schema_version=7)
    with pytest.raises(ResultError) as caught:
        open_result(small_result_path)
    assert str(caught.value) == (
        f"{small_result_path} was written by schema 7, this program reads 1: run it again"
    )


@pytest.mark.parametrize("name", ["result.json", "objects.json", "sessions/1/session.json"])
@pytest.mark.parametrize("content", ["", "{", "[]", '{"schema_version": 1, "objects": 3}'])
def test_broken_json(small_result_path: Path, name: str, content: str) -> None:
    (small_result_path / name).write_text(content)
    with pytest.raises(ResultError) as caught:
        open_result(small_result_path)
    assert "\n" not in str(caught.value) and "run it again" in str(caught.value)


@pytest.mark.parametrize(
    "name",
    [
        "objects.json",
        "belief.npy",
        "score_matrix/s_bar.npy",
        "sessions/0/points_world.npy",
        "sessions/1/session.json",
        "sessions/1/images/00004.jpg",
        "sessions/0/masks/00008.png",
        "sessions/0/geometric/00020.npy",
    ],
)
def test_missing_file_is_named(small_result_path: Path, name: str) -> None:
    (small_result_path / name).unlink()
    with pytest.raises(ResultError, match=f"{name} is missing: the result is not complete"):
        open_result(small_result_path)


def test_truncated_arrays_are_noticed_at_opening(small_result_path: Path) -> None:
    array = small_result_path / "sessions/0/points_world.npy"
    array.write_bytes(array.read_bytes()[:500])
    with pytest.raises(
        ResultError, match=r"points_world\.npy is not a readable array: the result is damaged"
    ):
        open_result(small_result_path)


def test_damaged_keyframe_files_are_named_when_read(small_result_path: Path) -> None:
    result = open_result(small_result_path)
    (small_result_path / "sessions/0/masks/00000.png").write_bytes(b"no image")
    (small_result_path / "sessions/0/semantic/00000.npy").write_bytes(b"no array")
    (small_result_path / "links/00012_00004.npz").write_bytes(b"no links")
    for read in (
        lambda: result.sessions[0].object_mask(0),
        lambda: result.sessions[0].semantic_heatmap(0),
        lambda: result.links(3, 1),
    ):
        with pytest.raises(ResultError, match="damaged"):
            read()


def test_finished_result_asks_for_the_key(small_result_path: Path, tmp_path: Path) -> None:
    assert finished_result(small_result_path, "small-fixture") is not None
    assert finished_result(small_result_path, "another") is None
    assert finished_result(tmp_path / "gone.oasis", "small-fixture") is None


# Resuming


def test_resumes_after_a_kill_between_stages(tmp_path: Path) -> None:
    script = """
        import os, signal, sys
        import numpy as np
        from pipeline.store import ResultWriter
        writer = ResultWriter(sys.argv[1], "key")
        writer.save_array("surface", np.arange(4))
        writer.mark_stage("map_previous", {"keyframes": 7})
        (writer.partial / "result").mkdir()
        (writer.partial / "result/.half.npy.1.tmp").write_bytes(b"half")
        os.kill(os.getpid(), signal.SIGKILL)
    """
    target = tmp_path / "r.oasis"
    died = subprocess.run([sys.executable, "-c", textwrap.dedent(script), str(target)], check=False)
    assert died.returncode == -signal.SIGKILL
    assert not target.exists()
    with ResultWriter(target, "key") as writer:
        assert writer.stage_done("map_previous") and not writer.stage_done("map_current")
        assert writer.stage_info("map_previous") == {"keyframes": 7}
        assert writer.load_array("surface").tolist() == [0, 1, 2, 3]
        assert list(writer.layout.root.iterdir()) == []


def test_partial_of_another_key_is_discarded(tmp_path: Path) -> None:
    target = tmp_path / "r.oasis"
    with ResultWriter(target, "old") as writer:
        writer.save_array("surface", np.arange(4))
        writer.write_mask(0, 3, np.ones((2, 2), dtype=np.uint16))
        writer.mark_stage("map_previous")
    with ResultWriter(target, "new") as writer:
        assert not writer.stage_done("map_previous") and not writer.has_array("surface")
        assert not writer.layout.mask(0, 3).exists()
        with pytest.raises(KeyError):
            writer.stage_info("map_previous")


def test_a_finished_run_leaves_nothing_beside_the_result(tmp_path: Path) -> None:
    write_small_result(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["small.oasis"]


def test_a_crash_after_the_swap_is_not_taken_for_a_half_done_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("pipeline.store.writer.shutil.rmtree", lambda *_, **__: None)  # dies before tidying up
        target = write_small_result(tmp_path)
    assert (tmp_path / "small.oasis.partial/work/key.json").exists()
    shutil.rmtree(target)
    with ResultWriter(target, "small-fixture") as writer:
        assert not (writer.partial / "work/swapping").exists()
    write_small_result(tmp_path)
    assert open_result(target).manifest["key"] == "small-fixture"


def test_an_incomplete_result_does_not_replace_a_good_one(small_result_path: Path) -> None:
    before = _all_bytes(small_result_path)
    with ResultWriter(small_result_path, "other") as writer:
        writer.write_objects([], [], open_result(small_result_path).score_matrix, np.zeros((1, 0)))
        with pytest.raises(ResultError, match=r"session\.json is missing"):
            writer.finish({"settings": {}, "inputs": [{}, {}]})
    assert _all_bytes(small_result_path) == before


# A full disk, a folder that may not be written


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (28, "the disk is full: free some space and run the same command again"),
        (122, "the disk quota is used up: "),
        (13, "permission denied: choose a folder that you may write to"),
        (30, "the file system is read-only: "),
    ],
)
def test_a_failing_disk_is_told_in_one_line_and_leaves_nothing_half_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, said: str
) -> None:
    with ResultWriter(tmp_path / "r.oasis", "key") as writer:
        writer.save_array("surface", np.arange(4))
        writer.mark_stage("map_previous")
        before = _all_bytes(writer.partial)

        def refuse(*_: object) -> None:
            raise OSError(number, os.strerror(number))

        with monkeypatch.context() as patch:
            patch.setattr(files.os, "replace", refuse)
            for write in (
                lambda: writer.save_array("surface", np.arange(9)),
                lambda: writer.write_image(0, 1, np.zeros((8, 8, 3), dtype=np.uint8)),
                lambda: writer.write_links(0, 0, PatchLinks(*[np.zeros(4)] * 4, (2, 2), (2, 2))),
                lambda: writer.mark_stage("map_current"),
            ):
                with pytest.raises(StorageError) as caught:
                    write()
                assert said in str(caught.value) and "\n" not in str(caught.value)
                assert str(writer.partial) in str(caught.value)
        assert _all_bytes(writer.partial) == before
    with ResultWriter(tmp_path / "r.oasis", "key") as writer:
        assert writer.stage_done("map_previous") and not writer.stage_done("map_current")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_really_full_device_is_recognised(tmp_path: Path) -> None:
    (tmp_path / f".a.npy.{os.getpid()}.tmp").symlink_to("/dev/full")
    with pytest.raises(StorageError, match=r"cannot write .*a\.npy: the disk is full"):
        write_array(tmp_path / "a.npy", np.zeros(100_000))
    assert list(tmp_path.iterdir()) == []


def test_failure_while_finishing_keeps_old_result_and_partial(
    small_result_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = _all_bytes(small_result_path)

    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("pipeline.store.writer.sync_tree", refuse)
        with pytest.raises(StorageError, match="the disk is full"):
            write_small_result(small_result_path.parent, key="new")
    assert _all_bytes(small_result_path) == before
    assert (small_result_path.parent / "small.oasis.partial/result/result.json").exists()
    write_small_result(small_result_path.parent, key="new")
    assert open_result(small_result_path).manifest["key"] == "new"


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="a file is in the way"):
        ResultWriter(tmp_path / "file" / "r.oasis", "key")


def test_a_folder_that_is_no_result_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "precious").mkdir()
    with pytest.raises(InputError, match="exists and is not a result: choose another path"):
        ResultWriter(tmp_path / "precious", "key")


# One writer at a time


def test_two_writers_exclude_each_other(tmp_path: Path) -> None:
    with (
        ResultWriter(tmp_path / "r.oasis", "key"),
        pytest.raises(StorageError, match=f"is being written by process {os.getpid()}: wait"),
    ):
        ResultWriter(tmp_path / "r.oasis", "key")
    ResultWriter(tmp_path / "r.oasis", "key").close()


def test_a_stale_lock_is_taken_over(tmp_path: Path) -> None:
    (tmp_path / "r.oasis.partial").mkdir()
    (tmp_path / "r.oasis.partial/lock").write_text("1\n")  # a process that lives, but not ours any more
    ResultWriter(tmp_path / "r.oasis", "key").close()


# Decisions of inspectors


@pytest.mark.parametrize("has_exchange", [True, False])
@pytest.mark.parametrize("has_links", [True, False])
class TestReviews:
    @pytest.fixture(autouse=True)
    def _file_system(self, monkeypatch: pytest.MonkeyPatch, has_exchange: bool, has_links: bool) -> None:
        def no_links(*_: object) -> None:
            raise PermissionError(1, "Operation not permitted")

        if not has_exchange:
            monkeypatch.setattr("pipeline.store.swap.exchange", lambda *_: False)
        if not has_links:
            monkeypatch.setattr("pipeline.store.swap.os.link", no_links)

    def test_same_key_keeps_them(self, small_result_path: Path) -> None:
        (small_result_path / "review.sqlite").write_bytes(b"decisions")
        (small_result_path / "review.sqlite-wal").write_bytes(b"latest")
        write_small_result(small_result_path.parent)
        assert (small_result_path / "review.sqlite").read_bytes() == b"decisions"
        assert (small_result_path / "review.sqlite-wal").read_bytes() == b"latest"
        assert [path.name for path in small_result_path.parent.glob("small*")] == ["small.oasis"]

    def test_other_keys_put_them_aside_one_after_the_other(self, small_result_path: Path) -> None:
        for key in ("second", "third"):
            (small_result_path / "review.sqlite").write_bytes(f"before {key}".encode())
            write_small_result(small_result_path.parent, key=key)
            assert not (small_result_path / "review.sqlite").exists()
        kept = {path.name: path.read_bytes() for path in small_result_path.glob("review*")}
        assert kept == {"review-1.sqlite": b"before second", "review-2.sqlite": b"before third"}

    def test_a_decision_during_the_swap_is_not_lost(
        self, small_result_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from pipeline.store import swap

        carry = swap._carry_reviews

        def carry_then_decide(old: Path, new: Path, name: str, *, move: bool) -> None:
            carry(old, new, name, move=move)
            if not move:
                (old / "review.sqlite-wal").write_bytes(b"late")

        (small_result_path / "review.sqlite").write_bytes(b"decisions")
        monkeypatch.setattr(swap, "_carry_reviews", carry_then_decide)
        write_small_result(small_result_path.parent)
        assert (small_result_path / "review.sqlite-wal").read_bytes() == b"late"


def test_an_interrupted_swap_is_undone(small_result_path: Path) -> None:
    small_result_path.rename(small_result_path.with_name("small.oasis.old"))
    ResultWriter(small_result_path, "key").close()
    assert open_result(small_result_path).manifest["key"] == "small-fixture"


def test_atomic_write_of_bytes_replaces_whole_files(tmp_path: Path) -> None:
    write_bytes(tmp_path / "a", b"first")
    write_bytes(tmp_path / "a", b"second")
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("a", b"second")]
