"""Write a visit as a Nerfstudio archive: images, 16-bit depth, ``transforms.json``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera import T_OPENGL_OPENCV, PinholeCamera

_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 92, cv2.IMWRITE_JPEG_OPTIMIZE, 0]
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 3]
_MILLIMETRES = 1000


class ArchiveWriter:
    """Writes keyframes in any order, from any thread; :meth:`close` writes the index."""

    def __init__(self, folder: Path, camera: PinholeCamera, name: str, captured_at: str) -> None:
        self._folder, self._camera = folder, camera
        self._session = {"name": name, "captured_at": captured_at, "depth_source": "sensor"}
        self._frames: dict[int, dict[str, Any]] = {}
        (folder / "images").mkdir(parents=True)
        (folder / "depth").mkdir()

    def add(
        self,
        index: int,
        rgb: NDArray[np.uint8],
        depth: NDArray[np.float32],
        T_world_camera: NDArray[np.float64],
        timestamp_s: float,
    ) -> None:
        """Add a keyframe.

        Args:
            index: its number in the visit.
            rgb: (H, W, 3) uint8.
            depth: (H, W) metres, 0 = no measurement; below 65.5 m.
            T_world_camera: (4, 4), OpenCV camera.
            timestamp_s: since the start of the visit.
        """
        number = f"{index:05d}"
        image, depth_image = f"images/{number}.jpg", f"depth/{number}.png"
        millimetres = np.clip(np.rint(depth * _MILLIMETRES), 0, 65535).astype(np.uint16)
        self._encode(image, cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), _JPEG)
        self._encode(depth_image, millimetres, _PNG)
        self._frames[index] = {
            "file_path": image,
            "depth_file_path": depth_image,
            "transform_matrix": np.round(T_world_camera @ T_OPENGL_OPENCV, 8).tolist(),
            "timestamp": round(timestamp_s, 3),
        }

    def close(self) -> None:
        """Write ``transforms.json``."""
        camera = self._camera
        index = {
            "camera_model": "OPENCV",
            "fl_x": camera.fx,
            "fl_y": camera.fy,
            "cx": camera.cx,
            "cy": camera.cy,
            "w": camera.width,
            "h": camera.height,
            "depth_unit_scale_factor": 1 / _MILLIMETRES,
            "session": self._session,
            "frames": [self._frames[index] for index in sorted(self._frames)],
        }
        (self._folder / "transforms.json").write_text(json.dumps(index, indent=1) + "\n")

    def _encode(self, name: str, image: NDArray, options: list[int]) -> None:
        # Encoded in memory: cv2.imwrite hides why writing failed (disk full, no permission).
        done, data = cv2.imencode(Path(name).suffix, image, options)
        if not done:
            raise RuntimeError(f"cannot encode {name}")
        (self._folder / name).write_bytes(data.tobytes())
