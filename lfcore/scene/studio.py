"""What surrounds a mesh file without lights, and scenes that ask for it: a soft sky, one lamp, and
a floor.

Where nothing shadows the floor, it is as bright as the sky at the horizon, so that no edge shows
between them: a photographer's backdrop.  A mesh is left alone where the camera is within its box,
because a room has walls and a ground of its own.  A camera that is not above the floor would see
nothing but its underside, so there is none.
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

ZENITH, HORIZON = (0.62, 0.65, 0.70), (0.42, 0.42, 0.42)
LAMP = (0.58, 0.56, 0.52)
BAKE = BakeOptions(bounces=1, error=0.3, cells=16)
"""Coarse: the light of a smooth sky has little noise."""
SKY_SIDE = 32
NAME = "floor under a mesh"
RINGS = (0.0, 0.3, 0.6, 0.9, 1.2, 1.6, 2.2, 3.2, 4.5, 6.5)
"""Radii of the floor, in radii of the mesh: finer where it is shadowed."""
SECTORS = 24
GAP = 1e-3
"""From the lowest point down to the floor, in radii of the mesh, which may have a flat foot."""


def sky(to_camera: np.ndarray) -> np.ndarray:
    """A map as :mod:`lfcore.scene.sky` has it, linear in the sine of the elevation."""
    up = texel_directions(SKY_SIDE) @ to_camera[:3, 1]
    zenith, horizon = np.array(ZENITH), np.array(HORIZON)
    return (horizon + np.maximum(up, 0)[..., None] * (zenith - horizon)).astype(np.float32)


def lamp() -> Light:
    """A directional light with shadows over the camera's left shoulder, in camera space."""
    return replace(default_lights()[0], colour=LAMP)


def encloses(extent: Bounds, to_camera: np.ndarray) -> bool:
    """Whether the camera is within what is in a scene."""
    place = _camera(to_camera)
    return bool(((extent.low < place) & (place < extent.high)).all())


def lit(scene: Scene, to_camera: np.ndarray) -> Scene:
    """The scene in the light of sky and lamp."""
    return replace(scene, sky=sky(to_camera), lights=[lamp()], bake=scene.bake or BAKE)


def on_floor(scene: Scene, extent: Bounds, to_camera: np.ndarray, *, apart: bool) -> Scene:
    """The scene on a floor, which is ``apart`` from its own things, or one of them."""
    below = floor(extent, to_camera)
    if below is None:
        return scene
    made = assemble([below], to_camera)
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(scene, name), default(made.triangles).astype(np.float32)])
        for name, default in DEFAULTS.items()
        if len(getattr(scene, name))
    }
    (material,), number = made.materials, np.int32(len(scene.materials))
    return replace(
        scene, **arrays, floor=material if apart else None,
        materials=scene.materials if apart else [*scene.materials, material],
        triangles=np.concatenate([scene.triangles, made.triangles]),
        material_ids=np.concatenate([scene.material_ids, made.material_ids + number]),
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
    # It reflects as much of sky and lamp as the horizon sends.
    sent = np.array(HORIZON) / 3 + np.array(ZENITH) * 2 / 3  # the gradient's, times the cosine
    sent = sent + np.array(LAMP) * max(float(to_camera[:3, 1] @ lamp().vector), 0.0)
    colour = triple(np.minimum(np.array(HORIZON) / sent, 0.9))
    return SurfaceMesh(triangles, Surface(NAME, diffuse=colour))


def _camera(to_camera: np.ndarray) -> np.ndarray:
    """The camera's place in the world."""
    return -to_camera[:3, :3].T @ to_camera[:3, 3]
