"""From the frames that a reader found to a session: what is left out is named, too little is an error."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from pipeline.errors import InputError
from pipeline.readers.filetree import FileTree
from pipeline.session import DepthSource, Frame, GeographicOrigin, Session

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
    _first_reason: str = ""
    _probed: bool = False

    def warn(self, message: str) -> None:
        """Note a repair; ``message`` follows the name of the archive."""
        self.warnings.append(f"{self.tree.path}: {message}")

    def leave_out(self, frame_name: str, kind: str, detail: str = "") -> None:
        """Note that a frame cannot be used: ``kind`` groups equal reasons, ``detail`` names the file."""
        left_out = self._left_out.setdefault(kind, [])
        left_out.append(frame_name)
        self._first_reason = self._first_reason or f"frame {frame_name}: {detail or kind}"
        if len(left_out) <= NAMED_PER_REASON:
            self.warn(f"frame {frame_name} is left out: {detail or kind}")

    def session(
        self,
        format: str,
        metadata: tuple[str, ...],
        name: str = "",
        depth_source: DepthSource = "sensor",
        captured_at: str | None = None,
        path: Path | None = None,
        origin: GeographicOrigin | None = None,
    ) -> Session:
        """The finished session, after a look at its first images; unnamed visits are called as their archive.

        Raises:
            InputError: fewer than two usable frames, or none of the first images can be used.
        """
        path = path or self.tree.path
        self.probe()
        if len(self.frames) < MIN_FRAMES:
            raise self._too_few()
        for kind, names in self._left_out.items():
            if len(names) > NAMED_PER_REASON:
                self.warn(f"{len(names) - NAMED_PER_REASON} more frames are left out: {kind}")
        return Session(
            name=name or _archive_name(path),
            path=path,
            format=format,
            frames=tuple(self.frames),
            depth_source=depth_source,
            captured_at=captured_at,
            metadata_files=self.tree.sources(*metadata),
            warnings=tuple(self.warnings),
            frames_left_out=sum(len(names) for names in self._left_out.values()),
            origin=origin,
        )

    def probe(self) -> Frame | None:
        """The first frame whose images decode, so that wrong sizes show when the archive is opened.

        Raises:
            InputError: the images of the first frames are all unusable.
        """
        refused = 0
        while self.frames and not self._probed:
            try:
                self.frames[0].load_rgb()
                self.frames[0].load_depth()
            except InputError as error:
                refused += 1
                self.leave_out(self.frames.pop(0).name, "its images cannot be used", str(error))
                if refused == PROBED_FRAMES:
                    raise
            else:
                self._probed = True
        return self.frames[0] if self.frames else None

    def _too_few(self) -> InputError:
        left_out = sum(len(names) for names in self._left_out.values())
        if not self.frames:
            return InputError(
                f"{self.tree.path}: none of the {left_out} frames can be used", self._first_reason
            )
        reasons = "; ".join(f"{len(names)} left out: {kind}" for kind, names in self._left_out.items())
        return InputError(
            f"{self.tree.path} has only one usable frame" + (f" ({reasons})" if reasons else ""),
            f"a session needs at least {MIN_FRAMES} frames",
        )


def _archive_name(path: Path) -> str:
    name = path.resolve().name
    return name if path.is_dir() else name.split(".")[0]
