import gzip
import io
import multiprocessing
import os
import stat
import tarfile
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from archive_writers import recording, write_nerfstudio

from pipeline.errors import InputError, StorageError
from pipeline.readers import open_session
from pipeline.session import Session
from pipeline.settings import ArchiveSettings


def pack_zip(folder: Path, archive: Path) -> None:
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for file in sorted(folder.rglob("*")):
            packed.write(file, file.relative_to(folder.parent))


def pack_tar(folder: Path, archive: Path) -> None:
    with tarfile.open(archive, "w:gz" if archive.suffix == ".gz" else "w") as packed:
        packed.add(folder, ".")


PACKERS = [("visit.zip", pack_zip), ("visit.tar", pack_tar), ("visit.tar.gz", pack_tar)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "source"
    write_nerfstudio(folder, recording(3))
    return folder


@pytest.mark.parametrize(("name", "pack"), PACKERS)
def test_packed_archive_gives_the_same_session(
    folder: Path, name: str, pack: Callable[[Path, Path], None]
) -> None:
    archive = folder.parent / name
    pack(folder, archive)
    before = sorted(folder.parent.rglob("*"))

    session, unpacked = open_session(archive), open_session(folder)

    assert (session.name, session.path, session.format) == ("visit", archive, "nerfstudio")
    assert session.metadata_files == (archive,)
    for frame, expected in zip(session.frames, unpacked.frames, strict=True):
        np.testing.assert_array_equal(frame.load_rgb(), expected.load_rgb())
        np.testing.assert_array_equal(frame.load_depth(), expected.load_depth())
        np.testing.assert_array_equal(frame.T_world_camera, expected.T_world_camera)
        assert frame.files == (archive,)
    assert sorted(folder.parent.rglob("*")) == before  # nothing was unpacked beside it


def test_what_macos_adds_to_a_zip_does_not_hide_the_recording(folder: Path) -> None:
    archive = folder.parent / "visit.zip"
    pack_zip(folder, archive)
    write_member(archive, "__MACOSX/source/._transforms.json")
    write_member(archive, ".DS_Store")

    assert len(open_session(archive).frames) == 3


@pytest.mark.parametrize(("name", "pack"), PACKERS)
def test_frames_load_from_many_threads(folder: Path, name: str, pack: Callable[[Path, Path], None]) -> None:
    archive = folder.parent / name
    pack(folder, archive)
    session = open_session(archive)
    expected = [frame.load_rgb() for frame in session.frames]

    with ThreadPoolExecutor(8) as pool:
        loaded = list(pool.map(lambda k: session.frames[k % 3].load_rgb(), range(60)))

    for k, image in enumerate(loaded):
        np.testing.assert_array_equal(image, expected[k % 3])


def _sums(session: Session, times: int) -> list[int]:
    return [int(frame.load_rgb().sum()) for _ in range(times) for frame in session.frames]


@pytest.mark.parametrize(("name", "pack"), PACKERS)
def test_frames_load_in_forked_processes(folder: Path, name: str, pack: Callable[[Path, Path], None]) -> None:
    archive = folder.parent / name
    pack(folder, archive)
    session = open_session(archive)
    expected = _sums(session, 1)

    def load(_: int) -> None:
        os._exit(0 if _sums(session, 30) == expected * 30 else 1)

    workers = [multiprocessing.get_context("fork").Process(target=load, args=(k,)) for k in range(2)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(30)

    assert [worker.exitcode for worker in workers] == [0, 0]


def write_member(archive: Path, name: str, data: bytes = b"x", link: bool = False) -> None:
    if archive.suffix == ".zip":
        with zipfile.ZipFile(archive, "a") as packed:
            info = zipfile.ZipInfo(name)
            info.external_attr = (stat.S_IFLNK if link else stat.S_IFREG) << 16
            packed.writestr(info, data)
        return
    with tarfile.open(archive, "a") as packed:
        info = tarfile.TarInfo(name)
        if link:
            info.type, info.linkname = tarfile.SYMTYPE, data.decode()
        else:
            info.size = len(data)
        packed.addfile(info, None if link else io.BytesIO(data))


@pytest.mark.parametrize(("archive", "pack"), PACKERS[:2])
@pytest.mark.parametrize(
    "member", ["../evil.png", "/etc/evil.png", "a/../../evil.png", "..\\evil.png", "C:\\evil"]
)
def test_members_that_lead_outside_are_refused(
    folder: Path, archive: str, pack: Callable[[Path, Path], None], member: str
) -> None:
    path = folder.parent / archive
    pack(folder, path)
    write_member(path, member)

    with pytest.raises(InputError) as caught:
        open_session(path)
    assert str(caught.value) == f"{path}: member {member!r} leads outside the archive: pack the folder again"
    assert not list(folder.parent.rglob("evil*"))


@pytest.mark.parametrize(("archive", "pack"), PACKERS[:2])
def test_links_are_refused(folder: Path, archive: str, pack: Callable[[Path, Path], None]) -> None:
    path = folder.parent / archive
    pack(folder, path)
    write_member(path, "images/secret.png", b"/etc/passwd", link=True)

    with pytest.raises(InputError) as caught:
        open_session(path)
    assert str(caught.value) == f"{path}: member 'images/secret.png' is a link: pack the files themselves"


@pytest.mark.parametrize(("name", "pack"), PACKERS)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
def test_truncated_archives_are_told(
    folder: Path, name: str, pack: Callable[[Path, Path], None], share: float
) -> None:
    (folder / "zz_last.bin").write_bytes(np.random.default_rng(0).bytes(100_000))  # no padding at the cut
    path = folder.parent / name
    pack(folder, path)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])

    with pytest.raises(InputError) as caught:
        open_session(path)
    assert str(caught.value) == f"{path} is truncated or damaged: copy the archive again"


@pytest.mark.parametrize(("name", "pack"), PACKERS)
def test_exploding_archives_are_refused(folder: Path, name: str, pack: Callable[[Path, Path], None]) -> None:
    (folder / "zeros.bin").write_bytes(bytes(4_000_000))
    path = folder.parent / name
    pack(folder, path)
    settings = ArchiveSettings()

    with pytest.raises(InputError) as caught:
        open_session(path, replace(settings, max_members=3))
    assert str(caught.value) == f"{path} holds more than 3 files: raise archive.max_members if that is meant"
    if path.suffix == ".tar":
        return
    with pytest.raises(InputError) as caught:
        open_session(path, replace(settings, max_unpacked_bytes=1_000_000))
    assert str(caught.value) == (
        f"{path} unpacks to more than 0.001 GB: raise archive.max_unpacked_bytes if that is meant"
    )
    with pytest.raises(InputError) as caught:
        open_session(path, replace(settings, ratio_from_bytes=1_000_000, max_ratio=50.0))
    assert (
        str(caught.value)
        == f"{path} unpacks to more than 50 times its size: raise archive.max_ratio if that is meant"
    )
    assert len(open_session(path, settings).frames) == 3


def test_bomb_is_stopped_while_it_is_decompressed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bomb.tar.gz"
    with gzip.open(path, "wb") as packed:
        for _ in range(64):
            packed.write(bytes(1 << 20))
    written: list[int] = []
    real = gzip.GzipFile.read
    monkeypatch.setattr(gzip.GzipFile, "read", lambda self, size: written.append(size) or real(self, size))

    with pytest.raises(InputError, match="unpacks to more than"):
        open_session(path, ArchiveSettings(max_unpacked_bytes=5 << 20))
    assert sum(written) <= 7 << 20


def test_full_disk_is_a_storage_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder.parent / "visit.tar.gz"
    pack_tar(folder, path)
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("needs /dev/full")
    monkeypatch.setattr("tempfile.TemporaryFile", lambda: full.open("r+b", buffering=0))

    with pytest.raises(
        StorageError, match=r"cannot decompress .*visit.tar.gz into .*: No space left on device"
    ):
        open_session(path)


def test_damaged_member_is_named_when_it_is_read(folder: Path) -> None:
    path = folder.parent / "visit.zip"
    pack_zip(folder, path)
    with zipfile.ZipFile(path) as packed:
        offset = packed.getinfo("source/images/00001.png").header_offset
    data = bytearray(path.read_bytes())
    data[offset + 200] ^= 0xFF
    path.write_bytes(data)
    session = open_session(path)

    with pytest.raises(InputError) as caught:
        session.frames[1].load_rgb()
    assert str(caught.value) == (f"{path}/source/images/00001.png is damaged: pack or copy the archive again")
    assert session.frames[2].load_rgb().shape == (24, 32, 3)


def test_encrypted_zip_is_told(folder: Path) -> None:
    path = folder.parent / "visit.zip"
    pack_zip(folder, path)
    data = bytearray(path.read_bytes())
    data[data.rfind(b"PK\x01\x02") + 8] |= 1  # the flag of the last member in the directory
    path.write_bytes(data)

    with pytest.raises(InputError) as caught:
        open_session(path)
    assert str(caught.value) == f"{path} is encrypted: pack it without a password"


def test_file_that_is_no_archive_is_told(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("hello")

    with pytest.raises(InputError) as caught:
        open_session(path)
    assert str(caught.value) == f"{path} is not an archive: name a folder, .zip, .tar or .tar.gz"
