"""What a session is made of, as one hash: a cached result fits if it was made from the same content."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from hashlib import blake2b
from pathlib import Path

from pipeline.errors import InputError
from pipeline.session import Session

CHUNK_BYTES = 1 << 20
MAX_THREADS = 4


def fingerprint(session: Session) -> str:
    """blake2b over the content of every file of a session, as hexadecimal digits.

    Files count by their name relative to the archive, so that a moved or renamed archive keeps its
    fingerprint; a zip or tar is one file.

    Raises:
        InputError: a file cannot be read.
    """
    frame_files = (file for frame in session.frames for file in frame.files)
    files = dict.fromkeys([*session.metadata_files, *frame_files])
    named = sorted((_relative(file, session.path), file) for file in files)
    threads = min(MAX_THREADS, os.cpu_count() or 1)
    with ThreadPoolExecutor(threads) as pool:
        digests = list(pool.map(_digest, (file for _, file in named)))
    whole = blake2b(digest_size=32)
    for (name, _), digest in zip(named, digests, strict=True):
        whole.update(name.encode() + b"\0" + digest)
    # Which frames are used is part of the content: a file that vanished leaves no bytes to hash.
    whole.update(",".join(str(frame.index) for frame in session.frames).encode())
    return whole.hexdigest()


def _relative(file: Path, archive: Path) -> str:
    try:
        return file.relative_to(archive).as_posix()
    except ValueError:
        return file.name


def _digest(file: Path) -> bytes:
    digest = blake2b(digest_size=32)
    try:
        with file.open("rb") as stream:
            while chunk := stream.read(CHUNK_BYTES):
                digest.update(chunk)
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror}") from None
    return digest.digest()
