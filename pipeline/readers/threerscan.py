"""3RScan scans (Wald et al., ICCV 2019): colour and depth share a pose but differ in size and calibration.

The device was held upright while its images are stored sideways: every frame is turned by 90 degrees
clockwise, intrinsics and pose with it, because features of sideways images are worse.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.errors import InputError
from pipeline.readers.assembly import FrameCollector
from pipeline.readers.filetree import FileTree, SubTree
from pipeline.readers.images import read_colour, read_counts
from pipeline.readers.intrinsics import checked_camera
from pipeline.readers.numbered import numbered_frames
from pipeline.readers.packed import open_packed
from pipeline.session import Frame, Session
from pipeline.settings import ArchiveSettings

INFO = "_info.txt"
SEQUENCE, SEQUENCE_ZIP = "sequence", "sequence.zip"
COLOUR, DEPTH = ".color.jpg", ".depth.pgm"

# The upright camera has x' = -y and y' = x of the stored one.
R_UPRIGHT_STORED = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def upright_camera(stored: PinholeCamera) -> PinholeCamera:
    """Intrinsics after the image is turned by 90 degrees clockwise."""
    return PinholeCamera(
        width=stored.height,
        height=stored.width,
        fx=stored.fy,
        fy=stored.fx,
        cx=stored.height - 1 - stored.cy,
        cy=stored.cx,
    )


def upright_pose(T_world_stored: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pose of the camera whose image is turned by 90 degrees clockwise, (4, 4) camera-to-world."""
    T_world_upright = T_world_stored.copy()
    T_world_upright[:3, :3] = T_world_stored[:3, :3] @ R_UPRIGHT_STORED.T
    return T_world_upright


@lru_cache(maxsize=8)
def depth_lookup(
    colour: PinholeCamera, depth: PinholeCamera
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """Nearest depth row of each colour row, (H,), column of each column, (W,), and which exist, (H, W).

    Both cameras share centre and axes, so that a ray's place in the depth image does not depend on depth.
    """
    x = (np.arange(colour.width) - colour.cx) / colour.fx
    y = (np.arange(colour.height) - colour.cy) / colour.fy
    columns = np.floor(x * depth.fx + depth.cx + 0.5).astype(np.intp)
    rows = np.floor(y * depth.fy + depth.cy + 0.5).astype(np.intp)
    seen_rows = (rows >= 0) & (rows < depth.height)
    seen_columns = (columns >= 0) & (columns < depth.width)
    return (
        np.clip(rows, 0, depth.height - 1),
        np.clip(columns, 0, depth.width - 1),
        seen_rows[:, None] & seen_columns[None, :],
    )


@dataclass(frozen=True)
class Calibration:
    """What ``_info.txt`` says: cameras of the images as stored."""

    colour: PinholeCamera
    depth: PinholeCamera
    metres_per_count: float


@dataclass(frozen=True)
class SidewaysImages:
    """The two images of a frame as stored."""

    tree: FileTree
    colour: str
    depth: str
    calibration: Calibration

    def load_rgb(self) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 RGB, upright."""
        image = read_colour(self.tree, self.colour)
        _check_size(self.tree, self.colour, "colour", image.shape, self.calibration.colour)
        return np.ascontiguousarray(np.rot90(image, k=-1))

    def load_depth(self) -> NDArray[np.float32]:
        """(H, W) float32 metres of the upright colour camera; 0 = no measurement."""
        counts = read_counts(self.tree, self.depth)
        _check_size(self.tree, self.depth, "depth", counts.shape, self.calibration.depth)
        rows, columns, seen = depth_lookup(self.calibration.colour, self.calibration.depth)
        registered = np.where(seen, counts[np.ix_(rows, columns)], 0).astype(np.float32)
        return np.ascontiguousarray(
            np.rot90(registered * np.float32(self.calibration.metres_per_count), k=-1)
        )


class ThreeRScanReader:
    """Reader of a scan folder, its ``sequence`` folder, or its ``sequence.zip``."""

    name = "3rscan"
    looks_for = f"{INFO}, {SEQUENCE}/{INFO} or {SEQUENCE_ZIP}"

    def matches(self, tree: FileTree) -> bool:
        """See :class:`pipeline.readers.reader.Reader`."""
        return any(tree.has(name) for name in (INFO, f"{SEQUENCE}/{INFO}", SEQUENCE_ZIP))

    def read(self, tree: FileTree, settings: ArchiveSettings) -> Session:
        """See :class:`pipeline.readers.reader.Reader`."""
        sequence = _sequence(tree, settings)
        calibration = read_calibration(sequence)
        camera = upright_camera(calibration.colour)
        collector = FrameCollector(sequence)
        for found in numbered_frames(collector, "", COLOUR, DEPTH):
            images = SidewaysImages(sequence, found.colour, found.depth, calibration)
            collector.frames.append(
                Frame(
                    index=found.index,
                    name=found.stem,
                    camera=camera,
                    T_world_camera=upright_pose(found.T_world_camera),
                    timestamp_s=None,
                    load_rgb=images.load_rgb,
                    load_depth=images.load_depth,
                    files=sequence.sources(found.colour, found.depth, found.pose),
                )
            )
        return collector.session(format=self.name, metadata=(INFO,), path=tree.path)


def _sequence(tree: FileTree, settings: ArchiveSettings) -> FileTree:
    if tree.has(INFO):
        return tree
    if tree.has(f"{SEQUENCE}/{INFO}"):
        return SubTree(tree, SEQUENCE)
    packed = tree.sources(SEQUENCE_ZIP)[0]
    if packed.name != SEQUENCE_ZIP:
        raise InputError(f"{tree.where(SEQUENCE_ZIP)} is an archive inside an archive", f"unpack {packed}")
    sequence: FileTree = open_packed(packed, settings)
    if not sequence.has(INFO) and sequence.has(f"{SEQUENCE}/{INFO}"):
        sequence = SubTree(sequence, SEQUENCE)
    return sequence


def read_calibration(tree: FileTree) -> Calibration:
    """The cameras in ``_info.txt``.

    Raises:
        InputError: the file or a value in it is missing, malformed or absurd.
    """
    where = tree.where(INFO)
    values: dict[str, list[float]] = {}
    for line in tree.read(INFO).decode("utf-8", errors="replace").splitlines():
        key, _, text = line.partition("=")
        try:
            values[key.strip()] = [float(word) for word in text.split()]
        except ValueError:
            continue  # texts such as the name of the device
    colour, depth = (_camera(values, kind, where) for kind in ("Color", "Depth"))
    counts_per_metre = _numbers(values, "m_depthShift", 1, where)[0]
    if not counts_per_metre > 0:
        raise InputError(f"{where}: m_depthShift is {counts_per_metre:g}", "counts per metre are > 0")
    for key in ("m_calibrationColorExtrinsic", "m_calibrationDepthExtrinsic"):
        if not np.allclose(values.get(key, np.eye(4).ravel()), np.eye(4).ravel(), atol=1e-4):
            raise InputError(f"{where}: {key} is not the identity", "depth must be registered to colour")
    return Calibration(colour, depth, metres_per_count=1.0 / counts_per_metre)


def _camera(values: dict[str, list[float]], kind: str, where: str) -> PinholeCamera:
    K = _numbers(values, f"m_calibration{kind}Intrinsic", 16, where)
    camera = PinholeCamera(
        width=int(_numbers(values, f"m_{kind.lower()}Width", 1, where)[0]),
        height=int(_numbers(values, f"m_{kind.lower()}Height", 1, where)[0]),
        fx=K[0],
        fy=K[5],
        cx=K[2],
        cy=K[6],
    )
    return checked_camera(camera, where)


def _numbers(values: dict[str, list[float]], key: str, count: int, where: str) -> list[float]:
    found = values.get(key)
    if found is None or len(found) != count or not np.isfinite(found).all():
        raise InputError(f"{where}: {key!r} is missing or malformed", f"{count} number(s) are expected")
    return found


def _check_size(tree: FileTree, name: str, kind: str, shape: tuple[int, ...], camera: PinholeCamera) -> None:
    if shape[:2] != (camera.height, camera.width):
        raise InputError(
            f"{kind} image {tree.where(name)} is {shape[1]} x {shape[0]}, "
            f"but its intrinsics are for {camera.width} x {camera.height}",
            f"the intrinsics in {INFO} must belong to the stored images",
        )
