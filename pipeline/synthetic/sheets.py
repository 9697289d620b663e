"""Curved surfaces from grids of points (ground, cloth, vaults) and tubes along a curve (pipes, hoses)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.synthetic.shapes import Mesh

Grid = NDArray[np.float64]


def sheet(points: Grid, tile: int, metres: float | None = 1.0, closed: bool = False) -> Mesh:
    """A smooth surface through a grid of points.

    Args:
        points: (rows, columns, 3) metres.
        tile: texture; its columns run along the columns of the grid.
        metres: edge of a tile on the surface; None = the sheet shows its tile exactly once.
        closed: whether the last column is joined to the first one (it must be the same points).

    Returns:
        Two triangles for each cell. The renderer shows both sides.
    """
    along = np.gradient(points, axis=1)
    if closed:
        # Across the seam the slope is that between its two neighbours.
        along[:, [0, -1]] = ((points[:, 1] - points[:, -2]) / 2)[:, None]
    normals = np.cross(along, np.gradient(points, axis=0))
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    rows, columns = points.shape[:2]
    if metres is None:
        u, v = np.linspace(0, 1, columns)[None, :], np.linspace(0, 1, rows)[:, None]
        uv = np.stack(np.broadcast_arrays(u, v), axis=-1)
    else:
        wide = np.linalg.norm(np.diff(points, axis=1), axis=-1).mean(axis=0)
        tall = np.linalg.norm(np.diff(points, axis=0), axis=-1).mean(axis=1)
        u = np.concatenate([[0], np.cumsum(wide)]) / metres
        v = np.concatenate([[0], np.cumsum(tall)]) / metres
        if closed and u[-1] > 0:
            u *= max(1.0, round(float(u[-1]))) / u[-1]
        uv = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)

    def triangles(values: Grid) -> NDArray[np.float32]:
        a, b, c, d = values[:-1, :-1], values[:-1, 1:], values[1:, 1:], values[1:, :-1]
        both = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)])
        return both.reshape(-1, 3, values.shape[-1]).astype(np.float32)

    corners = triangles(points)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    real = area > 1e-10
    return Mesh(
        corners[real], triangles(normals)[real], triangles(uv)[real], np.full(int(real.sum()), tile, np.int32)
    )


def tube(
    path: Grid, radius: float, tile: int, metres: float | None = 1.0, segments: int = 12, caps: bool = True
) -> Mesh:
    """A round tube along a curve.

    Args:
        path: (N, 3) metres; nowhere doubling back.
        radius: metres.
        tile: texture, wrapped around.
        metres: edge of a tile on the surface; None = once around and once along.
        segments: facets around.
        caps: whether both ends are closed.
    """
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # A frame carried along the curve, so that the tube does not twist.
    side = np.empty_like(tangent)
    start = np.cross(tangent[0], [0.0, 0.0, 1.0] if abs(tangent[0, 2]) < 0.9 else [1.0, 0.0, 0.0])
    side[0] = start / np.linalg.norm(start)
    for index in range(1, len(path)):
        carried = side[index - 1] - (side[index - 1] @ tangent[index]) * tangent[index]
        side[index] = carried / np.linalg.norm(carried)
    up = np.cross(side, tangent)
    angle = np.linspace(0, 2 * np.pi, segments + 1)
    ring = np.cos(angle)[None, :, None] * side[:, None] + np.sin(angle)[None, :, None] * up[:, None]
    grid = path[:, None] + radius * ring
    if caps:
        ends = [np.broadcast_to(path[i], grid[:1].shape) for i in (0, -1)]
        grid = np.concatenate([ends[0], grid, ends[1]])
    return sheet(grid, tile, metres, closed=True)
