"""How an object got from its place in one visit to its place in the other, and whether that is a move.

An object is *moved* when the centroid of its surface lies more than 5 cm from where it was, or it is turned
by more than 10 degrees and is not symmetric under that turn. Less is *static*: a jolt, not a change.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import invert_rigid
from pipeline.synthetic.shapes import Mesh, pose

MOVED_BEYOND_M = 0.05
TURNED_BEYOND_DEG = 10.0


class Placed(Protocol):
    """What :class:`pipeline.synthetic.world.SceneObject` says of itself here."""

    @property
    def mesh(self) -> Mesh:
        """In the frame of the object, z up."""

    @property
    def poses(self) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
        """T_world_object of both visits."""

    @property
    def symmetry_order(self) -> int:
        """1 = none, n = n-fold about the object's z axis, 0 = any angle."""


def T_world_motion(thing: Placed) -> NDArray[np.float64]:
    """(4, 4) with p_current = T p_previous for points of the object in the world.

    Raises:
        ValueError: the object is there in one visit only.
    """
    before, after = thing.poses
    if before is None or after is None:
        raise ValueError("an object that is there in one visit only has no motion")
    return after @ invert_rigid(before)


def shift_m(thing: Placed) -> float:
    """How far the centroid of the surface went, metres."""
    centre = np.append(surface_centroid(thing.mesh), 1.0)
    before, after = thing.poses
    assert before is not None and after is not None
    return float(np.linalg.norm((after @ centre - before @ centre)[:3]))


def turn_deg(thing: Placed) -> float:
    """The least rotation that explains how it stands, given its symmetry, degrees."""
    before, after = thing.poses
    assert before is not None and after is not None
    turned = before[:3, :3].T @ after[:3, :3]  # in the frame of the object
    if thing.symmetry_order == 0:
        # Only where its axis points can be seen.
        return float(np.degrees(np.arccos(np.clip(turned[2, 2], -1, 1))))
    steps = [pose(0, 0, 0, 2 * np.pi * k / thing.symmetry_order) for k in range(thing.symmetry_order)]
    traces = [np.trace(turned @ step[:3, :3]) for step in steps]
    return float(np.degrees(np.arccos(np.clip((max(traces) - 1) / 2, -1, 1))))


def is_move(thing: Placed) -> bool:
    """Whether it is there in both visits and was moved in the sense above."""
    if thing.poses[0] is None or thing.poses[1] is None:
        return False
    return shift_m(thing) > MOVED_BEYOND_M or turn_deg(thing) > TURNED_BEYOND_DEG


def surface_centroid(mesh: Mesh) -> NDArray[np.float64]:
    """(3,) centroid of the surface in the frame of the object, metres."""
    corners = mesh.corners.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return (corners.mean(axis=1) * area[:, None]).sum(axis=0) / max(float(area.sum()), 1e-12)
