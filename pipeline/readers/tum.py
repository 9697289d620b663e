"""TUM RGB-D sequences (Sturm et al., IROS 2012): three lists with timestamps, associated on opening."""

from __future__ import annotations

import re
from operator import itemgetter
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from pipeline.camera import PinholeCamera
from pipeline.errors import InputError
from pipeline.readers.assembly import FrameCollector
from pipeline.readers.filetree import FileTree, normalised
from pipeline.readers.images import read_colour
from pipeline.readers.intrinsics import Distortion, checked_camera
from pipeline.readers.stored import StoredImages
from pipeline.session import Frame, Session
from pipeline.settings import ArchiveSettings

COLOURS, DEPTHS, POSES = "rgb.txt", "depth.txt", "groundtruth.txt"
CALIBRATION = "calibration.txt"  # optional, "fx fy cx cy", as in ETH3D's sequences of this format
METRES_PER_COUNT = 1 / 5000
MAX_POSE_GAP_S = 0.1  # poses farther apart than this are not interpolated

# Published with the benchmark, by camera; the third was rectified before publication.
CAMERAS = {
    "1": (PinholeCamera(640, 480, 517.3, 516.5, 318.6, 255.3), (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)),
    "2": (PinholeCamera(640, 480, 520.9, 521.0, 325.1, 249.7), (0.2312, -0.7849, -0.0033, -0.0001, 0.9172)),
    "3": (PinholeCamera(640, 480, 535.4, 539.2, 320.1, 247.6), (0.0, 0.0, 0.0, 0.0, 0.0)),
}
ROS_CAMERA = PinholeCamera(640, 480, 525.0, 525.0, 319.5, 239.5)


class TumReader:
    """Reader of a sequence folder of the TUM RGB-D benchmark."""

    name = "tum"
    looks_for = f"{COLOURS}, {DEPTHS} and {POSES}"

    def matches(self, tree: FileTree) -> bool:
        """See :class:`pipeline.readers.reader.Reader`."""
        return tree.has(COLOURS) and tree.has(DEPTHS)

    def read(self, tree: FileTree, settings: ArchiveSettings) -> Session:
        """See :class:`pipeline.readers.reader.Reader`."""
        if not tree.has(POSES):
            raise InputError(
                f"{tree.where(POSES)} is missing", "poses are needed: `timestamp tx ty tz qx qy qz qw`"
            )
        collector = FrameCollector(tree)
        colours, depths = _image_list(tree, COLOURS), _image_list(tree, DEPTHS)
        camera, distortion = _camera(collector, colours)
        trajectory = Trajectory(tree)
        depth_times = np.array([time for time, _ in depths])
        order = np.argsort(depth_times, kind="stable")
        for index, (time, colour) in enumerate(colours):
            k = order[nearest(depth_times[order], time)]
            if not abs(depth_times[k] - time) <= settings.max_time_gap_s:
                collector.leave_out(colour, f"no depth image within {settings.max_time_gap_s:g} s")
                continue
            depth = depths[k][1]
            missing = next((name for name in (colour, depth) if not tree.has(name)), None)
            if missing:
                collector.leave_out(colour, "its files are missing", f"image {missing} is missing")
                continue
            try:
                T_world_camera = trajectory.at(time, settings.max_time_gap_s)
            except InputError as error:
                collector.leave_out(colour, str(error))
                continue
            images = StoredImages(tree, colour, depth, camera, distortion, METRES_PER_COUNT)
            collector.frames.append(
                Frame(
                    index=index,
                    name=colour,
                    camera=camera,
                    T_world_camera=T_world_camera,
                    timestamp_s=time,
                    load_rgb=images.load_rgb,
                    load_depth=images.load_depth,
                    files=tree.sources(colour, depth),
                )
            )
        metadata = [COLOURS, DEPTHS, POSES] + [CALIBRATION] * tree.has(CALIBRATION)
        return collector.session(format=self.name, metadata=tuple(metadata))


class Trajectory:
    """Camera-to-world poses over time."""

    def __init__(self, tree: FileTree) -> None:
        rows = []
        for line_number, words in _lines(tree, POSES):
            try:
                row = [float(word) for word in words]
            except ValueError:
                row = []
            if len(row) != 8 or not np.isfinite(row[0]):
                raise InputError(
                    f"{tree.where(POSES)}, line {line_number}: 8 numbers are expected",
                    "`timestamp tx ty tz qx qy qz qw`",
                )
            rows.append(row)
        if not rows:
            raise InputError(f"{tree.where(POSES)} holds no poses", "`timestamp tx ty tz qx qy qz qw`")
        self._rows = np.array(sorted(rows, key=itemgetter(0)))  # (N, 8)
        self._lengths = np.linalg.norm(self._rows[:, 4:], axis=1)
        self._usable = np.isfinite(self._rows).all(axis=1) & (np.abs(self._lengths - 1.0) < 0.01)

    def at(self, time_s: float, max_gap_s: float) -> NDArray[np.float64]:
        """Pose at a time, (4, 4): interpolated between its neighbours, or the nearest one.

        Raises:
            InputError: no pose is near enough, or it is not finite or not rigid.
        """
        times = self._rows[:, 0]
        k = nearest(times, time_s)
        if not abs(times[k] - time_s) <= max_gap_s:
            raise InputError(f"no pose within {max_gap_s:g} s")
        if not np.isfinite(self._rows[k]).all():
            raise InputError("its pose is not finite")
        if not self._usable[k]:
            raise InputError(f"its pose is not rigid (quaternion of length {self._lengths[k]:.3g})")
        before = k if times[k] <= time_s else k - 1
        after = before + 1
        if (
            before < 0
            or after >= len(times)
            or not (self._usable[before] and self._usable[after])
            or not 0 < times[after] - times[before] <= MAX_POSE_GAP_S
        ):
            before = after = k
        return self._between(before, after, time_s)

    def _between(self, before: int, after: int, time_s: float) -> NDArray[np.float64]:
        T_world_camera = np.eye(4)
        rows = self._rows[[before, after]]
        if before == after:
            T_world_camera[:3, :3] = Rotation.from_quat(rows[0, 4:]).as_matrix()
            T_world_camera[:3, 3] = rows[0, 1:4]
            return T_world_camera
        share = (time_s - rows[0, 0]) / (rows[1, 0] - rows[0, 0])
        T_world_camera[:3, :3] = Slerp([0.0, 1.0], Rotation.from_quat(rows[:, 4:]))(share).as_matrix()
        T_world_camera[:3, 3] = (1 - share) * rows[0, 1:4] + share * rows[1, 1:4]
        return T_world_camera


def nearest(times: NDArray[np.float64], time: float) -> int:
    """Position of the nearest of ascending times."""
    right = int(np.searchsorted(times, time))
    if right == 0:
        return 0
    if right == len(times):
        return len(times) - 1
    return right if times[right] - time < time - times[right - 1] else right - 1


def _camera(collector: FrameCollector, colours: list[tuple[float, str]]) -> tuple[PinholeCamera, Distortion]:
    tree = collector.tree
    if tree.has(CALIBRATION):
        where = tree.where(CALIBRATION)
        try:
            fx, fy, cx, cy = (float(word) for word in tree.read(CALIBRATION).split()[:4])
        except ValueError:
            raise InputError(f"{where} is malformed", "`fx fy cx cy` are expected") from None
        width, height = _first_size(tree, colours)
        return checked_camera(PinholeCamera(width, height, fx, fy, cx, cy), where), Distortion()
    folders = " ".join(PurePath(tree.where(COLOURS)).parts[-3:-1])
    if known := re.search(r"(?:freiburg|\bfr)([123])", folders):
        camera, coefficients = CAMERAS[known.group(1)]
        return camera, Distortion(*coefficients)
    collector.warn(
        "intrinsics are unknown and taken as ROS's defaults (525, 525, 319.5, 239.5): "
        f"name the folder after its camera (freiburg1, 2 or 3) or add {CALIBRATION} with `fx fy cx cy`"
    )
    return ROS_CAMERA, Distortion()


def _first_size(tree: FileTree, colours: list[tuple[float, str]]) -> tuple[int, int]:
    """(width, height) of the first colour image, which a calibration of four numbers does not tell."""
    rows, columns = read_colour(
        tree, next((name for _, name in colours if tree.has(name)), colours[0][1])
    ).shape[:2]
    return columns, rows


def _image_list(tree: FileTree, name: str) -> list[tuple[float, str]]:
    images = []
    for line_number, words in _lines(tree, name):
        try:
            time, file = float(words[0]), normalised(words[1])
        except (ValueError, IndexError):
            raise InputError(
                f"{tree.where(name)}, line {line_number}: a timestamp and a file name are expected"
            ) from None
        if file is None:
            raise InputError(f"{tree.where(name)}, line {line_number}: {words[1]} lies outside the archive")
        images.append((time, file))
    if not images:
        raise InputError(
            f"{tree.where(name)} lists no images", "a timestamp and a file name a line are expected"
        )
    return images


def _lines(tree: FileTree, name: str) -> list[tuple[int, list[str]]]:
    text = tree.read(name).decode("utf-8", errors="replace")
    numbered = enumerate(text.splitlines(), start=1)
    return [(k, line.split()) for k, line in numbered if line.strip() and not line.lstrip().startswith("#")]
