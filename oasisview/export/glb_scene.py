"""``glb``: one named mesh per object and visit in the colour of its label, with its row as extras."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from oasisview import wording
from oasisview.export.exporter import ReviewedResult, Steps, chunk_count
from oasisview.export.object_points import Key, object_parts
from oasisview.export.object_rows import object_rows
from oasisview.export.surfels import OVERLAP, squares, surface_directions, thinned
from oasisview.palette import LIGHT, label_table
from oasisview.scene.ground_plan import GroundPlan
from oasisview.scene.level_of_detail import point_spacing_m, thin
from oasisview.scene.map_points import muted
from oasisview.why import why
from pipeline.progress import Report, silent
from pipeline.result import ChangeLabel, SessionResult
from pipeline.store.files import atomic_file

if TYPE_CHECKING:
    import trimesh

CELL_SPACINGS = 2.0  # a square's cell, in spacings of the map's points
MAX_SQUARES = 300_000  # of the whole file, some 22 MB: what viewers of meshes still turn around
BACKGROUND_POINTS = 120_000  # of each visit


class GlbExporter:
    """glTF 2.0 in one file: metres, y up, one parent node per visit so that visits switch on and off.

    Surfaces are small squares along the measured points. The background of each visit comes along as
    points in its own colours.
    """

    name = "glb"
    suffix = ".glb"
    summary = "3D scene (glTF 2.0): one named mesh per object and visit, coloured by label"

    def write(self, reviewed: ReviewedResult, out_path: Path, report: Report = silent) -> None:
        """Write the file; see ``Exporter.write``."""
        from trimesh.exchange.gltf import export_glb

        sightings = sum(len(item.sightings) for item in reviewed.objects)
        steps = Steps(report, chunk_count(reviewed) + sightings + 1)
        clouds = _object_clouds(reviewed, steps)
        scene = _scene(reviewed, clouds, steps)
        with atomic_file(out_path) as file:
            file.write(export_glb(scene, include_normals=False))
        steps.step()


def _object_clouds(reviewed: ReviewedResult, steps: Steps) -> dict[Key, NDArray[np.float32]]:
    """Map points of every object."""
    parts: dict[Key, list[NDArray[np.float32]]] = {}
    for key, part in object_parts(reviewed, steps):
        parts.setdefault(key, []).append(part)
    return {key: np.concatenate(parts[key]) for key in sorted(parts)}


def _scene(reviewed: ReviewedResult, clouds: dict[Key, NDArray[np.float32]], steps: Steps) -> trimesh.Scene:
    import trimesh

    plan = GroundPlan.of(reviewed.result)
    across, along, up = plan.axes_world
    upright = np.eye(4)  # from the world frame to glTF, whose y axis points up
    upright[:3, :3] = [across, up, -along]
    scene = trimesh.Scene()
    scene.metadata.update(_about(reviewed))
    scene.graph.update(frame_to="site", frame_from=scene.graph.base_frame, matrix=upright)
    for session in reviewed.result.sessions:
        visit = f"session_{session.index}"
        about = {"session": session.index, "visit": session.name, "captured_at": session.captured_at}
        scene.graph.update(frame_to=visit, frame_from="site", matrix=np.eye(4), metadata=about)
        _add_background(scene, reviewed, session, visit)
    materials = _materials()
    surfaces, cell_m = _thinned(clouds)
    extras = {row["id"]: row for row in object_rows(reviewed)}
    limits = wording.Limits.of(reviewed.result)
    objects = {item.object_id: item for item in reviewed.objects}
    for (session_index, object_id), surface in surfaces.items():
        item = objects[object_id]
        label = reviewed.final[object_id].label
        row = _flat(extras[object_id], session_index, why(item, limits))
        centre = surface.mean(axis=0)
        normals = surface_directions(surface - centre)
        vertices, faces = squares(surface - centre, normals, OVERLAP * cell_m)
        mesh = trimesh.Trimesh(vertices, faces, process=False, metadata=row)
        mesh.visual = trimesh.visual.TextureVisuals(material=materials[label])
        name = f"object_{object_id}_session_{session_index}"
        scene.add_geometry(
            mesh,
            node_name=name,
            geom_name=name,
            parent_node_name=f"session_{session_index}",
            transform=trimesh.transformations.translation_matrix(centre),
            metadata=row,
        )
        steps.step()
    return scene


def _add_background(
    scene: trimesh.Scene, reviewed: ReviewedResult, session: SessionResult, visit: str
) -> None:
    """The points of no object, thinned, as a point cloud beside the meshes."""
    import trimesh

    step = max(1, len(session.points_world) // (8 * BACKGROUND_POINTS))
    rest = np.flatnonzero(reviewed.object_ids(session)[::step] == 0) * step
    if len(rest) == 0:
        return
    points = session.points_world[rest]
    kept = thin(points, BACKGROUND_POINTS)
    centre = points[kept].mean(axis=0, dtype=np.float64)
    colours = _linear(muted(session.colours[rest][kept], dark=False) / 255.0)
    rgba = np.concatenate([np.round(colours * 255), np.full((len(kept), 1), 255)], axis=1).astype(np.uint8)
    cloud = trimesh.PointCloud(points[kept] - centre, colors=rgba)
    name = f"background_{visit}"
    about = {"id": 0, "session": session.index, "label": wording.LABEL_NAMES[ChangeLabel.STATIC]}
    scene.add_geometry(
        cloud,
        node_name=name,
        geom_name=name,
        parent_node_name=visit,
        transform=trimesh.transformations.translation_matrix(centre),
        metadata=about,
    )


def _materials() -> dict[ChangeLabel, Any]:
    from trimesh.visual.material import PBRMaterial

    colours = _linear(label_table(LIGHT) / 255.0)
    return {
        label: PBRMaterial(
            name=wording.LABEL_NAMES[label],
            baseColorFactor=np.append(colours[label], 1.0),
            metallicFactor=0.0,
            roughnessFactor=1.0,
            doubleSided=True,
        )
        for label in ChangeLabel
    }


def _linear(srgb: NDArray[np.floating]) -> NDArray[np.float64]:
    """Colours as screens have them to light, which is what glTF factors and vertex colours are."""
    srgb = np.asarray(srgb, np.float64)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _thinned(clouds: dict[Key, NDArray[np.float32]]) -> tuple[dict[Key, NDArray[np.float64]], float]:
    """The points that become squares, and the side of the cells they stand for, metres."""
    if not clouds:
        return {}, 0.0
    cell_m = CELL_SPACINGS * point_spacing_m(max(clouds.values(), key=len))
    while True:
        kept = {key: thinned(cloud, cell_m) for key, cloud in clouds.items()}
        count = sum(map(len, kept.values()))
        # Every object keeps a square, so that many small ones may hold more than is wanted.
        if count <= MAX_SQUARES or count <= 2 * len(clouds):
            return kept, cell_m
        cell_m *= max(1.1, float(np.sqrt(count / MAX_SQUARES)))


def _flat(row: dict[str, Any], session_index: int, why_machine: str) -> dict[str, Any]:
    notes = [f"{note['who']}: {note['text']}" for note in row["notes"]]
    return {
        **row,
        "label": row["label_final"],
        "session": session_index,
        "evidence": why_machine,
        "notes": notes,
    }


def _about(reviewed: ReviewedResult) -> dict[str, Any]:
    return {
        "generator": "oasisview",
        "result": reviewed.result.path.stem,
        "unit": "m",
        "frame": "the node site turns the recordings' world frame, z up, to glTF's y up",
        "sessions": [
            {"session": s.index, "name": s.name, "captured_at": s.captured_at}
            for s in reviewed.result.sessions
        ],
    }
