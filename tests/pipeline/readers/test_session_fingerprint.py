import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from archive_writers import recording, save_transforms, write_image, write_nerfstudio

from pipeline.errors import InputError
from pipeline.readers import open_session
from pipeline.readers.fingerprint import fingerprint


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_nerfstudio(tmp_path / "visit", recording(4), ply_file_path="sparse.ply")
    (tmp_path / "visit/sparse.ply").write_text("ply\n")
    return tmp_path / "visit"


def of(path: Path) -> str:
    return fingerprint(open_session(path))


def test_same_content_gives_the_same_hash_wherever_it_lies(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "elsewhere/renamed")

    assert of(folder) == of(folder) == of(tmp_path / "elsewhere/renamed")
    assert len(of(folder)) == 64
    assert set(of(folder)) <= set("0123456789abcdef")


def test_relative_and_absolute_paths_give_the_same_hash(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    absolute = of(folder)
    monkeypatch.chdir(folder.parent)

    assert of(Path("visit")) == of(Path("./visit/")) == absolute


def write_transforms_again(folder: Path) -> None:
    document = write_nerfstudio(folder, recording(4), ply_file_path="sparse.ply")
    document["frames"][1]["transform_matrix"][0][3] += 1e-9
    save_transforms(folder, document)


def swap(a: Path, b: Path) -> None:
    content_a, content_b = a.read_bytes(), b.read_bytes()
    a.write_bytes(content_b)
    b.write_bytes(content_a)


CHANGES: dict[str, Callable[[Path], object]] = {
    "colour": lambda folder: write_image(folder / "images/00002.png", recording(1, seed=9).colours[0]),
    "depth": lambda folder: write_image(folder / "depth/00002.png", recording(1, seed=9).depths[0]),
    "frame gone": lambda folder: (folder / "depth/00003.png").unlink(),
    "point cloud": lambda folder: (folder / "sparse.ply").write_text("ply \n"),
    "poses": write_transforms_again,
    "frames swapped": lambda folder: swap(folder / "images/00001.png", folder / "images/00002.png"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_any_change_of_content_changes_the_hash(folder: Path, change: str) -> None:
    before = of(folder)
    CHANGES[change](folder)

    assert of(folder) != before


def test_files_that_no_frame_uses_do_not_count(folder: Path) -> None:
    before = of(folder)
    (folder / "notes.txt").write_text("hello")

    assert of(folder) == before


def test_packed_archive_counts_as_one_file(folder: Path, tmp_path: Path) -> None:
    archive = Path(shutil.make_archive(str(tmp_path / "visit"), "zip", folder))
    moved = tmp_path / "renamed.zip"
    shutil.copy(archive, moved)
    before = of(archive)

    assert of(moved) == before
    data = bytearray(moved.read_bytes())
    data[data.rfind(b"PK\x01\x02") + 12] ^= 1  # the time of the last member: content of the zip only
    moved.write_bytes(data)
    assert of(moved) != before


def test_vanished_file_is_named(folder: Path) -> None:
    session = open_session(folder)
    (folder / "images/00001.png").unlink()

    with pytest.raises(InputError) as caught:
        fingerprint(session)
    assert str(caught.value) == f"cannot read {folder}/images/00001.png: No such file or directory"
