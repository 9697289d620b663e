"""The keyframes of a visit as cameras in the map, and the path of the robot through them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import viser

from oasisview.scene import outlines
from oasisview.scene.map_points import MapPoints
from pipeline.result import SessionResult


def draw_cameras(
    scene: viser.SceneApi,
    session: SessionResult,
    visit: int,
    map_points: MapPoints,
    on_keyframe: Callable[[int, int], None],
) -> None:
    """Add ``/map/keyframes``, ``/map/path`` and what catches clicks on them, ``/map/keyframes_pick``.

    ``on_keyframe`` is called with the visit and the keyframe that was clicked.
    """
    if not session.keyframes:
        return
    grey = (150, 156, 166) if visit == 0 else (88, 96, 108)
    corners = np.stack(
        [
            outlines.frustum_corners(
                k.camera, map_points.local_pose(k.T_world_camera), map_points.frustum_depth_m
            )
            for k in session.keyframes
        ]
    )
    segments = np.concatenate([c[outlines.FRUSTUM_EDGES] for c in corners])
    scene.add_line_segments(
        f"/map/keyframes/{visit}", segments, grey, thickness=1.2, thickness_units="screen"
    )
    if len(session.keyframes) > 1:
        scene.add_line_segments(
            f"/map/path/{visit}",
            outlines.path_segments(corners[:, 0]),
            grey,
            thickness=2.5,
            thickness_units="screen",
        )
    vertices, faces = outlines.box_mesh()
    size = np.maximum(np.ptp(corners, axis=1), 0.02).astype(np.float32)
    middle = ((corners.min(axis=1) + corners.max(axis=1)) / 2).astype(np.float32)
    handle = scene.add_batched_meshes_simple(
        f"/map/keyframes_pick/{visit}",
        vertices,
        faces,
        np.tile(np.array([1.0, 0, 0, 0], np.float32), (len(middle), 1)),
        middle,
        batched_scales=size,
        opacity=0.0,
        lod="off",
        cast_shadow=False,
        receive_shadow=False,
    )

    @handle.on_click
    def _(event: viser.SceneNodePointerEvent[viser.BatchedMeshHandle]) -> None:
        if event.instance_index is not None:
            on_keyframe(visit, int(event.instance_index))
