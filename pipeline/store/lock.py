"""One writer at a time: a lock file that names its holder and dies with it."""

from __future__ import annotations

import fcntl
import os
from contextlib import suppress
from pathlib import Path

from pipeline.errors import StorageError
from pipeline.store.files import writing


class WriterLock:
    """Exclusive hold of a folder, by ``flock`` on a file in it that contains the holder's process id.

    The kernel drops the hold when the process ends, however it ends, so a lock file left by a crash is
    stale at once and needs no guess about process ids.
    """

    def __init__(self, path: Path) -> None:
        """Take the lock.

        Raises:
            StorageError: another process (or another writer of this one) holds it, or it cannot be written.
        """
        self.path = path
        self._descriptor: int | None = None
        with writing(path):
            while True:
                descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
                try:
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    holder = os.read(descriptor, 32).decode(errors="replace").strip()
                    os.close(descriptor)
                    raise StorageError(
                        f"{path.parent} is being written by process {holder or 'unknown'}",
                        "wait until it is done or stop it",
                    ) from None
                except OSError:
                    os.close(descriptor)
                    raise
                if self._still_there(descriptor):
                    break
                os.close(descriptor)  # its former holder removed it between our open and our lock
            os.ftruncate(descriptor, 0)
            os.write(descriptor, f"{os.getpid()}\n".encode())
        self._descriptor = descriptor

    def _still_there(self, descriptor: int) -> bool:
        try:
            return os.path.samestat(os.fstat(descriptor), self.path.stat())
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Let go; harmless when called twice."""
        if self._descriptor is not None:
            with suppress(OSError):
                os.close(self._descriptor)
            self._descriptor = None
