"""Ray-cast pictures of a visit: colour, true depth, and which object every pixel shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera, rotate_points
from pipeline.synthetic.atlas import TextureAtlas
from pipeline.synthetic.shapes import Mesh
from pipeline.synthetic.textures import noise
from pipeline.synthetic.world import Lamp, Lighting

_SHADOW_OFFSET_M = 0.004  # keeps a surface from shadowing itself
# Pixels shaded at once: what they need stays in the processor's cache, which halves the time
_BAND_PIXELS = 1 << 14


@dataclass(frozen=True)
class View:
    """What a perfect camera sees.

    Attributes:
        radiance: (H, W, 3) float32 linear RGB before exposure.
        depth: (H, W) float32 metres along z; inf = sky.
        object_id: (H, W) int32, 0 = background or sky.
        cosine: (H, W) float32 between the surface's normal and the ray, in [0, 1].
        gloss: (H, W) float32 of the surface.
    """

    radiance: NDArray[np.float32]
    depth: NDArray[np.float32]
    object_id: NDArray[np.int32]
    cosine: NDArray[np.float32]
    gloss: NDArray[np.float32]


class Renderer:
    """The world of one visit, ready for ray casting (Open3D's Embree scene, on the CPU).

    Pixels are shaded in bands, as arrays of one component per row, (3, N): numpy is several times faster
    on those than on (N, 3).
    """

    def __init__(self, mesh: Mesh, owner: NDArray[np.int32], atlas: TextureAtlas, lighting: Lighting) -> None:
        self._mesh, self._owner, self._lighting = mesh, owner, lighting
        self._textures, self._gloss, self._macro = atlas.sampler(), atlas.gloss, atlas.macro
        self._scene = o3d.t.geometry.RaycastingScene()
        vertices = mesh.corners.reshape(-1, 3)
        triangles = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
        self._scene.add_triangles(_tensor(vertices), _tensor(triangles))
        # Open3D builds its tree at the first ray, which must not happen in two threads at once.
        self._scene.cast_rays(_tensor(np.zeros((1, 6), dtype=np.float32)))
        edge_a, edge_b = (mesh.corners[:, i] - mesh.corners[:, 0] for i in (1, 2))
        uv_a, uv_b = (mesh.uv[:, i] - mesh.uv[:, 0] for i in (1, 2))
        area = np.linalg.norm(np.cross(edge_a, edge_b), axis=1)
        uv_area = np.abs(uv_a[:, 0] * uv_b[:, 1] - uv_a[:, 1] * uv_b[:, 0])
        tiles_per_metre = np.sqrt(uv_area / np.maximum(area, 1e-12))
        # One row of 16 floats per triangle, a cache line: everything a pixel needs comes in one gather.
        n0, n1, n2 = (mesh.normals[:, i] for i in range(3))
        attributes = [n0, n1 - n0, n2 - n0, mesh.uv[:, 0], uv_a, uv_b, tiles_per_metre[:, None]]
        self._attributes = np.concatenate(attributes, axis=1).astype(np.float32)
        stains = noise(np.random.default_rng(7), 128, 1.5)
        self._stains = np.clip(stains, -2, 2)

    def view(self, camera: PinholeCamera, T_world_camera: NDArray[np.float64]) -> View:
        """Render one picture."""
        height, width = camera.height, camera.width
        pixels = height * width
        view = View(
            radiance=np.empty((pixels, 3), dtype=np.float32),
            depth=np.empty(pixels, dtype=np.float32),
            object_id=np.zeros(pixels, dtype=np.int32),
            cosine=np.zeros(pixels, dtype=np.float32),
            gloss=np.zeros(pixels, dtype=np.float32),
        )
        rays_camera = camera.backproject(np.ones((height, width), dtype=np.float32)).reshape(-1, 3)
        directions = rotate_points(T_world_camera[:3, :3], rays_camera)
        centre = T_world_camera[:3, 3].astype(np.float32)
        for begin in range(0, pixels, _BAND_PIXELS):
            band = slice(begin, min(begin + _BAND_PIXELS, pixels))
            self._draw(view, band, centre, directions[band], camera.fx)
        return View(
            radiance=view.radiance.reshape(height, width, 3),
            depth=view.depth.reshape(height, width),
            object_id=view.object_id.reshape(height, width),
            cosine=view.cosine.reshape(height, width),
            gloss=view.gloss.reshape(height, width),
        )

    def first_hit(
        self, centre: NDArray[np.float64], points_world: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """What stands first on the line from a camera centre towards each point.

        Returns:
            (N,) distance of the first hit over the distance of the point (inf = nothing), and (N,) the
            object that was hit (0 = background or nothing).
        """
        origin = np.broadcast_to(centre.astype(np.float32), points_world.shape)
        rays = np.concatenate([origin, points_world - origin], axis=1)
        hit = self._scene.cast_rays(_tensor(rays))
        share = hit["t_hit"].numpy()
        owner = np.zeros(len(share), dtype=np.int32)
        found = np.isfinite(share)
        owner[found] = self._owner[hit["primitive_ids"].numpy()[found]]
        return share, owner

    def _draw(
        self,
        view: View,
        band: slice,
        centre: NDArray[np.float32],
        directions: NDArray[np.float32],
        focal_px: float,
    ) -> None:
        """Fill in a band of pixels, those of the rays from ``centre`` in (N, 3) directions of z = 1."""
        rays = np.empty((len(directions), 6), dtype=np.float32)
        rays[:, :3] = centre
        rays[:, 3:] = directions
        hit = self._scene.cast_rays(_tensor(rays))
        depth = hit["t_hit"].numpy()
        triangle: NDArray[np.uint32] = hit["primitive_ids"].numpy()
        barycentric: NDArray[np.float32] = hit["primitive_uvs"].numpy().T
        view.depth[band] = depth
        ray = np.ascontiguousarray(directions.T)
        at: slice | NDArray[np.intp] = band
        found = np.isfinite(depth)
        if not found.all():
            missed, seen = np.flatnonzero(~found), np.flatnonzero(found)
            view.radiance[band.start + missed] = self._sky(ray.take(missed, axis=1)).T
            at = band.start + seen
            ray, barycentric = ray.take(seen, axis=1), barycentric.take(seen, axis=1)
            depth, triangle = depth.take(seen), triangle.take(seen)
        u, v = np.ascontiguousarray(barycentric)
        row = np.ascontiguousarray(self._attributes.take(triangle, axis=0).T)
        ray_length = np.sqrt(_dot(ray, ray))
        points = ray * depth
        points += centre[:, None]
        normals = row[0:3] + u * row[3:6]
        normals += v * row[6:9]
        facing = _dot(normals, ray)
        normals *= -np.copysign(1 / np.sqrt(np.maximum(_dot(normals, normals), 1e-9)), facing)
        cosine = np.abs(_dot(normals, ray)) / ray_length
        tile = self._mesh.tile.take(triangle)
        uv = row[9:11] + u * row[11:13]
        uv += v * row[13:15]
        footprint = depth / np.float32(focal_px) / np.sqrt(np.maximum(cosine, 0.1)) * row[15]
        albedo = self._textures.sample(tile, uv, footprint)
        self._stain(albedo, tile, uv)
        gloss = self._gloss.take(tile)
        view.radiance[at] = self._shade(points, normals, ray, ray_length, albedo, gloss).T
        view.object_id[at] = self._owner.take(triangle)
        view.cosine[at] = cosine
        view.gloss[at] = gloss

    def _stain(self, albedo: NDArray[np.float32], tile: NDArray[np.int32], uv: NDArray[np.float32]) -> None:
        """Break the repetition of tiles on wide surfaces, in place."""
        contrast = self._macro.take(tile)
        wide = np.flatnonzero(contrast)
        at = uv.take(wide, axis=1) * np.float32(128 / 5.3)
        floor = np.floor(at)
        low = floor.astype(np.int32)
        wx, wy = at - low
        (x0, y0), (x1, y1) = low & 127, (low + 1) & 127
        stains = self._stains.reshape(-1)
        y0 *= 128
        y1 *= 128
        upper = stains.take(y0 + x0) * (1 - wx) + stains.take(y0 + x1) * wx
        lower = stains.take(y1 + x0) * (1 - wx) + stains.take(y1 + x1) * wx
        factor = 1 + contrast.take(wide) * (upper * (1 - wy) + lower * wy)
        albedo[:, wide] *= factor

    def _shade(
        self,
        points: NDArray[np.float32],
        normals: NDArray[np.float32],
        rays: NDArray[np.float32],
        ray_length: NDArray[np.float32],
        albedo: NDArray[np.float32],
        gloss: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        """Linear RGB (3, N) of what lies at the points, (3, N)."""
        light = self._lighting
        upward = (normals[2] + 1) / 2
        received = upward * _column(light.ambient_above)
        received += (1 - upward) * _column(light.ambient_below)
        shiny = np.flatnonzero(gloss > 0.05)
        shiny_normals, shiny_gloss = normals.take(shiny, axis=1), gloss.take(shiny)
        shiny_rays = rays.take(shiny, axis=1) / ray_length.take(shiny)
        mirrored = shiny_rays - 2 * _dot(shiny_rays, shiny_normals) * shiny_normals
        shine = np.zeros_like(mirrored)
        for index, lamp in enumerate(light.lamps):
            towards, strength = _towards(lamp, points)
            lambert = np.maximum(_dot(normals, towards), 0) * strength
            if index == 0:
                self._shadow(lambert, points, normals, lamp)
            received += lambert * _column(lamp.power)
            if len(shiny):
                aligned = np.maximum(_dot(mirrored, towards.take(shiny, axis=1)), 0)
                highlight = aligned**40 * shiny_gloss * strength.take(shiny)
                shine += np.float32(0.5) * highlight * _column(lamp.power)
        shine += np.maximum(mirrored[2], 0) * (shiny_gloss * np.float32(0.22)) * _column(light.ambient_above)
        received *= albedo
        if len(shiny):
            received[:, shiny] += shine
        return received

    def _shadow(
        self,
        lambert: NDArray[np.float32],
        points: NDArray[np.float32],
        normals: NDArray[np.float32],
        lamp: Lamp,
    ) -> None:
        """Put out the light of a lamp where it is not seen, in place."""
        facing = np.flatnonzero(lambert)
        origin = points.take(facing, axis=1) + normals.take(facing, axis=1) * np.float32(_SHADOW_OFFSET_M)
        target = _column(lamp.position)
        rays = np.empty((len(facing), 6), dtype=np.float32)
        rays[:, :3] = origin.T
        rays[:, 3:] = (target * 200 if lamp.is_sun else target - origin).T
        blocked = self._scene.test_occlusions(_tensor(rays), tnear=0.0, tfar=0.98).numpy()
        lambert[facing[blocked]] = 0

    def _sky(self, directions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Linear RGB (3, N): brighter towards the horizon, with clouds fixed to the direction."""
        unit = directions / np.sqrt(_dot(directions, directions))
        height = np.clip(unit[2], 0, 1)
        plane = unit[:2] / (0.25 + height)
        x, y = (plane * 14).astype(np.int32) & 127
        cloud = np.clip(self._stains[y, x] * 0.25 + 0.3, 0, 1) * (height > 0.02)
        sky = _column(self._lighting.sky)
        return sky * (1.25 - 0.6 * height) * (1 - cloud) + np.float32(sky.max() * 1.1) * cloud


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Scalar products of columns, (3, N) -> (N,)."""
    total = a[0] * b[0]
    total += a[1] * b[1]
    total += a[2] * b[2]
    return total


def _column(values: NDArray[np.float64]) -> NDArray[np.float32]:
    """Three numbers as (3, 1)."""
    return values.astype(np.float32)[:, None]


def _tensor(array: NDArray) -> Any:
    return o3d.core.Tensor(np.ascontiguousarray(array))  # type: ignore[call-overload]


def _towards(lamp: Lamp, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Unit vectors (3, N) to the lamp and how much of its power arrives, (N,)."""
    if lamp.is_sun:
        direction = (lamp.position / np.linalg.norm(lamp.position)).astype(np.float32)
        return np.broadcast_to(direction[:, None], points.shape), np.ones(points.shape[1], dtype=np.float32)
    offset = _column(lamp.position) - points
    distance = np.sqrt(_dot(offset, offset))
    arriving = 1 / (1 + (distance / np.float32(lamp.reach)) ** 2)
    offset /= np.maximum(distance, np.float32(1e-6))
    return offset, arriving.astype(np.float32, copy=False)
