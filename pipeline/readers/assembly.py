"""From the frames that a reader found to a session: what is left out is named, too little is an error."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipeline.errors import InputError
from pipeline.readers.filetree import FileTree
from pipeline.session import DepthSource, Frame, Session

MIN_FRAMES = 2
NAMED_PER_REASON = 10  # so that an archive without any depth does not print a thousand lines
PROBED_FRAMES = 5  # first images that may be unreadable before the archive as a whole is refused


@dataclass
class FrameCollector:
    """Collects usable frames and what was wrong with the others."""

    tree: FileTree
    frames: list[Frame] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    _left_out: dict[str, list[str]] = field(default_factory=dict)

    def warn(self, message: str) -> None:
        """Note a repair; ``message`` follows the name of the archive."""
        self.warnings.append(f"{self.tree.path}: {message}")

    def leave_out(self, frame_name: str, kind: str, detail: str = "") -> None:
        """Note that a frame cannot be used: ``kind`` groups equal reasons, ``detail`` names the file."""
        left_out = self._left_out.setdefault(kind, [])
        left_out.append(frame_name)
        if len(left_out) <= NAMED_PER_REASON:
            self.warn(f"frame {frame_name} is left out: {detail or kind}")

    def session(
        self,
        name: str,
        format: str,
        metadata: tuple[str, ...],
        depth_source: DepthSource = "sensor",
        captured_at: str | None = None,
    ) -> Session:
        """The finished session, after a look at its first images.

        Raises:
            InputError: fewer than two usable frames, or none of the first images can be used.
        """
        self._probe()
        if len(self.frames) < MIN_FRAMES:
            raise InputError(self._too_few(), f"a session needs at least {MIN_FRAMES} frames")
        for kind, names in self._left_out.items():
            if len(names) > NAMED_PER_REASON:
                self.warn(f"{len(names) - NAMED_PER_REASON} more frames are left out: {kind}")
        return Session(
            name=name,
            path=self.tree.path,
            format=format,
            frames=tuple(self.frames),
            depth_source=depth_source,
            captured_at=captured_at,
            metadata_files=self.tree.sources(*metadata),
            warnings=tuple(self.warnings),
        )

    def _probe(self) -> None:
        """Decode the first frame, so that wrong sizes show when the archive is opened."""
        for _ in range(PROBED_FRAMES):
            if not self.frames:
                return
            try:
                self.frames[0].load_rgb()
                self.frames[0].load_depth()
            except InputError as error:
                refused = self.frames.pop(0)
                last = error
                self.leave_out(refused.name, "its images cannot be used", str(error))
            else:
                return
        raise last

    def _too_few(self) -> str:
        found = "no usable frame" if not self.frames else "only one usable frame"
        reasons = "; ".join(f"{len(names)} x {kind}" for kind, names in self._left_out.items())
        return f"{self.tree.path}: {found}" + (f" ({reasons})" if reasons else "")
