"""The engine of oasisview: two visits of a place in, an object-level change map out (OASIS-Map).

``pipeline.run(previous, current, settings=...)`` computes a change map, ``pipeline.open_result(path)`` opens
one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from pipeline.store import open_result
    from pipeline.system import run

__all__ = ["__version__", "open_result", "run"]


def __getattr__(name: str) -> Any:
    # Loaded when asked for: the command answers --help without importing torch and Open3D.
    if name == "run":
        from pipeline.system import run

        return run
    if name == "open_result":
        from pipeline.store import open_result

        return open_result
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
