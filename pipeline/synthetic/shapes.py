"""Triangle meshes with normals and texture coordinates: boxes, prisms, surfaces of revolution."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = Sequence[float]
Outline = Sequence[Sequence[float]]  # points (N, 2)


@dataclass(frozen=True)
class Mesh:
    """Triangles, each with its own corners, in the frame of the object (z up).

    Attributes:
        corners: (T, 3, 3) float32 metres, counter-clockwise from outside.
        normals: (T, 3, 3) float32 unit normals at the corners.
        uv: (T, 3, 2) float32 texture coordinates at the corners, 1 = one tile.
        tile: (T,) int32 tile of the atlas.
    """

    corners: NDArray[np.float32]
    normals: NDArray[np.float32]
    uv: NDArray[np.float32]
    tile: NDArray[np.int32]

    def placed(self, T: NDArray[np.float64]) -> Mesh:
        """The mesh after a rigid transform (4, 4)."""
        rotation = T[:3, :3].astype(np.float32)
        return Mesh(
            self.corners @ rotation.T + T[:3, 3].astype(np.float32),
            self.normals @ rotation.T,
            self.uv,
            self.tile,
        )

    def at(self, x: float = 0, y: float = 0, z: float = 0, yaw: float = 0, axis: str = "z") -> Mesh:
        """The mesh turned by ``yaw`` radians about an axis of its frame, then shifted by metres."""
        return self.placed(pose(x, y, z, yaw, axis))

    @property
    def bounds(self) -> NDArray[np.float32]:
        """(2, 3) least and greatest coordinates, metres."""
        flat = self.corners.reshape(-1, 3)
        return np.stack([flat.min(0), flat.max(0)])


def pose(x: float, y: float, z: float, yaw: float = 0, axis: str = "z") -> NDArray[np.float64]:
    """Rigid transform (4, 4): turn about one axis by radians, then shift by metres."""
    c, s = np.cos(yaw), np.sin(yaw)
    T = np.eye(4)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T[i, i], T[i, j], T[j, i], T[j, j] = c, -s, s, c
    T[:3, 3] = x, y, z
    return T


def join(meshes: Iterable[Mesh]) -> Mesh:
    """All triangles as one mesh."""
    parts = list(meshes)
    return Mesh(
        np.concatenate([part.corners for part in parts]),
        np.concatenate([part.normals for part in parts]),
        np.concatenate([part.uv for part in parts]),
        np.concatenate([part.tile for part in parts]),
    )


def box(
    low: Vector, high: Vector, tile: int | Sequence[int], metres: float | None = 1.0, shift: float = 0
) -> Mesh:
    """An axis-aligned box.

    Args:
        low: least corner, metres.
        high: greatest corner, metres.
        tile: one tile, or six for the faces -x, +x, -y, +y, -z, +z.
        metres: edge of a tile on the surface; None = each face shows its tile exactly once.
        shift: offset of the texture, in tiles.
    """
    tiles = [tile] * 6 if isinstance(tile, int) else list(tile)
    low_corner, high_corner = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    size = high_corner - low_corner
    faces = []
    for face in range(6):
        axis, positive = divmod(face, 2)
        # Texture columns run level, rows run down: print stands upright on the sides.
        across, upward = ((1, 2), (0, 2), (0, 1))[axis]
        mirrored = (axis == 1) == bool(positive)
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float64)
        corners = np.zeros((4, 3))
        corners[:, axis] = high_corner[axis] if positive else low_corner[axis]
        corners[:, across] = low_corner[across] + square[:, 0] * size[across]
        corners[:, upward] = low_corner[upward] + square[:, 1] * size[upward]
        uv = square.copy()
        if mirrored:
            uv[:, 0] = 1 - uv[:, 0]
        uv[:, 1] = 1 - uv[:, 1]
        if metres is not None:
            uv = uv * [size[across], size[upward]] / metres + shift
        normal = np.zeros(3)
        normal[axis] = 1 if positive else -1
        faces.append(_polygon(corners, normal, uv, tiles[face]))
    return join(faces)


def prism(outline: Outline, width: float, tile: int, metres: float = 1.0, taper: float = 1.0) -> Mesh:
    """A convex outline in the x-z plane, extruded along y, centred on y = 0.

    Args:
        outline: (N, 2) x and z, metres, counter-clockwise seen from -y.
        width: extent along y, metres.
        tile: texture.
        metres: edge of a tile on the surface.
        taper: width at the top of the outline relative to that at the bottom.
    """
    points = np.asarray(outline, dtype=np.float64)
    height = points[:, 1]
    share = (height - height.min()) / max(float(np.ptp(height)), 1e-9)
    half = width / 2 * (1 + (taper - 1) * share)
    near = np.stack([points[:, 0], -half, height], axis=1)
    far = near * [1, -1, 1]
    uv = np.stack([points[:, 0], -height], axis=1) / metres
    faces = [
        _polygon(near, _plane_normal(near), uv, tile),
        _polygon(far[::-1], _plane_normal(far[::-1]), uv[::-1], tile),
    ]
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.roll(points, -1, 0) - points, axis=1))])
    for i in range(len(points)):
        j = (i + 1) % len(points)
        corners = np.stack([near[j], near[i], far[i], far[j]])
        side = np.array([[length[i + 1], 0], [length[i], 0], [length[i], width], [length[i + 1], width]])
        faces.append(_polygon(corners, _plane_normal(corners), side[:, ::-1] / metres, tile))
    return join(faces)


def lathe(
    profile: Outline,
    tile: int,
    metres: float | None = 1.0,
    segments: int = 20,
    smooth: bool = False,
    bumps: NDArray[np.float64] | None = None,
) -> Mesh:
    """A surface of revolution about z.

    Args:
        profile: (N, 2) radius and height, metres, from bottom to top along the outside.
        tile: texture, wrapped around.
        metres: edge of a tile on the surface; None = the tile goes once around and once along.
        segments: facets around.
        smooth: smooth shading along the profile too (spheres), not only around it.
        bumps: (N, segments) factors on the radius, for foliage and stones.
    """
    radius, height = np.asarray(profile, dtype=np.float64).T
    rings = len(radius)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    factor = np.ones((rings, segments + 1))
    if bumps is not None:
        factor = np.concatenate([bumps, bumps[:, :1]], axis=1)
    spread = radius[:, None] * factor
    points = np.stack(
        [spread * np.cos(angle), spread * np.sin(angle), np.broadcast_to(height[:, None], spread.shape)],
        axis=-1,
    )
    length = np.concatenate([[0], np.cumsum(np.hypot(np.diff(radius), np.diff(height)))])
    around = angle / (2 * np.pi)
    if metres is None:
        u, v = around, 1 - length / length[-1]
    else:
        u, v = around * max(1.0, round(2 * np.pi * radius.max() / metres)), -length / metres
    uv = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)
    slope = np.stack([np.diff(height), -np.diff(radius)], axis=1)
    slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)
    below, above = slope, slope
    if smooth:
        vertex = np.concatenate([slope[:1], (slope[:-1] + slope[1:]) / 2, slope[-1:]])
        vertex /= np.maximum(np.linalg.norm(vertex, axis=1, keepdims=True), 1e-12)
        below, above = vertex[:-1], vertex[1:]

    def turned(normal: NDArray[np.float64]) -> NDArray[np.float64]:
        level = normal[:, :1, None] * np.stack([np.cos(angle), np.sin(angle)], -1)[None]
        return np.concatenate([level, np.broadcast_to(normal[:, 1:, None], (*level.shape[:2], 1))], axis=-1)

    n_low, n_high = turned(below), turned(above)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    na, nb, nc, nd = n_low[:, :-1], n_low[:, 1:], n_high[:, 1:], n_high[:, :-1]
    ta, tb, tc, td = uv[:-1, :-1], uv[:-1, 1:], uv[1:, 1:], uv[1:, :-1]

    def triangles(lower: tuple, upper: tuple) -> NDArray[np.float32]:
        both = np.stack([np.stack(lower, axis=-2), np.stack(upper, axis=-2)])
        return both.reshape(-1, 3, both.shape[-1]).astype(np.float32)

    corners = triangles((a, b, c), (a, c, d))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    real = area > 1e-9  # rings of radius zero leave triangles without area
    return Mesh(
        corners[real],
        triangles((na, nb, nc), (na, nc, nd))[real],
        triangles((ta, tb, tc), (ta, tc, td))[real],
        np.full(int(real.sum()), tile, dtype=np.int32),
    )


def cylinder(
    radius: float,
    height: float,
    tile: int,
    metres: float | None = 1.0,
    top: float | None = None,
    segments: int = 20,
) -> Mesh:
    """A closed cylinder (or frustum of top radius ``top``) standing on z = 0."""
    upper = radius if top is None else top
    return lathe([[0, 0], [radius, 0], [upper, height], [0, height]], tile, metres, segments)


def sphere(
    radius: float, tile: int, metres: float | None = 1.0, bumps: NDArray | None = None, flat: float = 1
) -> Mesh:
    """A sphere about the origin, its height scaled by ``flat``; ``bumps`` (9, 16) roughen it."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, 9)
    profile = np.stack([np.cos(latitude) * radius, np.sin(latitude) * radius * flat], axis=1)
    return lathe(profile.tolist(), tile, metres, 16, smooth=True, bumps=bumps)


def _plane_normal(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Newell's normal of a flat polygon, counter-clockwise from outside."""
    following = np.roll(corners, -1, axis=0)
    normal = np.cross(corners, following).sum(0)
    return normal / max(float(np.linalg.norm(normal)), 1e-12)


def _polygon(corners: NDArray, normal: NDArray, uv: NDArray, tile: int) -> Mesh:
    """Fan of a convex polygon."""
    fan = np.array([[0, i, i + 1] for i in range(1, len(corners) - 1)])
    normals = np.broadcast_to(normal, (len(fan), 3, 3))
    return Mesh(
        corners[fan].astype(np.float32),
        normals.astype(np.float32),
        uv[fan].astype(np.float32),
        np.full(len(fan), tile, dtype=np.int32),
    )
