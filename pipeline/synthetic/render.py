"""Ray-cast pictures of a visit: colour, true depth, and which object every pixel shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.synthetic.atlas import TextureAtlas
from pipeline.synthetic.shapes import Mesh
from pipeline.synthetic.textures import noise
from pipeline.synthetic.world import Lamp, Lighting

_SHADOW_OFFSET_M = 0.004  # keeps a surface from shadowing itself


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
    """The world of one visit, ready for ray casting (Open3D's Embree scene, on the CPU)."""

    def __init__(self, mesh: Mesh, owner: NDArray[np.int32], atlas: TextureAtlas, lighting: Lighting) -> None:
        self._mesh, self._owner, self._atlas, self._lighting = mesh, owner, atlas, lighting
        self._scene = o3d.t.geometry.RaycastingScene()
        vertices = mesh.corners.reshape(-1, 3)
        triangles = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
        self._scene.add_triangles(_tensor(vertices), _tensor(triangles))
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
        ones = np.ones((height, width), dtype=np.float32)
        rays_camera = camera.backproject(ones).reshape(-1, 3)  # z = 1, so that t is the depth
        directions = rays_camera @ T_world_camera[:3, :3].T.astype(np.float32)
        centre = T_world_camera[:3, 3].astype(np.float32)
        rays = np.concatenate([np.broadcast_to(centre, directions.shape), directions], axis=1)
        hit = self._scene.cast_rays(_tensor(rays))
        depth = hit["t_hit"].numpy()
        seen = np.flatnonzero(np.isfinite(depth))
        triangle = hit["primitive_ids"].numpy()[seen]
        barycentric = hit["primitive_uvs"].numpy()[seen]
        u, v = barycentric[:, :1], barycentric[:, 1:]
        row = self._attributes.take(triangle, axis=0)

        ray = directions[seen]
        ray_length = np.sqrt(_dot(ray, ray))
        points = centre + ray * depth[seen, None]
        normals = row[:, 0:3] + u * row[:, 3:6] + v * row[:, 6:9]
        facing = _dot(normals, ray)
        normals *= (-np.copysign(1 / np.sqrt(np.maximum(_dot(normals, normals), 1e-9)), facing))[:, None]
        cosine_seen = np.abs(_dot(normals, ray)) / ray_length

        tile = self._mesh.tile[triangle]
        uv = row[:, 9:11] + u * row[:, 11:13] + v * row[:, 13:15]
        pixel = depth[seen] / np.float32(camera.fx) / np.sqrt(np.maximum(cosine_seen, 0.1))
        albedo = self._atlas.sample(tile, uv, pixel * row[:, 15])
        self._stain(albedo, tile, uv)
        gloss_seen = self._atlas.gloss[tile]

        radiance = np.empty((height * width, 3), dtype=np.float32)
        missed = np.ones(height * width, dtype=bool)
        missed[seen] = False
        radiance[missed] = self._sky(directions[missed])
        radiance[seen] = self._shade(points, normals, ray / ray_length[:, None], albedo, gloss_seen)

        def full(values: NDArray, empty: float, kind: type) -> NDArray:
            image: NDArray = np.full(height * width, empty, dtype=kind)
            image[seen] = values
            return image.reshape(height, width)

        return View(
            radiance=radiance.reshape(height, width, 3),
            depth=depth.reshape(height, width),
            object_id=full(self._owner[triangle], 0, np.int32),
            cosine=full(cosine_seen, 0, np.float32),
            gloss=full(gloss_seen, 0, np.float32),
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

    def _stain(self, albedo: NDArray[np.float32], tile: NDArray[np.int32], uv: NDArray[np.float32]) -> None:
        """Break the repetition of tiles on wide surfaces, in place."""
        contrast = self._atlas.macro[tile]
        wide = np.flatnonzero(contrast)
        at = uv[wide] * np.float32(128 / 5.3)
        low = np.floor(at).astype(np.int32)
        weight = at - low
        (x0, y0), (x1, y1) = (low & 127).T, ((low + 1) & 127).T
        wx, wy = weight.T
        upper = self._stains[y0, x0] * (1 - wx) + self._stains[y0, x1] * wx
        lower = self._stains[y1, x0] * (1 - wx) + self._stains[y1, x1] * wx
        albedo[wide] *= (1 + contrast[wide] * (upper * (1 - wy) + lower * wy))[:, None]

    def _shade(
        self,
        points: NDArray[np.float32],
        normals: NDArray[np.float32],
        rays: NDArray[np.floating],
        albedo: NDArray[np.float32],
        gloss: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        light = self._lighting
        upward = (normals[:, 2:] + 1) / 2
        received = upward * light.ambient_above.astype(np.float32)
        received += (1 - upward) * light.ambient_below.astype(np.float32)
        shine = np.zeros_like(received)
        shiny = np.flatnonzero(gloss > 0.05)
        mirrored = rays[shiny] - 2 * _dot(rays[shiny], normals[shiny])[:, None] * normals[shiny]
        for index, lamp in enumerate(light.lamps):
            towards, strength = _towards(lamp, points)
            lambert = np.maximum(_dot(normals, towards), 0) * strength
            if index == 0:
                lambert *= self._lit(points, normals, lamp, lambert > 0)
            power = lamp.power.astype(np.float32)
            received += lambert[:, None] * power
            aligned = np.maximum(_dot(mirrored, towards[shiny]), 0)
            highlight = aligned**40 * gloss[shiny] * strength[shiny]
            shine[shiny] += np.float32(0.5) * highlight[:, None] * power
        sky = light.ambient_above.astype(np.float32)
        reflected = np.maximum(mirrored[:, 2:], 0) * (gloss[shiny] * np.float32(0.22))[:, None] * sky
        shine[shiny] += reflected
        return (albedo * received + shine).astype(np.float32, copy=False)

    def _lit(
        self, points: NDArray[np.float32], normals: NDArray[np.float32], lamp: Lamp, facing: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """1 where the lamp is seen, 0 in shadow."""
        lit = np.zeros(len(points), dtype=np.float32)
        origin = points[facing] + normals[facing] * np.float32(_SHADOW_OFFSET_M)
        target = lamp.position.astype(np.float32)
        ray = np.broadcast_to(target * 200, origin.shape) if lamp.is_sun else target - origin
        rays = np.concatenate([origin, ray], axis=1)
        blocked = self._scene.test_occlusions(_tensor(rays), tnear=0.0, tfar=0.98).numpy()
        lit[facing] = ~blocked
        return lit

    def _sky(self, directions: NDArray[np.float32]) -> NDArray[np.float32]:
        """Brighter towards the horizon, with clouds fixed to the direction."""
        unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        height = np.clip(unit[:, 2:], 0, 1)
        plane = unit[:, :2] / (0.25 + height)
        at = (plane * 14).astype(np.int32) & 127
        cloud = np.clip(self._stains[at[:, 1], at[:, 0]] * 0.25 + 0.3, 0, 1)[:, None] * (height > 0.02)
        sky = self._lighting.sky.astype(np.float32)
        return sky * (1.25 - 0.6 * height) * (1 - cloud) + np.float32(sky.max() * 1.1) * cloud


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """Row-wise scalar products, (N, 3) -> (N,)."""
    return np.einsum("ij,ij->i", a, b)


def _tensor(array: NDArray) -> Any:
    return o3d.core.Tensor(np.ascontiguousarray(array))  # type: ignore[call-overload]


def _towards(lamp: Lamp, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Unit vectors to the lamp and how much of its power arrives."""
    if lamp.is_sun:
        direction = (lamp.position / np.linalg.norm(lamp.position)).astype(np.float32)
        return np.broadcast_to(direction, points.shape), np.ones(len(points), dtype=np.float32)
    offset = lamp.position.astype(np.float32) - points
    distance = np.sqrt(_dot(offset, offset))
    arriving = 1 / (1 + (distance / np.float32(lamp.reach)) ** 2)
    offset /= np.maximum(distance, np.float32(1e-6))[:, None]
    return offset, arriving.astype(np.float32, copy=False)
