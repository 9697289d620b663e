"""What is true of a pair of visits: labelled points, and how the moved objects truly moved.

``gt.ply`` holds the points (schema of ``pipeline.ply``). Beside it there may be a file of the same name with
the ending ``.json``::

    {"schema_version": 1,
     "motions": [{"object_id": 3, "T_world_motion": [[...], [...], [...], [...]], "symmetry_order": 1}]}

``T_world_motion`` is a rigid 4x4 matrix, row by row, in the world frame: p_current = T p_previous, metres.
``symmetry_order`` says which turns about the object's up axis look alike: 1 = only the full turn,
n = every 1/n of a turn, 0 = any angle.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import is_rigid
from pipeline.errors import InputError
from pipeline.ply import LabelledPoints, read_ply

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Motion:
    """How an object moved between two visits.

    Attributes:
        T_world_motion: (4, 4) rigid, world frame, metres: p_current = T p_previous.
        symmetry_order: 1 = no symmetry about the up axis, n = n-fold, 0 = any angle.
    """

    T_world_motion: NDArray[np.float64]
    symmetry_order: int = 1


@dataclass(frozen=True)
class GroundTruth:
    """Labelled points of all visits, and the motions by true ``object_id`` where they are known."""

    points: LabelledPoints
    motions: Mapping[int, Motion] = field(default_factory=dict)


def read_ground_truth(path: Path | str) -> GroundTruth:
    """Read a ground-truth PLY, and the motions beside it where there are any.

    Raises:
        InputError: no such file, or one that is not in the schema above.
    """
    path = Path(path)
    points = read_ply(path)
    beside = path.with_suffix(".json")
    return GroundTruth(points, read_motions(beside) if beside.exists() else {})


def read_motions(path: Path) -> dict[int, Motion]:
    """Motions by object id from a JSON file in the schema above; raises ``InputError``."""
    try:
        record = json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path} is not valid JSON ({error})", "generate it again") from None
    if not isinstance(record, dict) or record.get("schema_version") != SCHEMA_VERSION:
        found = record.get("schema_version") if isinstance(record, dict) else None
        raise InputError(
            f"{path} has schema version {found}, this program reads {SCHEMA_VERSION}", "generate it again"
        )
    entries = record.get("motions", [])
    if not isinstance(entries, list):
        raise InputError(f"{path}: motions is not a list", "generate it again")
    motions: dict[int, Motion] = {}
    for number, entry in enumerate(entries):
        object_id, motion = _motion(entry, f"{path}: motion {number}")
        if object_id in motions:
            raise InputError(f"{path}: object {object_id} has two motions", "give each object one")
        motions[object_id] = motion
    return motions


def _motion(entry: Any, where: str) -> tuple[int, Motion]:
    if not isinstance(entry, dict):
        raise InputError(f"{where} is not an object", "generate it again")
    object_id, order = entry.get("object_id"), entry.get("symmetry_order", 1)
    if not isinstance(object_id, int) or isinstance(object_id, bool) or object_id < 1:
        raise InputError(f"{where} has the object_id {object_id!r}", "objects are 1, 2, ...")
    if not isinstance(order, int) or isinstance(order, bool) or order < 0:
        raise InputError(f"{where} has the symmetry_order {order!r}", "it is 0 (any angle), 1 (none), 2, ...")
    try:
        matrix = np.asarray(entry.get("T_world_motion"), dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape != (4, 4) or not is_rigid(matrix, tolerance=1e-3):
        raise InputError(
            f"{where} of object {object_id} has no rigid 4x4 T_world_motion",
            "write rotation and translation row by row, metres",
        )
    return object_id, Motion(matrix, order)
