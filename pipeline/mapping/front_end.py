"""Front-end: one visit becomes a surface, submaps, and features per keyframe (paper, Sec. III-B).

Keyframes stream through: the next one is decoded while this one is processed, and what later stages need
of it goes to disk.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, rotate_points, transform_points
from pipeline.errors import InputError
from pipeline.mapping.accumulation import AccumulatedSubmap
from pipeline.mapping.colours import VoxelColours
from pipeline.mapping.depth_geometry import depth_geometry
from pipeline.mapping.fusion import VoxelFusion
from pipeline.mapping.keyframe_store import MAX_STORED_DEPTH_M, KeyframeStore
from pipeline.mapping.submap import SubmapSurfaces, TsdfGrid, TsdfSubmap
from pipeline.mapping.surface import FusedSurface
from pipeline.perception.protocols import FeatureExtractor
from pipeline.session import Frame, Session
from pipeline.settings import Settings

_COLOUR_BLUR_PX = 3


@dataclass(frozen=True)
class MappedKeyframe:
    """A keyframe that made it into the map.

    Attributes:
        frame_index: the archive's number of the frame.
        camera: intrinsics at processing size.
        submap: the submap of N_sub keyframes it belongs to.
    """

    frame_index: int
    timestamp_s: float | None
    camera: PinholeCamera
    T_world_camera: NDArray[np.float64]
    submap: int


@dataclass(frozen=True)
class SessionGeometry:
    """The front-end's output for one visit, before objects.

    Attributes:
        keyframes: in recording order; arrays below that are per keyframe follow it.
        surface: the fused voxels, M of them.
        first_keyframe: (M,) the keyframe that first met each voxel.
        log_colours: (M, 3) mean log RGB, exposure taken out.
        log_gains: (N, 3) log exposure gain of each keyframe against the visit's own colours.
        submaps: renders the finished submaps.
        store: depth, colour and voxels of the keyframes at the geometry stride.
        stride: the geometry stride, pixels.
    """

    keyframes: tuple[MappedKeyframe, ...]
    surface: FusedSurface
    first_keyframe: NDArray[np.int32]
    log_colours: NDArray[np.float32]
    log_gains: NDArray[np.float64]
    submaps: SubmapSurfaces
    store: KeyframeStore
    stride: int

    @property
    def submap_count(self) -> int:
        """Number of submaps."""
        return self.keyframes[-1].submap + 1

    def strided_camera(self, k: int) -> PinholeCamera:
        """Camera of the stored arrays of keyframe ``k``."""
        return self.keyframes[k].camera.strided(self.stride)


def reopen_stores(
    folder: Path, voxel_size_m: float, settings: Settings
) -> tuple[KeyframeStore, SubmapSurfaces]:
    """The stores of per-keyframe arrays and submaps in a folder."""
    max_depth_m = min(settings.image.max_depth_m, MAX_STORED_DEPTH_M)
    grid = TsdfGrid(voxel_size_m, settings.surface.truncation_voxels, max_depth_m)
    return KeyframeStore(folder), SubmapSurfaces(folder, grid)


@dataclass(frozen=True)
class KeyframeSinks:
    """Where the lasting products of each keyframe go, by the archive's frame number."""

    image: Callable[[int, NDArray[np.uint8]], None]
    features: Callable[[int, NDArray[np.float16]], None]


def map_session(
    session: Session,
    frame_positions: Sequence[int],
    voxel_size_m: float,
    extractor: FeatureExtractor,
    settings: Settings,
    folder: Path,
    sinks: KeyframeSinks,
    *,
    on_keyframe: Callable[[int], None],
    warn: Callable[[str], None],
) -> SessionGeometry:
    """Map one visit.

    Args:
        session: the visit.
        frame_positions: which of its frames are keyframes.
        voxel_size_m: edge of a voxel.
        extractor: makes the dense feature maps.
        settings: of the run.
        folder: where per-keyframe arrays and submaps go.
        sinks: where images and features go.
        on_keyframe: called with the number of keyframes done.
        warn: called with one line for each frame that had to be left out.

    Raises:
        InputError: fewer than two keyframes could be read.
    """
    stride = settings.image.geometry_stride
    builder = _GeometryBuilder(voxel_size_m, settings, folder, is_lidar=session.depth_source == "lidar")
    for done, frame, rgb, depth in _decoded(session, frame_positions, settings, warn):
        sinks.image(frame.index, rgb)
        sinks.features(frame.index, extractor.describe(rgb))
        depth = np.where(depth <= builder.max_depth_m, depth, 0)[::stride, ::stride]
        small = np.ascontiguousarray(cv2.blur(rgb, (_COLOUR_BLUR_PX, _COLOUR_BLUR_PX))[::stride, ::stride])
        builder.add(frame.index, frame.timestamp_s, frame.camera, frame.T_world_camera, depth, small)
        on_keyframe(done)
    if builder.keyframe_count < 2:
        raise InputError(
            f"{session.path}: only {builder.keyframe_count} of {len(frame_positions)} keyframes can be used",
            "a visit needs at least 2; `oasisview check` says what is wrong with the others",
        )
    return builder.finish()


def map_again(
    geometry: SessionGeometry,
    poses: Sequence[NDArray[np.float64]],
    settings: Settings,
    folder: Path,
    *,
    is_lidar: bool,
) -> SessionGeometry:
    """A mapped visit fused anew with other poses, from what is stored of its keyframes.

    Args:
        geometry: the visit.
        poses: (4, 4) ``T_world_camera`` of each keyframe.
        settings: of the run.
        folder: where the new per-keyframe arrays and submaps go; not the visit's own.
        is_lidar: whether a LiDAR measured the depth.
    """
    builder = _GeometryBuilder(geometry.surface.voxel_size_m, settings, folder, is_lidar=is_lidar)
    for k, (keyframe, pose) in enumerate(zip(geometry.keyframes, poses, strict=True)):
        depth, small = geometry.store.depth(k), geometry.store.rgb(k)
        builder.add(keyframe.frame_index, keyframe.timestamp_s, keyframe.camera, pose, depth, small)
    return builder.finish()


class _GeometryBuilder:
    """The geometry of a visit under construction, keyframe by keyframe."""

    def __init__(self, voxel_size_m: float, settings: Settings, folder: Path, *, is_lidar: bool) -> None:
        self._settings = settings
        self._is_lidar = is_lidar
        self._voxel_size_m = voxel_size_m
        self._store, self._submaps = reopen_stores(folder, voxel_size_m, settings)
        self._fusion, self._colours = VoxelFusion(voxel_size_m), VoxelColours()
        self._submap = self._new_submap()
        self._submap_index = 0
        self._keyframes: list[MappedKeyframe] = []

    @property
    def max_depth_m(self) -> float:
        """Farther depth is not mapped."""
        return min(self._settings.image.max_depth_m, MAX_STORED_DEPTH_M)

    @property
    def keyframe_count(self) -> int:
        """Keyframes added so far."""
        return len(self._keyframes)

    def add(
        self,
        frame_index: int,
        timestamp_s: float | None,
        camera: PinholeCamera,
        T_world_camera: NDArray[np.float64],
        depth: NDArray[np.float32],
        small: NDArray[np.uint8],
    ) -> None:
        """Fuse depth (h, w) metres and blurred colour (h, w, 3), strided; ``camera`` is the whole one."""
        settings = self._settings
        strided = camera.strided(settings.image.geometry_stride)
        geometry = depth_geometry(depth, strided, settings.surface.min_incidence_cosine)
        reliable = geometry.is_reliable
        points = transform_points(T_world_camera, geometry.points_camera[reliable])
        normals = rotate_points(T_world_camera[:3, :3], geometry.normals_camera[reliable])
        lab = cv2.cvtColor(small.astype(np.float32) / 255, cv2.COLOR_RGB2Lab)
        voxels = np.full(depth.shape, -1, np.int32)
        voxels[reliable] = self._fusion.add(points, normals, lab[reliable], T_world_camera)
        self._colours.add(voxels[reliable], small[reliable])
        self._store.save(len(self._keyframes), depth, small, voxels)
        if self._submap.keyframe_count == settings.keyframes.submap_size:
            self._submap.save(self._submaps.path(self._submap_index))
            self._submap, self._submap_index = self._new_submap(), self._submap_index + 1
        self._submap.integrate(depth, strided, T_world_camera)
        self._keyframes.append(
            MappedKeyframe(frame_index, timestamp_s, camera, T_world_camera, self._submap_index)
        )

    def finish(self) -> SessionGeometry:
        """What was built."""
        self._submap.save(self._submaps.path(self._submap_index))
        surface, remap, first_keyframe = self._fusion.finish(self._settings.surface.min_samples)
        self._store.remap = remap
        return SessionGeometry(
            keyframes=tuple(self._keyframes),
            surface=surface,
            first_keyframe=first_keyframe,
            log_colours=self._colours.finish(remap, len(surface.points_world)),
            log_gains=np.array(self._colours.log_gains).reshape(-1, 3),
            submaps=self._submaps,
            store=self._store,
            stride=self._settings.image.geometry_stride,
        )

    def _new_submap(self) -> TsdfSubmap | AccumulatedSubmap:
        if self._is_lidar:
            return AccumulatedSubmap(self._voxel_size_m)
        max_depth_m = self.max_depth_m
        return TsdfSubmap(TsdfGrid(self._voxel_size_m, self._settings.surface.truncation_voxels, max_depth_m))


def _decoded(
    session: Session, positions: Sequence[int], settings: Settings, warn: Callable[[str], None]
) -> Iterator[tuple[int, Frame, NDArray[np.uint8], NDArray[np.float32]]]:
    """Frames at processing size, the next one decoded in the background; unreadable ones are warned about."""
    with ThreadPoolExecutor(max_workers=1) as decoder:
        pending = None
        for number, position in enumerate([*positions, None]):
            following = (
                None if position is None else decoder.submit(_decode, session.frames[position], settings)
            )
            if pending is not None:
                try:
                    frame, rgb, depth = pending.result()
                except InputError as error:
                    warn(f"frame left out: {error}")
                else:
                    yield number, frame, rgb, depth
            pending = following


def _decode(frame: Frame, settings: Settings) -> tuple[Frame, NDArray[np.uint8], NDArray[np.float32]]:
    rgb, depth = frame.load_rgb(), frame.load_depth()
    camera = frame.camera
    if camera.width > settings.image.max_width:
        width = settings.image.max_width
        height = round(camera.height * width / camera.width)
        camera = camera.resized(width, height)
        rgb = np.asarray(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        # Averaging depth over an edge would invent surfaces between foreground and background.
        depth = np.asarray(cv2.resize(depth, (width, height), interpolation=cv2.INTER_NEAREST), np.float32)
        frame = replace(frame, camera=camera)
    return frame, rgb, depth
