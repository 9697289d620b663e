"""Labelled points of all visits as one PLY file: the schema of exports and of ground truth.

Binary little-endian, one ``vertex`` element: ``x y z`` float32 (world, metres), ``red green blue`` uchar,
``session`` uchar, ``label`` uchar, ``object_id`` int32, ``confidence`` float32.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError, StorageError

NOT_SCORED = 255  # label of ground truth that the other visit never looked at

VERTEX_DTYPE = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("red", "u1"),
        ("green", "u1"),
        ("blue", "u1"),
        ("session", "u1"),
        ("label", "u1"),
        ("object_id", "<i4"),
        ("confidence", "<f4"),
    ]
)
_PLY_NAME = {"f4": "float", "u1": "uchar", "i4": "int"}
_NUMPY_CODE = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
_MAX_HEADER_LINES = 200


@dataclass(frozen=True)
class LabelledPoints:
    """Points of one or more visits with what is known about each.

    Attributes:
        points_world: (N, 3) float32 metres.
        colours: (N, 3) uint8 RGB.
        session: (N,) uint8, 0 = previous, 1 = current, ...
        label: (N,) uint8 ``ChangeLabel`` code; 255 = not scored (ground truth only).
        object_id: (N,) int32, 0 = background.
        confidence: (N,) float32 in [0, 1].
    """

    points_world: NDArray[np.float32]
    colours: NDArray[np.uint8]
    session: NDArray[np.uint8]
    label: NDArray[np.uint8]
    object_id: NDArray[np.int32]
    confidence: NDArray[np.float32]

    def __post_init__(self) -> None:
        count = len(self.points_world)
        for name in ("points_world", "colours"):
            if getattr(self, name).shape != (count, 3):
                raise ValueError(f"{name}: expected ({count}, 3), got {getattr(self, name).shape}")
        for name in ("session", "label", "object_id", "confidence"):
            if getattr(self, name).shape != (count,):
                raise ValueError(f"{name}: expected ({count},), got {getattr(self, name).shape}")

    def __len__(self) -> int:
        return len(self.points_world)

    def select(self, chosen: NDArray[np.bool_] | NDArray[np.integer]) -> LabelledPoints:
        """The points that a boolean mask or an index array picks."""
        return LabelledPoints(
            self.points_world[chosen],
            self.colours[chosen],
            self.session[chosen],
            self.label[chosen],
            self.object_id[chosen],
            self.confidence[chosen],
        )


def write_ply(path: Path, points: LabelledPoints) -> None:
    """Write points in the schema above, atomically (a file beside it is renamed at the end).

    Raises:
        StorageError: the folder is missing or cannot be written, or the disk is full.
    """
    path = Path(path)
    vertices = np.empty(len(points), dtype=VERTEX_DTYPE)
    for axis, name in enumerate(("x", "y", "z")):
        vertices[name] = points.points_world[:, axis]
    for channel, name in enumerate(("red", "green", "blue")):
        vertices[name] = points.colours[:, channel]
    for name in ("session", "label", "object_id", "confidence"):
        vertices[name] = getattr(points, name)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with unfinished.open("wb") as file:
            file.write(ply_header(len(points)))
            file.write(vertices.tobytes())
        unfinished.replace(path)
    except OSError as error:
        unfinished.unlink(missing_ok=True)
        raise StorageError(f"cannot write {path}: {error.strerror or error}") from None


def read_ply(path: Path) -> LabelledPoints:
    """Read points in the schema above; properties may come in any order, others are ignored.

    Missing colours read as grey, a missing ``session`` as 0, a missing ``confidence`` as 1.

    Raises:
        InputError: no such file, not a binary little-endian PLY, truncated, or without
            ``x y z label object_id``.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            count, dtype = _read_header(path, file)
            vertices = np.fromfile(file, dtype=dtype, count=count)
    except FileNotFoundError:
        raise InputError(f"there is no file {path}") from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    if len(vertices) != count:
        raise InputError(
            f"{path} is truncated: its header promises {count} points, it holds {len(vertices)}",
            "write or copy it again",
        )
    names = dtype.names or ()
    for name in ("x", "y", "z", "label", "object_id"):
        if name not in names:
            raise InputError(f"{path} has no property {name!r}", "it needs x y z session label object_id")

    def column(name: str, kind: type, default: float) -> NDArray:
        return vertices[name].astype(kind) if name in names else np.full(count, default, dtype=kind)

    return LabelledPoints(
        points_world=np.stack([column(name, np.float32, 0) for name in ("x", "y", "z")], axis=1),
        colours=np.stack([column(name, np.uint8, 128) for name in ("red", "green", "blue")], axis=1),
        session=column("session", np.uint8, 0),
        label=column("label", np.uint8, 0),
        object_id=column("object_id", np.int32, 0),
        confidence=column("confidence", np.float32, 1),
    )


def ply_header(count: int) -> bytes:
    """Everything before the first of ``count`` records of ``VERTEX_DTYPE``, for writing them in chunks."""
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    for name in VERTEX_DTYPE.names or ():
        code = VERTEX_DTYPE[name].str[1:]
        lines.append(f"property {_PLY_NAME[code]} {name}")
    return ("\n".join([*lines, "end_header"]) + "\n").encode("ascii")


def _read_header(path: Path, file: BinaryIO) -> tuple[int, np.dtype]:
    """Vertex count and record type; leaves ``file`` at the first vertex."""
    if file.readline(16).strip() != b"ply":
        raise InputError(f"{path} is not a PLY file")
    fields: list[tuple[str, str]] = []
    count, elements = -1, 0
    for _ in range(_MAX_HEADER_LINES):
        words = file.readline(1024).decode("ascii", "replace").split()
        match words:
            case ["end_header"]:
                break
            case ["format", form, *_] if form != "binary_little_endian":
                raise InputError(f"{path} is a PLY of format {form}", "save it as binary_little_endian")
            case ["element", name, number]:
                elements += 1
                if elements == 1 and name == "vertex" and number.isdigit():
                    count = int(number)
            case ["property", "list", *_] if elements == 1:
                raise InputError(f"{path} has a list among its vertex properties", "save plain points")
            case ["property", kind, name] if elements == 1:
                if kind not in _NUMPY_CODE or name in dict(fields):
                    raise InputError(f"{path} has a property {name!r} of type {kind!r} that cannot be read")
                fields.append((name, "<" + _NUMPY_CODE[kind]))
    else:
        raise InputError(f"the header of {path} has no end", "write or copy it again")
    if count < 0 or not fields:
        raise InputError(f"{path} does not begin with vertices", "save plain points")
    return count, np.dtype(fields)
