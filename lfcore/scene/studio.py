"""The studio around mesh files without lights: a soft sky, a directional light and a floor.

Unshadowed floor is as bright as the sky at the horizon, so that no edge is visible between them, as
with a photographer's backdrop.  There is no studio if the camera is inside the mesh's box, because
a room has its own walls and ground; and no floor if the camera is below it.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from lfcore.scene.appearance import Light
from lfcore.scene.assemble import assemble
from lfcore.scene.baked import BakeOptions
from lfcore.scene.framing import Bounds, default_lights
from lfcore.scene.model import Scene
from lfcore.scene.sky import texel_directions
from lfcore.scene.surface_mesh import DEFAULTS, Surface, SurfaceMesh, triple

ZENITH = (0.62, 0.65, 0.70)
"""The radiance of the sky's zenith, linear RGB."""
HORIZON = (0.42, 0.42, 0.42)
"""The radiance of the sky's horizon, linear RGB."""
KEY_LIGHT = (0.58, 0.56, 0.52)
"""The irradiance of the directional light, linear RGB."""
BAKE = BakeOptions(bounces=1, error=0.3, cells=16)
"""The settings of the bake: coarse, because the light of a smooth sky has little noise."""
SKY_SIDE = 32
"""The side of the sky's map, texels: the gradient is smooth."""
NAME = "floor under a mesh"
RINGS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.6, 2.2, 3.2, 4.5, 6.5)
"""The radii of the floor's rings, in radii of the mesh: finer where shadows fall."""
SECTORS = 24
"""The number of the floor's sectors."""
GAP = 1e-3
"""The distance from the mesh's lowest point down to the floor, in radii of the mesh: a flat foot
would coincide with the floor."""


def sky(to_camera: np.ndarray) -> np.ndarray:
    """An octahedral map, linear in the sine of the elevation."""
    up = texel_directions(SKY_SIDE) @ to_camera[:3, 1]
    zenith, horizon = np.array(ZENITH), np.array(HORIZON)
    return (horizon + np.maximum(up, 0)[..., None] * (zenith - horizon)).astype(np.float32)


def key_light() -> Light:
    """A directional light with shadows over the camera's left shoulder, in camera space."""
    return replace(default_lights()[0], colour=KEY_LIGHT)


def encloses(extent: Bounds, to_camera: np.ndarray) -> bool:
    """Whether the camera is inside a scene's box."""
    place = _camera(to_camera)
    return bool(((extent.low < place) & (place < extent.high)).all())


def lit(scene: Scene, to_camera: np.ndarray) -> Scene:
    """The scene in the light of the sky and the directional light."""
    return replace(scene, sky=sky(to_camera), lights=[key_light()], bake=scene.bake or BAKE)


def on_floor(scene: Scene, extent: Bounds, to_camera: np.ndarray, *, apart: bool) -> Scene:
    """The scene on a floor; ``apart``: the floor's material is not one of the scene's."""
    below = floor(extent, to_camera)
    if below is None:
        return scene
    ground = assemble([below], to_camera)
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(scene, name), default(ground.triangles).astype(np.float32)])
        for name, default in DEFAULTS.items()
        if len(getattr(scene, name))
    }
    (material,), number = ground.materials, np.int32(len(scene.materials))
    return replace(
        scene, **arrays, floor=material if apart else None,
        materials=scene.materials if apart else [*scene.materials, material],
        triangles=np.concatenate([scene.triangles, ground.triangles]),
        material_ids=np.concatenate([scene.material_ids, ground.material_ids + number]),
    )  # fmt: skip


def floor(extent: Bounds, to_camera: np.ndarray) -> SurfaceMesh | None:
    """A disc under the lowest point of a mesh, in world space, y up."""
    radius = extent.radius
    low = extent.low[1] - GAP * radius
    if not radius > 0 or _camera(to_camera)[1] <= low + GAP * radius:
        return None
    turn = np.arange(SECTORS + 1) * (2 * math.pi / SECTORS)
    rim = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], -1)
    places = np.array(RINGS)[:, None, None] * radius * rim
    places += [extent.centre[0], low, extent.centre[2]]
    a, b, c, d = places[:-1, :-1], places[1:, :-1], places[1:, 1:], places[:-1, 1:]
    inner = np.stack([a, b, c], 2)
    outer = np.stack([a, c, d], 2)[1:]  # the innermost ring is a fan
    triangles = np.concatenate([inner.reshape(-1, 3, 3), outer.reshape(-1, 3, 3)])
    # The floor reflects as much radiance as the horizon emits.  The sky's irradiance is the
    # integral of its gradient times the cosine.
    irradiance = np.array(HORIZON) / 3 + np.array(ZENITH) * 2 / 3
    cosine = max(float(to_camera[:3, 1] @ key_light().vector), 0.0)
    irradiance = irradiance + np.array(KEY_LIGHT) * cosine
    colour = triple(np.minimum(np.array(HORIZON) / irradiance, 0.9))
    return SurfaceMesh(triangles, Surface(NAME, diffuse=colour))


def _camera(to_camera: np.ndarray) -> np.ndarray:
    """The camera's position in the world."""
    return -to_camera[:3, :3].T @ to_camera[:3, 3]
