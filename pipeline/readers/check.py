"""What is inside an archive, and what is wrong with it, from its metadata and a sample of its images."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.errors import InputError
from pipeline.readers import open_session
from pipeline.session import Session
from pipeline.settings import Settings

SAMPLED_FRAMES = 12
DEPTH_PERCENTILES = (5, 50, 95)
MANY_HOLES = 0.6  # share of pixels without depth from which a map will have gaps
LONG_STEP_M = 2.0  # a camera hardly moves farther between two frames of a recording
LONG_PATH_STEPS = 20.0  # a step this many times the median is a jump


@dataclass(frozen=True)
class ArchiveReport:
    """The findings about one archive.

    Attributes:
        path: the archive; name, format, depth_source, captured_at: as in ``Session``; empty if unopened.
        frames_used, frames_left_out: counts.
        width_px, height_px: of the images as processed; cameras: how many different intrinsics there are.
        fx_px, fy_px, cx_px, cy_px: intrinsics of the first frame, undistorted.
        span_s: from the first to the last timestamp; None without timestamps.
        path_length_m: sum of the distances between consecutive cameras.
        depth_percentiles_m: 5th, 50th and 95th percentile of the sampled depth; empty if not sampled.
        holes: share of sampled pixels without depth, in [0, 1]; None if not sampled.
        keyframes: frames that the selection keeps; None if unopened.
        sampled_frames: how many frames' images were read.
        warnings: what was left out or looks doubtful; problems: what makes (part of) the archive unusable.
    """

    path: str
    name: str = ""
    format: str = ""
    depth_source: str = ""
    captured_at: str | None = None
    frames_used: int = 0
    frames_left_out: int = 0
    width_px: int = 0
    height_px: int = 0
    cameras: int = 0
    fx_px: float = 0.0
    fy_px: float = 0.0
    cx_px: float = 0.0
    cy_px: float = 0.0
    span_s: float | None = None
    path_length_m: float = 0.0
    depth_percentiles_m: tuple[float, ...] = ()
    holes: float | None = None
    keyframes: int | None = None
    sampled_frames: int = 0
    warnings: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def usable(self) -> bool:
        """Whether the archive can be processed."""
        return self.frames_used > 0

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return dataclasses.asdict(self) | {"usable": self.usable}

    def lines(self) -> list[str]:
        """The report for people, one finding a line."""
        if not self.usable:
            return [f"archive     {self.path}", *(f"problem     {problem}" for problem in self.problems)]
        fov_deg = math.degrees(2 * math.atan(self.width_px / (2 * self.fx_px)))
        cameras = f", {self.cameras} different cameras" if self.cameras > 1 else ""
        left_out = f", {self.frames_left_out} left out" if self.frames_left_out else ""
        span = f", {self.span_s:.1f} s" if self.span_s is not None else ""
        lines = [
            f"archive     {self.path}",
            f"visit       {self.name}" + (f", captured {self.captured_at}" if self.captured_at else ""),
            f"format      {self.format}, depth from {self.depth_source}",
            f"frames      {self.frames_used} used{left_out}",
            f"camera      {self.width_px} x {self.height_px}, fx {self.fx_px:.1f} fy {self.fy_px:.1f} "
            f"cx {self.cx_px:.1f} cy {self.cy_px:.1f} px, {fov_deg:.0f} deg wide{cameras}",
            f"path        {self.path_length_m:.2f} m{span}",
        ]
        if self.depth_percentiles_m:
            low, middle, high = self.depth_percentiles_m
            lines.append(
                f"depth       {low:.2f} to {high:.2f} m, median {middle:.2f} m "
                f"(5th to 95th percentile of {self.sampled_frames} frames)"
            )
        if self.holes is not None:
            lines.append(f"holes       {100 * self.holes:.1f} % of pixels without depth")
        if self.keyframes is not None:
            lines.append(f"keyframes   {self.keyframes} with the default selection")
        lines += [f"warning     {warning}" for warning in self.warnings]
        lines += [f"problem     {problem}" for problem in self.problems]
        return lines


def check_archive(path: Path | str, images: bool = True, settings: Settings | None = None) -> ArchiveReport:
    """Open an archive and report on it; what is wrong is in the report, never raised.

    Args:
        path: the archive.
        images: also read evenly spaced frames; without, only metadata are looked at.
        settings: of the keyframe selection that is tried.
    """
    settings = settings or Settings()
    try:
        session = open_session(path, settings.archive)
    except InputError as error:
        return ArchiveReport(path=str(path), problems=(str(error),))
    first = session.frames[0].camera
    warnings = [*session.warnings, *_doubts_about_motion(session)]
    report = ArchiveReport(
        path=str(path),
        name=session.name,
        format=session.format,
        depth_source=session.depth_source,
        captured_at=session.captured_at,
        frames_used=len(session.frames),
        frames_left_out=session.frames_left_out,
        width_px=first.width,
        height_px=first.height,
        cameras=len({frame.camera for frame in session.frames}),
        fx_px=first.fx,
        fy_px=first.fy,
        cx_px=first.cx,
        cy_px=first.cy,
        span_s=_span_s(session),
        path_length_m=float(_steps_m(session).sum()),
        keyframes=_count_keyframes(session, settings),
        warnings=tuple(warnings),
    )
    return _with_images(report, session) if images else report


def _with_images(report: ArchiveReport, session: Session) -> ArchiveReport:
    positions = np.unique(np.linspace(0, len(session.frames) - 1, SAMPLED_FRAMES).round().astype(int))
    problems: list[str] = []
    measured: list[np.ndarray] = []
    pixels = 0
    sampled = 0
    for frame in (session.frames[position] for position in positions):
        try:
            frame.load_rgb()
            depth = frame.load_depth()
        except InputError as error:
            problems.append(str(error))
            continue
        sampled += 1
        pixels += depth.size
        measured.append(depth[depth > 0])
    depths = np.concatenate(measured) if measured else np.zeros(0, np.float32)
    holes = 1 - depths.size / pixels if pixels else None
    warnings = list(report.warnings)
    if pixels and not depths.size:
        problems.append(f"{report.path}: the sampled depth images are empty: check how depth was exported")
    elif holes is not None and holes > MANY_HOLES:
        warnings.append(f"{report.path}: {100 * holes:.0f} % of pixels have no depth: the map will have gaps")
    percentiles = np.percentile(depths, DEPTH_PERCENTILES).tolist() if depths.size else []
    return dataclasses.replace(
        report,
        depth_percentiles_m=tuple(percentiles),
        holes=holes,
        sampled_frames=sampled,
        warnings=tuple(warnings),
        problems=(*report.problems, *problems),
    )


def _steps_m(session: Session) -> np.ndarray:
    centres = np.array([frame.T_world_camera[:3, 3] for frame in session.frames])
    return np.linalg.norm(np.diff(centres, axis=0), axis=1)


def _span_s(session: Session) -> float | None:
    times = [frame.timestamp_s for frame in session.frames if frame.timestamp_s is not None]
    return max(times) - min(times) if times else None


def _doubts_about_motion(session: Session) -> list[str]:
    steps_m = _steps_m(session)
    doubts = []
    longest = int(steps_m.argmax())
    if steps_m[longest] > max(LONG_STEP_M, LONG_PATH_STEPS * float(np.median(steps_m))):
        before, after = session.frames[longest], session.frames[longest + 1]
        doubts.append(
            f"{session.path}: the camera jumps by {steps_m[longest]:.1f} m from frame {before.name} "
            f"to {after.name}: was tracking lost, or are the poses not metric?"
        )
    if len({frame.T_world_camera.tobytes() for frame in session.frames}) == 1:
        doubts.append(f"{session.path}: all poses are equal: are they missing from the export?")
    times = [frame.timestamp_s for frame in session.frames if frame.timestamp_s is not None]
    if any(after < before for before, after in pairwise(times)):
        doubts.append(f"{session.path}: timestamps go backwards: frames are used in the order of the archive")
    return doubts


def _count_keyframes(session: Session, settings: Settings) -> int:
    # The mapping package brings heavy libraries along; opening a recording must stay light.
    from pipeline.mapping.keyframes import select_keyframes

    return len(select_keyframes(session, settings.keyframes))
