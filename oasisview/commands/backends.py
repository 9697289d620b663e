"""Perception backends that this version knows of, and which of them it holds."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.errors import InputError


@dataclass(frozen=True)
class Backend:
    """One way of seeing; ``available`` backends can be chosen."""

    kind: str
    name: str
    available: bool
    weights: str
    about: str


_LATER = "not in this version"

BACKENDS = (
    Backend(
        "features", "embedded", True, "built in, none needed", "gradients and colour, 168 numbers a patch"
    ),
    Backend("features", "dinov3", False, _LATER, "foundation model"),
    Backend(
        "masks", "embedded", True, "built in, none needed", "objects on their supports, refined by change"
    ),
    Backend("masks", "sam2", False, _LATER, "foundation model"),
    Backend("depth", "archive", True, "none needed", "the depth that the archive holds"),
    Backend("depth", "depth-anything", False, _LATER, "foundation model"),
)


def require_backend(kind: str, name: str) -> None:
    """``InputError`` unless the backend can be chosen."""
    known = [backend for backend in BACKENDS if backend.kind == kind]
    usable = ", ".join(backend.name for backend in known if backend.available)
    for backend in known:
        if backend.name == name:
            if not backend.available:
                raise InputError(f"{kind} backend {name} is not in this version", f"choose {usable}")
            return
    raise InputError(f"there is no {kind} backend {name!r}", f"choose {usable}")
