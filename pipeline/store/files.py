"""Files that are either whole or not there, and operating-system errors told in one line."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import StorageError

_HINTS = {
    errno.ENOSPC: (
        "the disk is full",
        "free some space and run the same command again, it goes on from there",
    ),
    errno.EDQUOT: ("the disk quota is used up", "free some space and run the same command again"),
    errno.EACCES: ("permission denied", "choose a folder that you may write to"),
    errno.EPERM: ("permission denied", "choose a folder that you may write to"),
    errno.EROFS: ("the file system is read-only", "choose a folder that you may write to"),
    errno.ENOTDIR: ("a file is in the way", "choose another path"),
    errno.ENOENT: ("there is no such folder, and it cannot be made", "choose another path"),
    errno.EEXIST: ("a file is in the way", "choose another path"),
    errno.ENAMETOOLONG: ("the name is too long", "choose a shorter one"),
}

# Headers are parsed by ast.literal_eval, which before Python 3.11.8 fails now and then when several threads
# use it at once (cpython issue 106905).
_HEADER = Lock()


def storage_error(path: Path, error: OSError) -> StorageError:
    """One finished line for a failed write at ``path``."""
    reason, hint = _HINTS.get(error.errno or 0, (error.strerror or str(error), "check the disk"))
    return StorageError(f"cannot write {path}: {reason}", hint)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn every ``OSError`` inside into a ``StorageError`` that names ``path``."""
    try:
        yield
    except OSError as error:
        raise storage_error(path, error) from error


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """A file that appears under ``path`` when the block succeeds, and not at all when it fails.

    Raises:
        StorageError: the operating system refused.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    with writing(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with temporary.open("wb") as file:
                yield file
            os.replace(temporary, path)  # noqa: PTH105 - the tests simulate a full disk here
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise


def write_bytes(path: Path, content: bytes) -> None:
    """Write a whole file atomically."""
    with atomic_file(path) as file:
        file.write(content)


def read_npy(path: Path, *, mmap: bool = False) -> NDArray[Any]:
    """An ``.npy`` file, read or memory-mapped; any thread may call it.

    Raises:
        OSError, ValueError, EOFError: as ``numpy.load``.
    """
    if mmap:
        with _HEADER:
            return np.load(path, mmap_mode="r", allow_pickle=False)
    content = BytesIO(path.read_bytes())
    with _HEADER:
        return np.load(content, allow_pickle=False)


def write_array(path: Path, array: NDArray[Any]) -> None:
    """Write an ``.npy`` atomically, in C order; object arrays are refused (``ValueError``)."""
    array = np.asarray(array, order="C")
    if array.dtype.hasobject:
        raise ValueError(f"{path.name}: object arrays would need pickle")
    with atomic_file(path) as file:
        np.lib.format.write_array_header_1_0(file, np.lib.format.header_data_from_array_1_0(array))
        # Not np.save: its C writer loses errno, and with it the difference between a full disk and others.
        if array.size:
            file.write(array.data)


def write_arrays(path: Path, **arrays: Any) -> None:
    """Write an ``.npz`` atomically; the same arrays give the same bytes; object arrays are refused."""
    for name, array in arrays.items():
        if np.asarray(array).dtype.hasobject:
            raise ValueError(f"{name} of {path.name}: object arrays would need pickle")
    with atomic_file(path) as file:
        np.savez(file, **arrays)


def sync_tree(root: Path) -> None:
    """Force a folder and everything in it to the disk."""
    folders = [Path(folder) for folder, _, _ in os.walk(root)]
    files = [path for folder in folders for path in folder.iterdir() if path.is_file()]
    with ThreadPoolExecutor(max_workers=8) as pool:  # waits of many small fsyncs overlap
        list(pool.map(_sync, files))
    for folder in reversed(folders):
        _sync(folder)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def exchange(one: Path, other: Path) -> bool:
    """Swap two existing paths in one step (Linux ``renameat2``); False where that is not possible."""
    if not sys.platform.startswith("linux"):
        return False
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    at_fdcwd, rename_exchange = -100, 2
    return bool(renameat2(at_fdcwd, os.fsencode(one), at_fdcwd, os.fsencode(other), rename_exchange) == 0)
