"""Decoding of colour and depth images, with errors that name the file."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.readers.filetree import FileTree

# OpenCV would print its own lines about a broken file beside ours, which names the file.
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

NO_MEASUREMENT_COUNT = np.iinfo(np.uint16).max  # a saturated count: no distance, in any format


def read_colour(tree: FileTree, name: str) -> NDArray[np.uint8]:
    """Colour image, (H, W, 3) RGB uint8, never turned by EXIF: poses belong to the stored pixels.

    Raises:
        InputError: unreadable, truncated or not an image.
    """
    image = _decode(tree, name, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def read_counts(tree: FileTree, name: str) -> NDArray[np.uint16]:
    """Raw depth image, (H, W) uint16; no measurement (0 or saturated) is 0.

    Raises:
        InputError: unreadable, truncated, or not a 16-bit single-channel image.
    """
    counts = _decode(tree, name, cv2.IMREAD_UNCHANGED)
    if counts.dtype != np.uint16 or counts.ndim != 2:
        channels = 1 if counts.ndim == 2 else counts.shape[2]
        raise InputError(
            f"depth image {tree.where(name)} has {channels} channel(s) of {8 * counts.dtype.itemsize} bit",
            "depth is stored as 16-bit single-channel PNG",
        )
    counts[counts == NO_MEASUREMENT_COUNT] = 0
    return counts


def _decode(tree: FileTree, name: str, flags: int) -> NDArray[Any]:
    data = tree.read(name)
    if _is_truncated(data):
        raise InputError(f"image {tree.where(name)} is truncated", "copy the file again")
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), flags) if data else None
    except cv2.error:
        image = None
    if image is None:
        raise InputError(f"{tree.where(name)} is not an image that can be decoded", "copy the file again")
    return np.asarray(image)


def _is_truncated(data: bytes) -> bool:
    """Whether a JPEG or PNG lacks its end: decoders fill the rest with grey and say nothing."""
    if data.startswith(b"\xff\xd8"):
        return data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda") or b"\xff\xda" not in data
    if data.startswith(b"\x89PNG"):
        return b"IEND" not in data[-4096:]
    return False
