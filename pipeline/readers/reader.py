"""What a format has to offer to be opened: one file per format, listed in ``pipeline.readers``."""

from __future__ import annotations

from typing import Protocol

from pipeline.readers.filetree import FileTree
from pipeline.session import Session
from pipeline.settings import ArchiveSettings


class Reader(Protocol):
    """One archive format, recognised by what the archive holds."""

    name: str  # as in Session.format
    looks_for: str  # what tells the format, for the message that nothing was found

    def matches(self, tree: FileTree) -> bool:
        """Whether the files look like this format; reads no file's content."""

    def read(self, tree: FileTree, settings: ArchiveSettings) -> Session:
        """The session, with images unread.

        Raises:
            InputError: the archive cannot be used.
        """
