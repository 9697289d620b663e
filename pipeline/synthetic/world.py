"""What a synthetic scene is made of: objects with a pose per visit, background, lights, camera paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import PinholeCamera
from pipeline.synthetic.atlas import TextureAtlas
from pipeline.synthetic.motion import is_move
from pipeline.synthetic.shapes import Mesh, join

Pose = NDArray[np.float64]


@dataclass(frozen=True)
class SceneObject:
    """A thing with one identity.

    Attributes:
        object_id: 1, 2, ...; the same in both visits.
        class_name: for people; the pipeline never sees it.
        mesh: in the frame of the object, standing on z = 0.
        poses: T_world_object of visit 0 and visit 1, each (4, 4); None = not there in that visit.
        replaced_by: the object that took its place in visit 1.
        symmetry_order: of shape and print together: 1 = none, n = n-fold about its z axis, 0 = any angle.
        story: how it changed, for people and for tables by kind of change (see ``changes``).
        mesh_current: its shape in visit 1 where that differs: cloth in the wind. Still the same thing.
    """

    object_id: int
    class_name: str
    mesh: Mesh
    poses: tuple[Pose | None, Pose | None]
    replaced_by: int | None = None
    symmetry_order: int = 1
    story: str = ""
    mesh_current: Mesh | None = None

    @property
    def is_moved(self) -> bool:
        """Whether it is there in both visits and was moved (see ``motion``: 5 cm, 10 degrees)."""
        return is_move(self)

    @property
    def fate(self) -> str:
        """What truly happened, whether or not any camera saw it."""
        if self.poses[0] is None:
            return "appeared"
        if self.poses[1] is None:
            return "replaced" if self.replaced_by is not None else "disappeared"
        return "moved" if self.is_moved else "static"


@dataclass(frozen=True)
class Lamp:
    """A light. Position in metres for a lamp in the room; for the sun, the direction towards it.

    ``power`` is linear RGB; a lamp's falls with distance over ``reach`` metres.
    """

    position: NDArray[np.float64]
    power: NDArray[np.float64]
    reach: float = 3.0
    is_sun: bool = False


@dataclass(frozen=True)
class Lighting:
    """Light of one visit: the first lamp casts shadows. Ambient light and sky are linear RGB."""

    lamps: tuple[Lamp, ...]
    ambient_above: NDArray[np.float64]
    ambient_below: NDArray[np.float64]
    sky: NDArray[np.float64]
    exposure: float


@dataclass(frozen=True)
class SensorSettings:
    """The depth and colour camera, and how well it knows where it is.

    Depth deviates by ``depth_noise_m + depth_noise_per_m * z^2``; units in the names.
    """

    min_range_m: float = 0.3
    max_range_m: float = 8.0
    depth_noise_m: float = 0.0015
    depth_noise_per_m: float = 0.0012
    disparity_step_m: float = 0.0012  # depth is quantised in steps of this times z^2
    hole_cosine: float = 0.12  # surfaces seen flatter than this mostly give no depth
    gloss_holes: float = 0.5  # share of depth lost on glass
    image_noise: float = 0.012  # deviation of intensity in [0, 1]
    image_blur_px: float = 0.55
    exposure_jitter: float = 0.05
    pose_noise_m: float = 0.005
    pose_noise_deg: float = 0.1


@dataclass(frozen=True)
class SyntheticScene:
    """Everything that is drawn from the seed.

    Attributes:
        name: kind of scene.
        seed: what it was drawn from.
        atlas: textures of all meshes.
        background: mesh in the world that never changes (object 0).
        objects: all things of both visits; their ids are 1, 2, ... in order.
        lighting: of visit 0 and visit 1.
        paths: T_world_camera of every keyframe, (frames, 4, 4), of visit 0 and visit 1.
        camera: of both visits.
        sensor: of both visits.
        truth_voxel_m: spacing of the ground truth's points.
    """

    name: str
    seed: int
    atlas: TextureAtlas
    background: Mesh
    objects: tuple[SceneObject, ...]
    lighting: tuple[Lighting, Lighting]
    paths: tuple[NDArray[np.float64], NDArray[np.float64]]
    camera: PinholeCamera
    sensor: SensorSettings
    truth_voxel_m: float

    def mesh_of_visit(self, visit: int) -> tuple[Mesh, NDArray[np.int32]]:
        """World mesh of a visit and the object of each of its triangles (0 = background)."""
        meshes, owners = [self.background], [np.zeros(len(self.background.tile), dtype=np.int32)]
        for thing in self.objects:
            T_world_object = thing.poses[visit]
            if T_world_object is not None:
                mesh = thing.mesh_current if visit and thing.mesh_current is not None else thing.mesh
                meshes.append(mesh.placed(T_world_object))
                owners.append(np.full(len(thing.mesh.tile), thing.object_id, dtype=np.int32))
        return join(meshes), np.concatenate(owners)
