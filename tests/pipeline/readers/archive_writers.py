"""Tiny recordings in the real layout of each format, with the values that went in."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.camera import PinholeCamera


@dataclass(frozen=True)
class Recording:
    """What is written: colour (N, H, W, 3) RGB, depth in counts (N, h, w), OpenCV poses (N, 4, 4)."""

    colours: np.ndarray
    depths: np.ndarray
    T_world_cameras: np.ndarray


def random_poses(rng: np.random.Generator, count: int) -> np.ndarray:
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, :3] = Rotation.random(count, random_state=rng).as_matrix()
    T[:, :3, 3] = rng.uniform(-5, 5, (count, 3))
    return T


def recording(
    count: int = 3,
    colour_size: tuple[int, int] = (32, 24),
    depth_size: tuple[int, int] | None = None,
    seed: int = 0,
) -> Recording:
    rng = np.random.default_rng(seed)
    (width, height), (depth_width, depth_height) = colour_size, depth_size or colour_size
    depths = rng.integers(500, 5000, (count, depth_height, depth_width)).astype(np.uint16)
    depths[rng.random(depths.shape) < 0.1] = 0
    return Recording(
        colours=rng.integers(0, 256, (count, height, width, 3)).astype(np.uint8),
        depths=depths,
        T_world_cameras=random_poses(rng, count),
    )


def write_image(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    stored = cv2.cvtColor(image, cv2.COLOR_RGB2BGR) if image.ndim == 3 else image
    assert cv2.imwrite(str(path), stored)


def opengl_from_opencv(T_world_opencv: np.ndarray) -> np.ndarray:
    T = T_world_opencv.copy()
    T[:3, 1:3] *= -1
    return T


def write_nerfstudio(folder: Path, what: Recording, **changes: Any) -> dict[str, Any]:
    """Write images and ``transforms.json``; ``changes`` replace entries of the document (None removes)."""
    height, width = what.colours.shape[1:3]
    frames = []
    for k, (colour, depth, T) in enumerate(zip(what.colours, what.depths, what.T_world_cameras, strict=True)):
        write_image(folder / f"images/{k:05d}.png", colour)
        write_image(folder / f"depth/{k:05d}.png", depth)
        frames.append(
            {
                "file_path": f"images/{k:05d}.png",
                "depth_file_path": f"depth/{k:05d}.png",
                "transform_matrix": opengl_from_opencv(T).tolist(),
                "timestamp": 100.0 + k / 30,
            }
        )
    document: dict[str, Any] = {
        "camera_model": "OPENCV",
        "fl_x": 30.0,
        "fl_y": 31.0,
        "cx": (width - 1) / 2,
        "cy": (height - 1) / 2,
        "w": width,
        "h": height,
        "frames": frames,
    }
    document.update(changes)
    document = {key: value for key, value in document.items() if value is not None}
    save_transforms(folder, document)
    return document


def save_transforms(folder: Path, document: dict[str, Any]) -> None:
    (folder / "transforms.json").write_text(json.dumps(document))


def write_tum(folder: Path, what: Recording, pose_offset_s: float = 0.0) -> None:
    """Depth 5 ms after colour; ground truth at ``pose_offset_s`` after colour."""
    lists: dict[str, list[str]] = {
        "rgb": ["# color images"],
        "depth": ["# depth maps"],
        "groundtruth": ["# tum"],
    }
    for k, (colour, depth, T) in enumerate(zip(what.colours, what.depths, what.T_world_cameras, strict=True)):
        time = 1305031102.0 + k / 10
        write_image(folder / f"rgb/{time:.6f}.png", colour)
        write_image(folder / f"depth/{time + 0.005:.6f}.png", depth)
        lists["rgb"].append(f"{time:.6f} rgb/{time:.6f}.png")
        lists["depth"].append(f"{time + 0.005:.6f} depth/{time + 0.005:.6f}.png")
        pose = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()]
        lists["groundtruth"].append(f"{time + pose_offset_s:.6f} " + " ".join(f"{x:.17g}" for x in pose))
    for name, lines in lists.items():
        (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")


def write_pose(path: Path, T: np.ndarray) -> None:
    path.write_text("\n".join(" ".join(f"{x:.17g}" for x in row) for row in T) + "\n")


def write_sevenscenes(folder: Path, what: Recording) -> None:
    for k, (colour, depth, T) in enumerate(zip(what.colours, what.depths, what.T_world_cameras, strict=True)):
        write_image(folder / f"frame-{k:06d}.color.png", colour)
        write_image(folder / f"frame-{k:06d}.depth.png", depth)
        write_pose(folder / f"frame-{k:06d}.pose.txt", T)


def write_threerscan(
    sequence: Path, what: Recording, colour: PinholeCamera, depth: PinholeCamera, shift: int = 1000
) -> None:
    sequence.mkdir(parents=True, exist_ok=True)

    def calibration(camera: PinholeCamera) -> str:
        K = np.eye(4)
        K[:3, :3] = camera.matrix
        return " ".join(f"{x:.17g}" for x in K.ravel())

    identity = " ".join(f"{x:g}" for x in np.eye(4).ravel())
    (sequence / "_info.txt").write_text(
        "m_versionNumber = 4\nm_sensorName = Tango Phone\n"
        f"m_colorWidth = {colour.width}\nm_colorHeight = {colour.height}\n"
        f"m_depthWidth = {depth.width}\nm_depthHeight = {depth.height}\nm_depthShift = {shift}\n"
        f"m_calibrationColorIntrinsic = {calibration(colour)}\nm_calibrationColorExtrinsic = {identity}\n"
        f"m_calibrationDepthIntrinsic = {calibration(depth)}\nm_calibrationDepthExtrinsic = {identity}\n"
        f"m_frames.size = {len(what.colours)}\n"
    )
    for k, (image, counts, T) in enumerate(zip(what.colours, what.depths, what.T_world_cameras, strict=True)):
        write_image(sequence / f"frame-{k:06d}.color.jpg", image)
        write_image(sequence / f"frame-{k:06d}.depth.pgm", counts)
        write_pose(sequence / f"frame-{k:06d}.pose.txt", T)
