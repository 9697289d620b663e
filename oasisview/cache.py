"""What is kept between calls, in ``$OASISVIEW_CACHE`` or ``~/.cache/oasisview``: results, demo recordings."""

from __future__ import annotations

import hashlib
import json
import os
import re
from pathlib import Path

from pipeline.settings import Settings


def cache_folder() -> Path:
    """The cache folder; it may not exist yet."""
    chosen = os.environ.get("OASISVIEW_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "oasisview"


def cached_result_path(previous: Path, current: Path, settings: Settings) -> Path:
    """Result folder of a pair: one for each pair of places and settings.

    Whether what stands there still fits the recordings is for the engine to say, from their hashes.
    """
    identity = json.dumps(
        [str(previous.resolve()), str(current.resolve()), settings.to_dict()], sort_keys=True
    )
    digest = hashlib.sha256(identity.encode()).hexdigest()[:12]
    return cache_folder() / "results" / f"{_plain(previous)}-{_plain(current)}-{digest}.oasis"


def demo_folder(scene: str, seed: int, frames: int) -> Path:
    """Where ``oasisview demo`` keeps its recordings."""
    return cache_folder() / "demo" / f"{scene}-{seed}-{frames}"


def _plain(archive: Path) -> str:
    name = archive.resolve().name
    for suffix in (".zip", ".tar.gz", ".tgz", ".tar"):
        name = name.removesuffix(suffix)
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name)[:40] or "visit"
