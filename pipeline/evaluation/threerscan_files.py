"""The annotation files of 3RScan (Wald et al., ICCV 2019): ``3RScan.json``, ``semseg.v2.json``, labelled PLY.

What goes wrong silently elsewhere, and is settled here:

- Matrices are column-major and in metres (the FAQ says millimetres). A matrix that is rigid only when read
  row by row, or shifts by more than a building, is refused.
- ``transform`` of a rescan takes its coordinates to the reference's. ``transform`` of a rigid entry takes
  reference coordinates to the rescan's *own, unaligned* coordinates.
- Scans of the test split list moved instances as bare integers, without transforms.
- Ids are integers in some files and strings in others. They hold within a scene only, and an instance may
  have another id in the rescan.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import is_rigid
from pipeline.errors import InputError

SEMSEG = "semseg.v2.json"
LABELLED_PLY = "labels.instances.annotated.v2.ply"
LARGEST_SHIFT_M = 100.0
_SYMMETRY_ORDER = {0: 1, 1: 2, 2: 4, 3: 0}  # none, every half turn, every quarter turn, any angle


@dataclass(frozen=True)
class RigidEntry:
    """An instance whose pose was annotated in a rescan; it need not have moved.

    Attributes:
        reference_id: instance in the reference.
        rescan_id: the same instance in the rescan.
        symmetry_order: 1 = none, n = n-fold about the up axis, 0 = any angle.
        T_rescan_reference: (4, 4) from reference coordinates to the rescan's own, following the object;
            None in the test split.
    """

    reference_id: int
    rescan_id: int
    symmetry_order: int
    T_rescan_reference: NDArray[np.float64] | None


@dataclass(frozen=True)
class Rescan:
    """A later scan of a scene as ``3RScan.json`` describes it.

    Attributes:
        scan_id: of the rescan.
        reference: scan id of the scene's first scan.
        split: train, validation or test.
        T_reference_rescan: (4, 4) from the rescan's coordinates to the reference's; identity where none is
            given.
        rigid: instances with an annotated pose.
        nonrigid: instances that changed their shape (reference ids).
        removed: instances that are gone (reference ids); the list is not exhaustive.
        ambiguity: groups of instances of the reference that look alike.
    """

    scan_id: str
    reference: str
    split: str
    T_reference_rescan: NDArray[np.float64]
    rigid: tuple[RigidEntry, ...]
    nonrigid: frozenset[int]
    removed: frozenset[int]
    ambiguity: tuple[frozenset[int], ...]


@dataclass(frozen=True)
class AnnotatedScan:
    """Vertices of a scan in its own coordinates with their instances.

    Attributes:
        points: (N, 3) float64 metres, z up.
        instance: (N,) int32, 0 = not annotated.
        names: label of each instance that ``semseg.v2.json`` lists.
    """

    points: NDArray[np.float64]
    instance: NDArray[np.int32]
    names: dict[int, str]


def read_rescan(index: Path, rescan_id: str) -> Rescan:
    """Find a rescan in ``3RScan.json``.

    Raises:
        InputError: the file cannot be read, does not list the rescan, or holds a matrix that is not
            column-major, rigid and in metres.
    """
    for scene in _json(index):
        for scan in scene.get("scans", []):
            if scan.get("reference") == rescan_id:
                return _rescan(index, scene, scan)
        if scene.get("reference") == rescan_id:
            raise InputError(f"{rescan_id} is a reference scan of {index}", "name one of its rescans")
    raise InputError(f"{index} lists no rescan {rescan_id}", "check the scan id")


def read_scan(folder: Path) -> AnnotatedScan:
    """Read the labelled mesh and the instances of a scan folder.

    Raises:
        InputError: a file is missing (rescans of the test split have none), or not in the v2 format.
    """
    groups = _json(folder / SEMSEG).get("segGroups", [])
    names = {int(group.get("objectId", group.get("id"))): str(group.get("label", "")) for group in groups}
    points, instance = _read_labelled_ply(folder / LABELLED_PLY)
    return AnnotatedScan(points, instance, names)


def column_major(values: Any, where: str) -> NDArray[np.float64]:
    """A rigid (4, 4) matrix from 16 numbers, column by column, metres."""
    try:
        numbers = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.zeros(0)
    if numbers.shape != (16,):
        raise InputError(f"{where} is not a list of 16 numbers", "download 3RScan.json again")
    matrix = numbers.reshape(4, 4).T
    if not is_rigid(matrix):
        hint = "its matrices are column-major" if is_rigid(matrix.T) else "download 3RScan.json again"
        raise InputError(f"{where} is no rigid transform read column by column", hint)
    if np.linalg.norm(matrix[:3, 3]) > LARGEST_SHIFT_M:
        raise InputError(f"{where} shifts by {np.linalg.norm(matrix[:3, 3]):.0f} m", "it must be in metres")
    return matrix


def _rescan(index: Path, scene: dict[str, Any], scan: dict[str, Any]) -> Rescan:
    where = f"{index}: rescan {scan['reference']}"
    aligned = np.eye(4)
    if scan.get("transform") is not None:
        aligned = column_major(scan["transform"], f"{where}, transform")
    rigid = []
    for entry in scan.get("rigid", []):
        if not isinstance(entry, dict):  # test split
            rigid.append(RigidEntry(int(entry), int(entry), 1, None))
            continue
        number = int(entry["instance_reference"])
        rigid.append(
            RigidEntry(
                number,
                int(entry.get("instance_rescan", number)),
                _SYMMETRY_ORDER.get(int(entry.get("symmetry", 0)), 1),
                column_major(entry["transform"], f"{where}, rigid {number}"),
            )
        )
    return Rescan(
        scan_id=str(scan["reference"]),
        reference=str(scene["reference"]),
        split=str(scene.get("type", "")),
        T_reference_rescan=aligned,
        rigid=tuple(rigid),
        nonrigid=frozenset(_instance(entry) for entry in scan.get("nonrigid", [])),
        removed=frozenset(_instance(entry) for entry in scan.get("removed", [])),
        ambiguity=_groups(scene.get("ambiguity", [])),
    )


def _instance(entry: Any) -> int:
    return int(entry["instance_reference"] if isinstance(entry, dict) else entry)


def _groups(ambiguity: list[Any]) -> tuple[frozenset[int], ...]:
    """Instances that are tied to each other directly or through others."""
    groups: list[set[int]] = []
    for entry in ambiguity:
        for pair in entry if isinstance(entry, list) else [entry]:
            tied = {int(pair["instance_source"]), int(pair["instance_target"])}
            for group in [group for group in groups if group & tied]:
                tied |= group
                groups.remove(group)
            groups.append(tied)
    return tuple(frozenset(group) for group in groups)


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_bytes())
    except FileNotFoundError:
        raise InputError(
            f"there is no file {path}", "rescans of 3RScan's test split are not annotated; others are"
        ) from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(f"{path} is not valid JSON ({error})", "download it again") from None


def _read_labelled_ply(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Positions and ``objectId`` of the vertices of an ASCII PLY."""
    try:
        with path.open("rb") as file:
            names, count = _header(path, file)
            columns = [names.index(name) for name in ("x", "y", "z", "objectId")]
            values = np.loadtxt(file, max_rows=count, usecols=columns, ndmin=2) if count else np.zeros((0, 4))
    except FileNotFoundError:
        raise InputError(
            f"there is no file {path}", "rescans of 3RScan's test split are not annotated; others are"
        ) from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    except ValueError as error:
        raise InputError(
            f"{path} is not a labelled mesh of 3RScan v2 ({error})", "download it again"
        ) from None
    if len(values) != count:
        raise InputError(f"{path} is truncated: {len(values)} of {count} vertices", "download it again")
    return values[:, :3], values[:, 3].astype(np.int32)


def _header(path: Path, file: Any) -> tuple[list[str], int]:
    names: list[str] = []
    count, inside = -1, False
    for _ in range(100):
        words = file.readline(1024).decode("ascii", "replace").split()
        match words:
            case ["end_header"]:
                return names, count
            case ["format", form, *_] if form != "ascii":
                raise InputError(f"{path} is a PLY of format {form}", f"take {LABELLED_PLY}: v2 is ASCII")
            case ["element", element, number]:
                inside = element == "vertex"
                count = int(number) if inside else count
            case ["property", *_, name] if inside:
                names.append(name)
    raise InputError(f"the header of {path} has no end", "download it again")
