"""Archives become sessions: one file per format, found by what the archive holds."""

from __future__ import annotations

from pathlib import Path

from pipeline.errors import InputError
from pipeline.readers.filetree import DirectoryTree, FileTree, SubTree
from pipeline.readers.nerfstudio import NerfstudioReader
from pipeline.readers.packed import open_packed
from pipeline.readers.reader import Reader
from pipeline.readers.sevenscenes import SevenScenesReader
from pipeline.readers.threerscan import ThreeRScanReader
from pipeline.readers.tum import TumReader
from pipeline.session import Session
from pipeline.settings import ArchiveSettings

READERS: tuple[Reader, ...] = (NerfstudioReader(), TumReader(), ThreeRScanReader(), SevenScenesReader())
MAX_NESTING = 3  # folders around the recording: many tools pack "visit1/" instead of its content
MAX_SUGGESTIONS = 100

__all__ = ["READERS", "open_session"]


def open_session(path: Path | str, settings: ArchiveSettings | None = None) -> Session:
    """Open a recording of any known format; images stay unread until asked for.

    Args:
        path: a folder, or a ``.zip``, ``.tar`` or ``.tar.gz`` of one.
        settings: limits on what is accepted.

    Raises:
        InputError: there is nothing there, or it cannot be used; the message says what to mend.
    """
    settings = settings or ArchiveSettings()
    tree = _open_tree(Path(path), settings)
    for reader, found in ((reader, found) for found in _candidates(tree) for reader in READERS):
        if reader.matches(found):
            return reader.read(found, settings)
    if inner := _recordings_inside(tree):
        raise InputError(
            f"{tree.path} holds {len(inner)} recordings", f"name one of them: {', '.join(inner[:5])}"
        )
    wanted = "; ".join(f"{reader.looks_for} ({reader.name})" for reader in READERS)
    raise InputError(f"{tree.path} holds no recording of a known format", f"looked for {wanted}")


def _open_tree(path: Path, settings: ArchiveSettings) -> FileTree:
    try:
        is_folder, exists = path.is_dir(), path.exists()
    except OSError as error:
        raise InputError(f"cannot open {path}: {error.strerror}") from None
    if is_folder:
        return DirectoryTree(path)
    if not exists:
        raise InputError(f"there is no archive {path}", "name a folder, .zip, .tar or .tar.gz")
    return open_packed(path, settings)


def _recordings_inside(tree: FileTree) -> list[str]:
    """Folders that would open by themselves, for whoever named the folder above them."""
    folders = sorted(tree.entries()[1])[:MAX_SUGGESTIONS]
    return [name for name in folders if any(reader.matches(SubTree(tree, name)) for reader in READERS)]


def _candidates(tree: FileTree) -> list[FileTree]:
    """The archive itself, then the only folder in it, and so on."""
    candidates = [tree]
    for _ in range(MAX_NESTING):
        folders = [name for name in candidates[-1].entries()[1] if not name.startswith((".", "__MACOSX"))]
        if len(folders) != 1:
            break
        candidates.append(SubTree(candidates[-1], folders[0]))
    return candidates
