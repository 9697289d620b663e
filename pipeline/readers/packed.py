"""Zip and tar archives read in place: members are decoded from the archive, nothing is unpacked to a folder.

Only a ``.tar.gz`` has to be decompressed, into one anonymous temporary file that vanishes with the
process, however it ends. No member is ever written under its own name, so none can land elsewhere.
"""

from __future__ import annotations

import gzip
import os
import stat
import tarfile
import tempfile
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import IO

from pipeline.errors import InputError, StorageError
from pipeline.readers.filetree import normalised
from pipeline.settings import ArchiveSettings

CHUNK_BYTES = 1 << 20
Entries = tuple[frozenset[str], frozenset[str]]


def open_packed(path: Path, settings: ArchiveSettings) -> ZipTree | TarTree:
    """The files of a zip, tar or tar.gz archive, told apart by content.

    Raises:
        InputError: not an archive, truncated, encrypted, too large, or with members that are links or
            lead outside.
        StorageError: no room for decompressing a tar.gz.
    """
    try:
        with path.open("rb") as file:
            head = file.read(512)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    if head.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return ZipTree(path, settings)
    if head.startswith(b"\x1f\x8b"):
        return TarTree(path, _decompressed(path, settings), settings)
    if head[257:262] == b"ustar":
        return TarTree(path, path.open("rb"), settings)
    raise InputError(f"{path} is not an archive", "name a folder, .zip, .tar or .tar.gz")


class ZipTree:
    """Members of a zip archive."""

    def __init__(self, path: Path, settings: ArchiveSettings) -> None:
        self._path = path
        self._open()
        members = self._zip.infolist()
        _check_count(path, len(members), settings)
        _check_growth(
            path, sum(m.file_size for m in members), sum(m.compress_size for m in members), settings
        )
        self._members: dict[str, zipfile.ZipInfo] = {}
        for member in members:
            if stat.S_ISLNK(member.external_attr >> 16):
                raise _link(path, member.filename)
            if member.flag_bits & 1:
                raise InputError(f"{path} is encrypted", "pack it without a password")
            name = _inside(path, member.filename)
            if not member.is_dir():
                self._members[name] = member
        self._entries = _entries(self._members)

    def _open(self) -> None:
        # A forked worker shares the file position of its parent: each process needs a handle of its own.
        self._pid = os.getpid()
        try:
            self._zip = zipfile.ZipFile(self._path)
        except (zipfile.BadZipFile, OSError, EOFError, NotImplementedError):
            raise _truncated(self._path) from None

    @property
    def path(self) -> Path:
        """The zip file."""
        return self._path

    def entries(self, folder: str = "") -> Entries:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return self._entries.get(folder, (frozenset(), frozenset()))

    def has(self, name: str) -> bool:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return name in self._members

    def read(self, name: str) -> bytes:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        if self._pid != os.getpid():
            self._open()
        try:
            return self._zip.read(self._members[name])
        except KeyError:
            raise InputError(f"{self.where(name)} is missing") from None
        except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError):
            raise InputError(f"{self.where(name)} is damaged", "pack or copy the archive again") from None

    def sources(self, *names: str) -> tuple[Path, ...]:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return (self._path,)

    def where(self, name: str) -> str:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return f"{self._path}/{name}"


class TarTree:
    """Members of an uncompressed tar archive, read by their position in the file."""

    def __init__(self, path: Path, file: IO[bytes], settings: ArchiveSettings) -> None:
        self._path = path
        self._file = file
        self._members: dict[str, tuple[int, int]] = {}  # (offset, size) in bytes
        size = os.fstat(file.fileno()).st_size
        try:
            with tarfile.open(fileobj=file, mode="r:") as archive:
                for count, member in enumerate(archive, start=1):
                    _check_count(path, count, settings)
                    if member.issym() or member.islnk():
                        raise _link(path, member.name)
                    if member.isdir() and member.name in (".", ""):
                        continue
                    name = _inside(path, member.name)
                    if member.isreg() and not member.issparse():
                        if member.offset_data + member.size > size:
                            raise _truncated(path)
                        self._members[name] = (member.offset_data, member.size)
                # tarfile takes a cut header for the end; a whole archive ends with blocks of zeros.
                if os.pread(file.fileno(), tarfile.BLOCKSIZE, archive.offset) != bytes(tarfile.BLOCKSIZE):
                    raise _truncated(path)
        except (tarfile.TarError, EOFError, OSError, ValueError):
            raise _truncated(path) from None
        self._entries = _entries(self._members)

    @property
    def path(self) -> Path:
        """The tar or tar.gz file."""
        return self._path

    def entries(self, folder: str = "") -> Entries:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return self._entries.get(folder, (frozenset(), frozenset()))

    def has(self, name: str) -> bool:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return name in self._members

    def read(self, name: str) -> bytes:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        if name not in self._members:
            raise InputError(f"{self.where(name)} is missing")
        offset, size = self._members[name]
        try:
            return os.pread(self._file.fileno(), size, offset)  # no shared position: safe in threads
        except OSError as error:
            raise InputError(f"cannot read {self.where(name)}: {error.strerror}") from None

    def sources(self, *names: str) -> tuple[Path, ...]:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return (self._path,)

    def where(self, name: str) -> str:
        """See :class:`pipeline.readers.filetree.FileTree`."""
        return f"{self._path}/{name}"


def _decompressed(path: Path, settings: ArchiveSettings) -> IO[bytes]:
    packed_bytes = path.stat().st_size
    unpacked_bytes = 0
    try:
        target = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the tree
        with gzip.open(path) as source:
            while chunk := _next_chunk(path, source):
                unpacked_bytes += len(chunk)
                _check_growth(path, unpacked_bytes, packed_bytes, settings)
                target.write(chunk)
        target.seek(0)
    except OSError as error:
        raise StorageError(
            f"cannot decompress {path} into {tempfile.gettempdir()}: {error.strerror}",
            "free some space, set TMPDIR, or unpack it yourself",
        ) from None
    return target


def _next_chunk(path: Path, source: gzip.GzipFile) -> bytes:
    try:
        return source.read(CHUNK_BYTES)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        raise _truncated(path) from None


def _entries(names: Iterable[str]) -> dict[str, Entries]:
    files: dict[str, set[str]] = {"": set()}
    folders: dict[str, set[str]] = {"": set()}
    for name in names:
        folder, _, base = name.rpartition("/")
        files.setdefault(folder, set()).add(base)
        while folder:
            parent, _, base = folder.rpartition("/")
            folders.setdefault(parent, set()).add(base)
            folder = parent
    return {
        folder: (frozenset(files.get(folder, ())), frozenset(folders.get(folder, ())))
        for folder in files.keys() | folders.keys()
    }


def _inside(path: Path, member: str) -> str:
    name = normalised(member)
    if name is None:
        raise InputError(f"{path}: member {member!r} leads outside the archive", "pack the folder again")
    return name


def _link(path: Path, member: str) -> InputError:
    return InputError(f"{path}: member {member!r} is a link", "pack the files themselves")


def _truncated(path: Path) -> InputError:
    return InputError(f"{path} is truncated or damaged", "copy the archive again")


def _check_count(path: Path, members: int, settings: ArchiveSettings) -> None:
    if members > settings.max_members:
        raise InputError(
            f"{path} holds more than {settings.max_members} files",
            "raise archive.max_members if that is meant",
        )


def _check_growth(path: Path, unpacked: int, packed: int, settings: ArchiveSettings) -> None:
    if unpacked > settings.max_unpacked_bytes:
        raise InputError(
            f"{path} unpacks to more than {settings.max_unpacked_bytes / 1e9:g} GB",
            "raise archive.max_unpacked_bytes if that is meant",
        )
    if unpacked > settings.ratio_from_bytes and unpacked > settings.max_ratio * max(packed, 1):
        raise InputError(
            f"{path} unpacks to more than {settings.max_ratio:g} times its size",
            "raise archive.max_ratio if that is meant",
        )
