"""One visit as a reader yields it: frames whose images load only when asked for.

Readers undistort and register what they read, so that everything after them sees a pinhole camera
with colour and depth of one size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera

DepthSource = Literal["sensor", "lidar", "learned"]


@dataclass(frozen=True)
class Frame:
    """One posed RGB-D image of an archive.

    Attributes:
        index: position in the archive, counted from 0 and never renumbered: it names exported files.
        name: what the archive calls the frame (a file name), for messages.
        camera: intrinsics of the undistorted colour image, (width, height) of what the loaders return.
        T_world_camera: (4, 4) float64, OpenCV camera to metric world.
        timestamp_s: seconds, or None.
        load_rgb: returns (height, width, 3) uint8 RGB; raises ``InputError`` naming an unreadable file.
        load_depth: returns (height, width) float32 metres, 0 = no measurement; raises like ``load_rgb``.
        files: the files the frame is made of, for hashing.
    """

    index: int
    name: str
    camera: PinholeCamera
    T_world_camera: NDArray[np.float64]
    timestamp_s: float | None
    load_rgb: Callable[[], NDArray[np.uint8]]
    load_depth: Callable[[], NDArray[np.float32]]
    files: tuple[Path, ...] = ()


@dataclass(frozen=True)
class GeographicOrigin:
    """Where on Earth the world frame stands: its z axis is up there.

    Attributes:
        latitude_deg, longitude_deg: WGS 84; altitude_m: above its ellipsoid.
        y_axis_azimuth_deg: direction of the world's y axis, clockwise from north.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = 0.0
    y_axis_azimuth_deg: float = 0.0


@dataclass(frozen=True)
class Session:
    """One visit: posed frames in a metric world frame shared by the visits that are compared.

    Attributes:
        name: what people call the visit.
        path: the archive as the user gave it.
        format: the reader that opened it ("nerfstudio", "tum", "3rscan", "7scenes", ...).
        frames: in recording order; frames that cannot be used are left out and named in ``warnings``.
        depth_source: what measured the depth; chooses the keyframe thresholds and the fusion.
        captured_at: ISO 8601, or None.
        is_sparse: the archive holds keyframes already (readers leave this None: decided from the poses).
        metadata_files: files besides the frames' that define the session, for hashing.
        warnings: one finished line each about what was left out or repaired.
        frames_left_out: how many frames of the archive are not in ``frames``.
        origin: where on Earth the world frame stands, or None.
    """

    name: str
    path: Path
    format: str
    frames: tuple[Frame, ...]
    depth_source: DepthSource = "sensor"
    captured_at: str | None = None
    is_sparse: bool | None = None
    metadata_files: tuple[Path, ...] = ()
    warnings: tuple[str, ...] = ()
    frames_left_out: int = 0
    origin: GeographicOrigin | None = None
