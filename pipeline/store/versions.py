"""Versions of what computed a result, read from package metadata (nothing heavy is imported)."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

import pipeline

_DISTRIBUTIONS = {
    "numpy": ("numpy",),
    "torch": ("torch",),
    "open3d": ("open3d", "open3d-cpu"),
    "opencv": ("opencv-python-headless", "opencv-python", "opencv-contrib-python"),
}


def library_versions() -> dict[str, str]:
    """Versions of python, numpy, torch, open3d, opencv and oasisview; "absent" where not installed."""
    versions = {"python": platform.python_version(), "oasisview": pipeline.__version__}
    for name, distributions in _DISTRIBUTIONS.items():
        versions[name] = "absent"
        for distribution in distributions:
            try:
                versions[name] = version(distribution)
                break
            except PackageNotFoundError:
                continue
    return versions
