"""A mirror and a coated wall before a camera, and what they show."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from plain_scenes import scene as plain_scene

from lfcore import Camera, Material, SensorPlane
from lfcore.scene.motion import Animation

CAMERA, PIXELS = Camera(0.4, 0.3, 1.0, 4.0), 32
PLANES = [SensorPlane(4.0, 1.0, "square"), SensorPlane(9.0, 1.0, "square")]
COAT = {"clearcoat": 1.0, "diffuse": (0.1, 0.1, 0.1)}
MIRROR = {"metallic": 1.0, "roughness": 0.0, "diffuse": (0.9, 0.9, 0.9)}


def wall(z, x0, x1, count, rng):
    """Columns of any colours at depth z: triangles (T, 3, 3) and colours (T, 3, 3)."""
    edges = np.linspace(x0, x1, count + 1)
    triangles = []
    for a, b in pairwise(edges):
        corners = np.array([(a, -6, z), (b, -6, z), (b, 6, z), (a, 6, z)])
        triangles += [corners[[0, 1, 2]], corners[[0, 2, 3]]]
    colours = np.repeat(rng.random((count, 1, 3)), 2, axis=0)
    return np.float32(triangles), np.broadcast_to(colours, (2 * count, 3, 3))


def make_scene(shapes):
    """A scene of (triangles, colours, fields of the material), which shows colours as they are."""
    triangles, colours = (np.concatenate([each[k] for each in shapes]) for k in (0, 1))
    ids = np.repeat(np.arange(len(shapes), dtype=np.int32), [len(each[0]) for each in shapes])
    materials = [Material(str(k), **each[2]) for k, each in enumerate(shapes)]
    return plain_scene(
        triangles, colours=colours.astype(np.float32), camera=CAMERA, ambient=(1.0, 1.0, 1.0),
        materials=materials, material_ids=ids,
    )  # fmt: skip


def mirror_room():
    """A mirror and a coat side by side at 4 m before a wall; another wall 4 m behind the camera
    moves to the right for a second, by 1 m."""
    rng = np.random.default_rng(5)
    mirror, coat = wall(4.0, -0.8, 0.1, 1, rng), wall(4.0, 0.1, 0.8, 3, rng)
    before, behind = wall(9.0, -6, 6, 30, rng), wall(-4.0, -6, 6, 40, rng)
    matt = [np.concatenate(both) for both in zip(before, behind, strict=True)]
    still = make_scene([(*mirror, MIRROR), (*coat, COAT), (*matt, {})])

    def at(now, time):
        moved = now.triangles.copy()
        moved[-80:, :, 0] += np.float32(time)
        return replace(now, triangles=moved)

    return replace(still, animation=Animation(0.0, 1.0, at))
