"""Where everything stands in a result folder. Keyframe files are named by the archive's frame index."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

SCHEMA_VERSION = 1

SCORE_ARRAYS = ("sigma", "sigma_backward", "s_bar", "match_count", "row_object_ids", "column_object_ids")
MAP_ARRAYS = ("points_world", "colours", "object_ids")
REVIEW_FILE = "review.sqlite"


@dataclass(frozen=True)
class ResultLayout:
    """Paths inside one result folder."""

    root: Path

    @property
    def manifest(self) -> Path:
        """``result.json``; written last, so that a folder without it is not a result."""
        return self.root / "result.json"

    @property
    def objects(self) -> Path:
        """Objects, sightings, replaced events and the gates of the score matrix."""
        return self.root / "objects.json"

    @property
    def belief(self) -> Path:
        """Labels believed after each submap."""
        return self.root / "belief.npy"

    def score_array(self, name: str) -> Path:
        """One array of the score matrix, named as in ``ScoreMatrix``."""
        return self.root / "score_matrix" / f"{name}.npy"

    def session(self, session: int) -> Path:
        """Folder of a visit."""
        return self.root / "sessions" / str(session)

    def session_record(self, session: int) -> Path:
        """Name, archive and keyframes of a visit."""
        return self.session(session) / "session.json"

    def map_array(self, session: int, name: str) -> Path:
        """One array of a visit's map: points_world, colours or object_ids."""
        return self.session(session) / f"{name}.npy"

    def evidence(self, session: int) -> Path:
        """Raw evidence of a visit's instances, one structured row each."""
        return self.session(session) / "evidence.npy"

    @property
    def moves(self) -> Path:
        """Pairs of objects that were laid over each other; not every method writes it."""
        return self.root / "moves.npy"

    @property
    def basis(self) -> Path:
        """What the labels follow from; not every method writes it, and older results lack it."""
        return self.root / "basis.npz"

    def image(self, session: int, frame_index: int) -> Path:
        """JPEG of a keyframe."""
        return self.session(session) / "images" / f"{frame_index:05d}.jpg"

    def mask(self, session: int, frame_index: int) -> Path:
        """16-bit PNG of object ids."""
        return self.session(session) / "masks" / f"{frame_index:05d}.png"

    def semantic(self, session: int, frame_index: int) -> Path:
        """Semantic heatmap, float16."""
        return self.session(session) / "semantic" / f"{frame_index:05d}.npy"

    def geometric(self, session: int, frame_index: int) -> Path:
        """Geometric heatmap, float16 metres."""
        return self.session(session) / "geometric" / f"{frame_index:05d}.npy"

    def features(self, session: int, frame_index: int) -> Path:
        """Patch features, float16."""
        return self.session(session) / "features" / f"{frame_index:05d}.npy"

    def links(self, previous_frame: int, current_frame: int) -> Path:
        """Patch matches of a co-visible pair, by the frame indices of its two keyframes."""
        return self.root / "links" / f"{previous_frame:05d}_{current_frame:05d}.npz"
