"""Ray-cast pictures of a visit: colour, true depth, and which object every pixel shows."""

from __future__ import annotations

from dataclasses import dataclass

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
        vertices = np.ascontiguousarray(mesh.corners.reshape(-1, 3))
        triangles = np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3)
        self._scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(triangles))
        edge_a, edge_b = (mesh.corners[:, i] - mesh.corners[:, 0] for i in (1, 2))
        uv_a, uv_b = (mesh.uv[:, i] - mesh.uv[:, 0] for i in (1, 2))
        area = np.linalg.norm(np.cross(edge_a, edge_b), axis=1)
        uv_area = np.abs(uv_a[:, 0] * uv_b[:, 1] - uv_a[:, 1] * uv_b[:, 0])
        self._tiles_per_metre = np.sqrt(uv_area / np.maximum(area, 1e-12)).astype(np.float32)
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
        hit = self._scene.cast_rays(o3d.core.Tensor(rays))
        depth = hit["t_hit"].numpy()
        seen = np.flatnonzero(np.isfinite(depth))
        triangle = hit["primitive_ids"].numpy()[seen]
        u, v = hit["primitive_uvs"].numpy()[seen].T
        weights = np.stack([1 - u - v, u, v], axis=1)[:, :, None]

        ray = directions[seen]
        ray_length = np.linalg.norm(ray, axis=1)
        points = centre + ray * depth[seen, None]
        normals = (self._mesh.normals[triangle] * weights).sum(1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        facing = np.einsum("ij,ij->i", normals, ray)
        normals[facing > 0] *= -1
        cosine_seen = np.abs(facing) / ray_length

        tile = self._mesh.tile[triangle]
        uv = (self._mesh.uv[triangle] * weights).sum(1)
        pixel = depth[seen] / np.float32(camera.fx) / np.sqrt(np.maximum(cosine_seen, 0.1))
        albedo = self._atlas.sample(tile, uv, pixel * self._tiles_per_metre[triangle])
        self._stain(albedo, tile, uv)
        gloss_seen = self._atlas.gloss[tile]

        radiance = np.empty((height * width, 3), dtype=np.float32)
        missed = np.ones(height * width, dtype=bool)
        missed[seen] = False
        radiance[missed] = self._sky(directions[missed])
        radiance[seen] = self._shade(points, normals, ray / ray_length[:, None], albedo, gloss_seen)

        def full(values: NDArray, empty: float, kind: type) -> NDArray:
            image = np.full(height * width, empty, dtype=kind)
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
        hit = self._scene.cast_rays(o3d.core.Tensor(np.ascontiguousarray(rays)))
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
        rays: NDArray[np.float32],
        albedo: NDArray[np.float32],
        gloss: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        light = self._lighting
        upward = (normals[:, 2:] + 1) / 2
        received = upward * light.ambient_above.astype(np.float32)
        received += (1 - upward) * light.ambient_below.astype(np.float32)
        shine = np.zeros_like(received)
        shiny = np.flatnonzero(gloss > 0.05)
        mirrored = (
            rays[shiny] - 2 * np.einsum("ij,ij->i", rays[shiny], normals[shiny])[:, None] * normals[shiny]
        )
        for index, lamp in enumerate(light.lamps):
            towards, strength = _towards(lamp, points)
            lambert = np.maximum(np.einsum("ij,ij->i", normals, towards), 0) * strength
            if index == 0:
                lambert *= self._lit(points, normals, lamp, lambert > 0)
            power = lamp.power.astype(np.float32)
            received += lambert[:, None] * power
            aligned = np.maximum(np.einsum("ij,ij->i", mirrored, towards[shiny]), 0)
            highlight = aligned**40 * gloss[shiny] * strength[shiny]
            shine[shiny] += np.float32(0.5) * highlight[:, None] * power
        sky = light.ambient_above.astype(np.float32)
        reflected = np.maximum(mirrored[:, 2:], 0) * (gloss[shiny] * np.float32(0.22))[:, None] * sky
        shine[shiny] += reflected
        return albedo * received + shine

    def _lit(
        self, points: NDArray[np.float32], normals: NDArray[np.float32], lamp: Lamp, facing: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """1 where the lamp is seen, 0 in shadow."""
        lit = np.zeros(len(points), dtype=np.float32)
        origin = points[facing] + normals[facing] * np.float32(_SHADOW_OFFSET_M)
        target = lamp.position.astype(np.float32)
        ray = np.broadcast_to(target * 200, origin.shape) if lamp.is_sun else target - origin
        rays = np.ascontiguousarray(np.concatenate([origin, ray], axis=1))
        blocked = self._scene.test_occlusions(o3d.core.Tensor(rays), tnear=0.0, tfar=0.98).numpy()
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


def _towards(lamp: Lamp, points: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Unit vectors to the lamp and how much of its power arrives."""
    if lamp.is_sun:
        direction = (lamp.position / np.linalg.norm(lamp.position)).astype(np.float32)
        return np.broadcast_to(direction, points.shape), np.ones(len(points), dtype=np.float32)
    offset = lamp.position.astype(np.float32) - points
    distance = np.linalg.norm(offset, axis=1)
    return offset / np.maximum(distance, 1e-6)[:, None], 1 / (1 + (distance / np.float32(lamp.reach)) ** 2)
