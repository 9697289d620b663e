"""7-Scenes sequences (Shotton et al., CVPR 2013): Kinect depth in mm, camera-to-world poses.

The publication gives no calibration; its stated defaults (585 px, centre 320, 240) hold for both images.
"""

from __future__ import annotations

from pipeline.camera import PinholeCamera
from pipeline.readers.assembly import FrameCollector
from pipeline.readers.filetree import FileTree
from pipeline.readers.intrinsics import Distortion
from pipeline.readers.numbered import has_frames, numbered_frames
from pipeline.readers.stored import StoredImages
from pipeline.session import Frame, Session
from pipeline.settings import ArchiveSettings

COLOUR, DEPTH = ".color.png", ".depth.png"
CAMERA = PinholeCamera(width=640, height=480, fx=585.0, fy=585.0, cx=320.0, cy=240.0)
METRES_PER_COUNT = 0.001


class SevenScenesReader:
    """Reader of one ``seq-XX`` folder."""

    name = "7scenes"
    looks_for = f"frame-*{COLOUR}"

    def matches(self, tree: FileTree) -> bool:
        """See :class:`pipeline.readers.reader.Reader`."""
        return has_frames(tree, "", COLOUR)

    def read(self, tree: FileTree, settings: ArchiveSettings) -> Session:
        """See :class:`pipeline.readers.reader.Reader`."""
        collector = FrameCollector(tree)
        for found in numbered_frames(collector, "", COLOUR, DEPTH):
            images = StoredImages(tree, found.colour, found.depth, CAMERA, Distortion(), METRES_PER_COUNT)
            collector.frames.append(
                Frame(
                    index=found.index,
                    name=found.stem,
                    camera=CAMERA,
                    T_world_camera=found.T_world_camera,
                    timestamp_s=None,
                    load_rgb=images.load_rgb,
                    load_depth=images.load_depth,
                    files=tree.sources(found.colour, found.depth, found.pose),
                )
            )
        return collector.session(format=self.name, metadata=())
