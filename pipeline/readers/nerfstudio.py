"""Nerfstudio ``transforms.json``: per-frame intrinsics, lens distortion, OpenGL poses, 16-bit depth."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime
from typing import Any

from pipeline.camera import PinholeCamera
from pipeline.errors import InputError
from pipeline.readers.assembly import FrameCollector
from pipeline.readers.filetree import FileTree, normalised
from pipeline.readers.intrinsics import Distortion, checked_camera, number
from pipeline.readers.origin import read_origin
from pipeline.readers.poses import checked_pose, opencv_from_opengl
from pipeline.readers.stored import StoredImages
from pipeline.session import DepthSource, Frame, Session
from pipeline.settings import ArchiveSettings

TRANSFORMS = "transforms.json"
INTRINSIC_KEYS = ("fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "p1", "p2")
DEPTH_SOURCES: tuple[DepthSource, ...] = ("sensor", "lidar", "learned")
CAMERA_MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")  # all within k1 to p2


class NerfstudioReader:
    """Reader of the contract's own archive format."""

    name = "nerfstudio"
    looks_for = TRANSFORMS

    def matches(self, tree: FileTree) -> bool:
        """See :class:`pipeline.readers.reader.Reader`."""
        return tree.has(TRANSFORMS)

    def read(self, tree: FileTree, settings: ArchiveSettings) -> Session:
        """See :class:`pipeline.readers.reader.Reader`."""
        where = tree.where(TRANSFORMS)
        document = parse_json(tree, TRANSFORMS)
        entries = document.get("frames")
        if not isinstance(entries, list) or not entries:
            raise InputError(f"{where}: 'frames' is missing or empty", "a list of frames is expected")
        model = document.get("camera_model", "OPENCV")
        if model not in CAMERA_MODELS:
            raise InputError(
                f"{where}: camera model {model!r} is not supported",
                "undistort the images to OPENCV or PINHOLE first",
            )
        metres_per_count = number(document, "depth_unit_scale_factor", where, 0.001)
        if metres_per_count <= 0:
            raise InputError(
                f"{where}: 'depth_unit_scale_factor' is {metres_per_count:g}", "metres per count are > 0"
            )
        if not any(isinstance(entry, dict) and entry.get("depth_file_path") for entry in entries):
            raise InputError(
                f"{where}: no frame has 'depth_file_path'",
                "a depth estimator is needed for colour-only archives",
            )

        collector = FrameCollector(tree)
        about = session_block(document, collector)
        images: dict[int, StoredImages] = {}
        for index, entry in enumerate(entries):
            if stored := self._add(collector, index, entry, document, metres_per_count):
                images[index] = stored
        if first := collector.probe():
            warn_about_resized_depth(images[first.index], collector)
        metadata = (TRANSFORMS, *point_cloud(document, collector))
        return collector.session(
            name=str(about.get("name", "")),
            format=self.name,
            metadata=metadata,
            depth_source=about.get("depth_source", "sensor"),
            captured_at=about.get("captured_at"),
            origin=read_origin(about, collector),
        )

    def _add(
        self,
        collector: FrameCollector,
        index: int,
        entry: Any,
        document: Mapping[str, Any],
        metres_per_count: float,
    ) -> StoredImages | None:
        tree = collector.tree
        if not isinstance(entry, dict) or not isinstance(entry.get("file_path"), str):
            collector.leave_out(f"#{index}", "'file_path' is missing")
            return None
        name = entry["file_path"]
        colour = normalised(name)
        depth_path = entry.get("depth_file_path")
        depth = normalised(depth_path) if isinstance(depth_path, str) and depth_path else ""
        if colour is None or depth is None:
            outside = name if colour is None else depth_path
            collector.leave_out(
                name, "its files lie outside the archive", f"{outside} lies outside the archive"
            )
            return None
        if not depth:
            collector.leave_out(name, "it has no depth ('depth_file_path')")
            return None
        for kind, file in (("colour", colour), ("depth", depth)):
            if not tree.has(file):
                collector.leave_out(name, f"its {kind} image is missing", f"{kind} image {file} is missing")
                return None
        overrides = any(key in entry for key in INTRINSIC_KEYS)
        where = tree.where(TRANSFORMS) + (f", frame {name}" if overrides else "")
        try:
            camera, distortion = read_intrinsics({**document, **entry} if overrides else document, where)
        except InputError as error:
            if not overrides:
                raise
            collector.leave_out(name, "wrong intrinsics", str(error))
            return None
        try:
            T_world_opengl = checked_pose(entry.get("transform_matrix"))
        except InputError as error:
            collector.leave_out(name, str(error))
            return None
        images = StoredImages(tree, colour, depth, camera, distortion, metres_per_count)
        collector.frames.append(
            Frame(
                index=index,
                name=name,
                camera=camera,
                T_world_camera=opencv_from_opengl(T_world_opengl),
                timestamp_s=timestamp_s(entry.get("timestamp")),
                load_rgb=images.load_rgb,
                load_depth=images.load_depth,
                files=tree.sources(colour, depth),
            )
        )
        return images


def parse_json(tree: FileTree, name: str) -> dict[str, Any]:
    """A JSON object.

    Raises:
        InputError: not JSON (says where), or not an object.
    """
    where, hint = tree.where(name), "export the archive again"
    try:
        document = json.loads(tree.read(name))
    except json.JSONDecodeError as error:
        raise InputError(
            f"{where} is not valid JSON: {error.msg} in line {error.lineno}, column {error.colno}", hint
        ) from None
    except UnicodeDecodeError:
        raise InputError(f"{where} is not text in UTF-8", hint) from None
    except RecursionError:
        raise InputError(f"{where} is nested too deeply", hint) from None
    if not isinstance(document, dict):
        raise InputError(f"{where} does not hold a JSON object", hint)
    return document


def read_intrinsics(values: Mapping[str, Any], where: str) -> tuple[PinholeCamera, Distortion]:
    """Camera and distortion of a frame.

    Raises:
        InputError: a value is missing, not a number, or absurd.
    """
    fx = number(values, "fl_x", where)
    camera = PinholeCamera(
        width=int(number(values, "w", where)),
        height=int(number(values, "h", where)),
        fx=fx,
        fy=number(values, "fl_y", where, fx),
        cx=number(values, "cx", where),
        cy=number(values, "cy", where),
    )
    distortion = Distortion(*(number(values, key, where, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")))
    return checked_camera(camera, where), distortion


def session_block(document: Mapping[str, Any], collector: FrameCollector) -> dict[str, Any]:
    """What the archive says about the visit; unusable values are dropped with a warning."""
    block = document.get("session")
    if block is None:
        return {}
    if not isinstance(block, dict):
        collector.warn(f"'session' in {TRANSFORMS} is ignored: it is not an object")
        return {}
    about = {key: value for key, value in block.items() if value is not None}
    if about.get("depth_source", "sensor") not in DEPTH_SOURCES:
        collector.warn(
            f"depth_source {about.pop('depth_source')!r} is unknown and read as 'sensor': "
            f"choose one of {', '.join(DEPTH_SOURCES)}"
        )
    if "captured_at" in about and not is_iso_date(about["captured_at"]):
        collector.warn(f"captured_at {about.pop('captured_at')!r} is ignored: it is not an ISO 8601 date")
    return about


def is_iso_date(value: Any) -> bool:
    """Whether a value is a date, or a date and time, in ISO 8601."""
    try:
        datetime.fromisoformat(value)
    except (TypeError, ValueError):
        return False
    return True


def warn_about_resized_depth(images: StoredImages, collector: FrameCollector) -> None:
    """Tell when depth is stored smaller or larger than colour: it is read, but resolution differs."""
    width, height = images.stored_depth_size()
    if (width, height) != (images.camera.width, images.camera.height):
        collector.warn(
            f"depth images are {width} x {height} and are resized (nearest) to the colour images' "
            f"{images.camera.width} x {images.camera.height}"
        )


def point_cloud(document: Mapping[str, Any], collector: FrameCollector) -> tuple[str, ...]:
    """The optional point cloud, as part of what defines the session."""
    stated = document.get("ply_file_path")
    if not isinstance(stated, str) or not stated:
        return ()
    name = normalised(stated)
    if name is None or not collector.tree.has(name):
        collector.warn(f"point cloud {stated} is missing and ignored")
        return ()
    return (name,)


def timestamp_s(value: Any) -> float | None:
    """Seconds, or None for anything that is not a finite number."""
    try:
        return number({"timestamp": value}, "timestamp", "")
    except InputError:
        return None
