"""Results and ground truths small enough to count by hand: points on a line, 1 m apart."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.ply import LabelledPoints
from pipeline.result import ChangeLabel, MapObject, MatchCase, ReplacedEvent, Sighting


def make_object(object_id: int, label: ChangeLabel, points: dict[int, np.ndarray]) -> MapObject:
    sightings = tuple(
        Sighting(
            session=session,
            instance=0,
            centroid_world_m=tuple(np.mean(p, axis=0).tolist()),
            box_min_world_m=tuple(np.min(p, axis=0).tolist()),
            box_max_world_m=tuple(np.max(p, axis=0).tolist()),
            point_count=len(p),
            coverage=1.0,
            keyframes=(),
        )
        for session, p in sorted(points.items())
    )
    displacement = None
    if len(sightings) == 2:
        displacement = float(
            np.linalg.norm(np.subtract(sightings[1].centroid_world_m, sightings[0].centroid_world_m))
        )
    return MapObject(
        object_id=object_id,
        label=label,
        confidence=0.9,
        case=MatchCase.CONFIDENT,
        sigma=0.8,
        s_bar=0.9,
        coverage=1.0,
        displacement_m=displacement,
        rotation_rad=None,
        seen_through=0.0,
        appearance_change=None,
        decided_in_submap=0,
        counterpart_instance=None,
        replaced_by=None,
        replaces=None,
        sightings=sightings,
    )


class SceneBuilder:
    """Truth from rows of (visit, position, label, object); a map from rows of (visit, position, object)."""

    def truth(self, rows: Sequence[tuple[int, Any, int, int]]) -> LabelledPoints:
        count = len(rows)
        return LabelledPoints(
            points_world=np.array([self.position(row[1]) for row in rows], dtype=np.float32).reshape(-1, 3),
            colours=np.zeros((count, 3), dtype=np.uint8),
            session=np.array([row[0] for row in rows], dtype=np.uint8),
            label=np.array([row[2] for row in rows], dtype=np.uint8),
            object_id=np.array([row[3] for row in rows], dtype=np.int32),
            confidence=np.ones(count, dtype=np.float32),
        )

    def result(
        self,
        rows: Sequence[tuple[int, Any, int]],
        labels: dict[int, ChangeLabel] | None = None,
        replaced: Sequence[ReplacedEvent] = (),
    ) -> SimpleNamespace:
        points = np.array([self.position(row[1]) for row in rows], dtype=np.float32).reshape(-1, 3)
        session = np.array([row[0] for row in rows], dtype=int)
        object_id = np.array([row[2] for row in rows], dtype=np.int32)
        sessions = tuple(
            SimpleNamespace(
                index=s,
                points_world=points[session == s],
                object_ids=object_id[session == s],
                keyframes=(),
                up_world=np.array([0.0, 0.0, 1.0]),
            )
            for s in (0, 1)
        )
        objects = tuple(
            make_object(
                wanted,
                label,
                {
                    s: points[(session == s) & (object_id == wanted)]
                    for s in (0, 1)
                    if np.any((session == s) & (object_id == wanted))
                },
            )
            for wanted, label in sorted((labels or {}).items())
        )
        return SimpleNamespace(sessions=sessions, objects=objects, replaced=tuple(replaced))

    @staticmethod
    def position(at: Any) -> tuple[float, float, float]:
        """A number is a place on the x axis; offsets keep points clear of voxel borders."""
        x, y, z = at if isinstance(at, tuple) else (at, 0.0, 0.0)
        return (x + 0.02, y + 0.02, z + 0.02)


@pytest.fixture
def build() -> SceneBuilder:
    return SceneBuilder()
