"""A scene of animated files, put together again at another instant.

Only what moves is new: materials, textures, the lens, the sky of a camera that does not turn, and
baked light stay.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lfcore.scene import framing
from lfcore.scene.appearance import Light
from lfcore.scene.assemble import assemble
from lfcore.scene.framing import FoundCamera, moved_light
from lfcore.scene.model import Scene
from lfcore.scene.motion import Moving, motions
from lfcore.scene.surface_mesh import SurfaceMesh, transform_all


@dataclass
class Objects:
    """What the objects of a description bring, in the world.

    ``still`` are parts that do not move otherwise than by a file's animation, ``camera`` is the
    first camera of a file.
    """

    still: list[SurfaceMesh]
    moving: list[Moving]
    lights: list[Light]
    camera: FoundCamera | None

    @property
    def parts(self) -> list[SurfaceMesh]:
        """All parts, those that do not move first."""
        return self.still + [part for part, _ in self.moving]

    def moves(self, to_camera: np.ndarray) -> list[Moving]:
        """The moving parts and their poses, in camera space."""
        return [
            (part.transformed(to_camera), (to_camera @ start, to_camera @ end))
            for part, (start, end) in self.moving
        ]


@dataclass(frozen=True)
class Replay:
    """The scene ``first``, whose world ``to_camera`` (4, 4) moves, at other instants.

    Attributes
    ----------
    objects_at : returns the objects at an instant.
    kept : the mask of the objects' triangles that the first scene has.
    object_lights : the number of lights from objects, which are the first scene's first ones.
    follows : whether the camera belongs to an object, and moves with it.
    sky_at : returns the sky for a (4, 4) matrix to camera space; None without a sky.
    """

    first: Scene
    to_camera: np.ndarray
    objects_at: Callable[[float], Objects]
    kept: np.ndarray
    object_lights: int
    follows: bool
    sky_at: Callable[[np.ndarray], np.ndarray] | None

    def __call__(self, scene: Scene, time_s: float) -> Scene:
        """``scene``, the first or a changed one, at an instant."""
        first, objects, pose = self.first, self.objects_at(time_s), self.to_camera
        if self.follows and objects.camera:
            pose = framing.pose_of(objects.camera)
        turn = pose @ np.linalg.inv(self.to_camera)
        if np.array_equal(pose, self.to_camera):
            turn = np.eye(4)
        geometry = assemble(objects.parts, pose)
        own = int(self.kept.sum())  # behind them is a floor
        changes: dict[str, Any] = {
            name: np.concatenate([getattr(geometry, name), getattr(first, name)[own:]])
            for name in ("uvs", "colours", "material_ids")
        }
        same = np.array_equal(geometry.kept, self.kept)
        if same:
            changes = {}
        floor, bent = first.triangles[own:].astype(np.float64), first.normals[own:]
        changes["triangles"] = _joined(geometry.triangles, floor @ turn[:3, :3].T + turn[:3, 3])
        changes["normals"] = _joined(geometry.normals, bent @ turn[:3, :3].T)
        count = self.object_lights
        count = count if scene.lights[:count] == first.lights[:count] else 0
        changes["lights"] = [moved_light(light, pose) for light in objects.lights[:count]]
        changes["lights"] += [moved_light(light, turn) for light in scene.lights[count:]]
        if objects.moving:
            still = transform_all(objects.still, pose)
            changes["motions"] = motions(geometry, still, objects.moves(pose))
        turned = not np.array_equal(turn[:3, :3], np.eye(3))
        if turned and self.sky_at and scene.sky is first.sky:
            changes["sky"] = self.sky_at(pose)
        return replace(scene, **changes, light=scene.light if same else None)


def _joined(moved: np.ndarray, floor: np.ndarray) -> np.ndarray:
    return np.concatenate([moved, floor.astype(np.float32)])
