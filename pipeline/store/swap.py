"""Putting a finished folder in the place of an older result without ever losing inspectors' decisions."""

from __future__ import annotations

import json
import os
import shutil
from contextlib import suppress
from pathlib import Path

from pipeline.store.files import exchange
from pipeline.store.layout import REVIEW_FILE, ResultLayout

_REVIEW_STEM = REVIEW_FILE.removesuffix(".sqlite")


def _retired(target: Path) -> Path:
    return target.with_name(target.name + ".old")


def recover_interrupted_swap(target: Path) -> None:
    """Undo or complete a swap that a crash cut in two (only without ``renameat2``)."""
    retired = _retired(target)
    if not retired.exists():
        return
    if target.exists():
        name = _review_name(retired, target, same_key=_key(retired) == _key(target))
        _carry_reviews(retired, target, name, move=True)
        shutil.rmtree(retired)
    else:
        retired.rename(target)


def swap_in(new: Path, target: Path, key: str) -> None:
    """Make ``new`` stand at ``target``, in one step where the system can.

    The decisions of the result that stood there are in ``new`` before it takes the place: as they are
    when the keys are equal, else as ``review-<n>.sqlite``.
    """
    if not target.exists():
        new.rename(target)
        return
    name = _review_name(target, new, same_key=_key(target) == key)
    _carry_reviews(target, new, name, move=False)
    if exchange(new, target):
        retired = new
    else:
        retired = _retired(target)
        target.rename(retired)
        new.rename(target)
    # What was decided between the two steps stands in files that were not linked, or in stale copies.
    _carry_reviews(retired, target, name, move=True)
    shutil.rmtree(retired, ignore_errors=True)


def _review_name(old: Path, new: Path, *, same_key: bool) -> str:
    """What the decisions of ``old`` are called in ``new``: the next number that no other database has."""
    if same_key:
        return REVIEW_FILE
    number = 1
    while True:
        name = f"{_REVIEW_STEM}-{number}.sqlite"
        if not (old / name).exists() and (
            not (new / name).exists() or _same_file(old / REVIEW_FILE, new / name)
        ):
            return name
        number += 1


def _carry_reviews(old: Path, new: Path, name: str, *, move: bool) -> None:
    """Give ``new`` the review files of ``old``, SQLite companions (``-wal``, ``-journal``) included.

    Linked where possible, so that both folders hold the same open database; else copied, and with
    ``move`` the originals take the place of such copies.
    """
    pairs = [(path, new / path.name) for path in old.glob(f"{_REVIEW_STEM}-*.sqlite*")]
    pairs += [
        (path, new / (name + path.name.removeprefix(REVIEW_FILE))) for path in old.glob(f"{REVIEW_FILE}*")
    ]
    for source, target in pairs:
        if _same_file(source, target):
            continue
        with suppress(FileNotFoundError):  # SQLite removes a companion file when it closes
            if move:
                source.replace(target)
            else:
                try:
                    os.link(source, target)
                except FileExistsError:
                    continue
                except OSError:  # a file system without hard links
                    shutil.copy2(source, target)


def _same_file(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except FileNotFoundError:
        return False


def _key(result: Path) -> str | None:
    try:
        return str(json.loads(ResultLayout(result).manifest.read_bytes())["key"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
