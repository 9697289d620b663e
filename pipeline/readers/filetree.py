"""The files of an archive by relative name, wherever they lie: a directory, or a part of one.

``pipeline.readers.packed`` offers the same for zip and tar files. Readers never touch paths, so each
format works unpacked and packed alike.
"""

from __future__ import annotations

import os
import posixpath
from pathlib import Path
from typing import Protocol

from pipeline.errors import InputError


class FileTree(Protocol):
    """Files named by "/"-separated paths relative to the archive."""

    @property
    def path(self) -> Path:
        """What the user gave, for messages."""

    def has(self, name: str) -> bool:
        """Whether there is such a file; does not touch the disk once its folder is listed."""

    def entries(self, folder: str = "") -> tuple[frozenset[str], frozenset[str]]:
        """Names of the files and of the folders that lie directly in a folder."""

    def read(self, name: str) -> bytes:
        """Content of a file.

        Raises:
            InputError: it cannot be read; names the file.
        """

    def sources(self, *names: str) -> tuple[Path, ...]:
        """Files on disk that hold these names (for a zip: the zip), for hashing."""

    def where(self, name: str) -> str:
        """How messages name a file."""


def normalised(name: str) -> str | None:
    """A relative name without ``./`` and ``..``; None if it leads outside the archive."""
    name = posixpath.normpath(name.replace("\\", "/"))
    if name.startswith(("/", "../")) or name in (".", "..") or name[1:2] == ":":
        return None
    return name


class DirectoryTree:
    """A directory on disk; each folder is listed once, by one ``os.scandir``."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._listed: dict[str, tuple[frozenset[str], frozenset[str]]] = {}

    @property
    def path(self) -> Path:
        """The directory."""
        return self._path

    def entries(self, folder: str = "") -> tuple[frozenset[str], frozenset[str]]:
        """See :class:`FileTree`."""
        if folder not in self._listed:
            files: set[str] = set()
            folders: set[str] = set()
            try:
                with os.scandir(self._path / folder) as listing:
                    for entry in listing:
                        (folders if entry.is_dir() else files).add(entry.name)
            except (FileNotFoundError, NotADirectoryError):
                pass
            except OSError as error:
                raise InputError(f"cannot list {self.where(folder)}: {error.strerror}") from None
            self._listed[folder] = (frozenset(files), frozenset(folders))
        return self._listed[folder]

    def has(self, name: str) -> bool:
        """See :class:`FileTree`."""
        folder, _, base = name.rpartition("/")
        return base in self.entries(folder)[0]

    def read(self, name: str) -> bytes:
        """See :class:`FileTree`."""
        try:
            return (self._path / name).read_bytes()
        except OSError as error:
            raise InputError(f"cannot read {self.where(name)}: {error.strerror}") from None

    def sources(self, *names: str) -> tuple[Path, ...]:
        """See :class:`FileTree`."""
        return tuple(self._path / name for name in names)

    def where(self, name: str) -> str:
        """See :class:`FileTree`."""
        return str(self._path / name)


class SubTree:
    """The files below one folder of another tree, under the name of the whole archive."""

    def __init__(self, tree: FileTree, folder: str) -> None:
        self._tree = tree
        self._folder = folder

    @property
    def path(self) -> Path:
        """The archive that the folder is a part of."""
        return self._tree.path

    def entries(self, folder: str = "") -> tuple[frozenset[str], frozenset[str]]:
        """See :class:`FileTree`."""
        return self._tree.entries(posixpath.join(self._folder, folder) if folder else self._folder)

    def has(self, name: str) -> bool:
        """See :class:`FileTree`."""
        return self._tree.has(posixpath.join(self._folder, name))

    def read(self, name: str) -> bytes:
        """See :class:`FileTree`."""
        return self._tree.read(posixpath.join(self._folder, name))

    def sources(self, *names: str) -> tuple[Path, ...]:
        """See :class:`FileTree`."""
        return self._tree.sources(*(posixpath.join(self._folder, name) for name in names))

    def where(self, name: str) -> str:
        """See :class:`FileTree`."""
        return self._tree.where(posixpath.join(self._folder, name))
