"""One row per object: the numbers behind ``csv`` and ``json``, with units in the names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from oasisview.export.exporter import ReviewedResult
from pipeline.result import MapObject, Result

_DECIMALS = 6
_AXES = ("x", "y", "z")


def object_rows(reviewed: ReviewedResult) -> list[dict[str, Any]]:
    """Rows in ascending ``id``; every row has the same keys, None where something does not apply.

    ``centroid_*`` and ``extent_*`` are of the latest visit that saw the object, ``from_*`` is the
    centroid in the first visit where there were several. ``counterpart_id`` is the best match in the
    other visit, chosen or rejected (its own id for an object of both visits). ``confidence`` is the
    machine's, of its own label. ``decided_*`` and ``why`` belong to the person whose label stands.
    ``machine_ids`` are the objects of the machine that people made this one of (its own id where nobody
    corrected it); ``label_machine`` is that of the largest. What people said is no object has no row.
    """
    return [_row(reviewed, item) for item in reviewed.objects]


def _row(reviewed: ReviewedResult, item: MapObject) -> dict[str, Any]:
    final = reviewed.final[item.object_id]
    first, last = (item.sightings[0], item.sightings[-1]) if item.sightings else (None, None)
    several = len(item.sightings) > 1
    return {
        "id": item.object_id,
        "label_machine": reviewed.machine_label(item.object_id).name.lower(),
        "label_final": final.label.name.lower(),
        "machine_ids": list(reviewed.corrected.objects[item.object_id].machine_ids),
        "sessions_seen": [sighting.session for sighting in item.sightings],
        **_xyz("centroid", last.centroid_world_m if last else None),
        **_xyz("extent", last.extent_m if last else None),
        **_xyz("from", first.centroid_world_m if first and several else None),
        "displacement_m": _rounded(item.displacement_m),
        "rotation_rad": _rounded(item.rotation_rad),
        "sigma": _rounded(item.sigma),
        "s_bar": _rounded(item.s_bar),
        "coverage": _rounded(item.coverage),
        "case": item.case.value,
        "counterpart_id": _counterpart_id(reviewed.result, item),
        "replaced_by": item.replaced_by,
        "replaces": item.replaces,
        "confidence": _rounded(item.confidence),
        "decided_by": final.decided_by,
        "decided_at": final.decided_at,
        "why": final.why,
        "notes": [
            {"who": note.who, "at": note.at, "text": note.why} for note in reviewed.notes_of(item.object_id)
        ],
    }


def _counterpart_id(result: Result, item: MapObject) -> int | None:
    """``counterpart_instance`` is a row or column of the score matrix: which object stands there?"""
    if len(item.sightings) > 1:
        return item.object_id
    if item.counterpart_instance is None or not item.sightings:
        return None
    matrix = result.score_matrix
    ids = matrix.column_object_ids if item.sightings[0].session == 0 else matrix.row_object_ids
    if item.counterpart_instance >= len(ids):
        return None
    return int(ids[item.counterpart_instance]) or None  # 0: somebody said it is no object


def _xyz(name: str, values: Sequence[float] | None) -> dict[str, float | None]:
    return {
        f"{name}_{axis}_m": _rounded(None if values is None else values[i]) for i, axis in enumerate(_AXES)
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(float(value), _DECIMALS)
