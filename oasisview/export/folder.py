"""A folder that appears whole or not at all, and replaces nothing but an earlier export."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.errors import InputError
from pipeline.store.files import exchange, writing


@contextmanager
def atomic_folder(path: Path, *, earlier_files: str) -> Iterator[Path]:
    """A folder to fill; it stands at ``path`` when the block succeeds.

    Args:
        earlier_files: regular expression of the relative paths that an earlier export may hold.

    Raises:
        InputError: a file, or a folder with anything else inside, stands at ``path``.
        StorageError: the operating system refused; ``path`` is as it was.
    """
    _check_replaceable(path, earlier_files)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    with writing(path):
        try:
            shutil.rmtree(unfinished, ignore_errors=True)
            unfinished.mkdir(parents=True)
            yield unfinished
            _check_replaceable(path, earlier_files)  # somebody may have put a file there meanwhile
            _put_in_place(unfinished, path)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)


def _check_replaceable(path: Path, earlier_files: str) -> None:
    if path.is_symlink() or (path.exists() and not path.is_dir()):
        raise InputError(f"{path} is not a folder", "name a new folder for this export")
    with writing(path):
        for found in sorted(path.rglob("*")) if path.exists() else ():
            inside = found.relative_to(path).as_posix()
            if found.is_symlink() or (not found.is_dir() and not re.fullmatch(earlier_files, inside)):
                raise InputError(
                    f"{path} holds {inside}, which no earlier export wrote",
                    "name a new or an empty folder for this export",
                )


def _put_in_place(new: Path, path: Path) -> None:
    if not path.exists():
        new.rename(path)
    elif exchange(new, path):
        return  # the earlier export now stands where the new one was made, and goes with it
    else:
        retired = new.with_name(new.name + ".old")
        path.rename(retired)
        new.rename(path)
        shutil.rmtree(retired, ignore_errors=True)
