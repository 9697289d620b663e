"""Generated pairs of visits, kept in a cache folder and made again when the generator's code changes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

import pipeline.synthetic
from pipeline.errors import InputError
from pipeline.settings import Settings
from pipeline.synthetic import generate

DEFAULT_CACHE = Path(".oasisview/scenes")


def generated_pair(cache: Path, scene: str, seed: int, frames: int) -> Path:
    """Folder with ``s0``, ``s1`` and ``gt.ply``; its name changes with the generator's code."""
    digest = hashlib.sha256()
    for source in sorted(Path(pipeline.synthetic.__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    pair = cache / f"{scene}-{seed}-{frames}-{digest.hexdigest()[:10]}"
    if not (pair / "gt.ply").exists():
        generate(scene, pair, seed, frames)
    return pair


def settings_with(overrides: Sequence[str]) -> Settings:
    """Default settings with ``section.name=value`` replaced; ``InputError`` for what does not exist."""
    settings = Settings()
    for override in overrides:
        name, equals, value = override.partition("=")
        if not equals:
            raise InputError(f"{override!r} names no value", "write section.name=value")
        settings = settings.override(name.strip(), value.strip())
    return settings
