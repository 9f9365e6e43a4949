"""Scenes of a few triangles, with nothing that they do not need."""

import dataclasses

import numpy as np

from lfcore.optics.camera import Camera
from lfcore.scene.appearance import Material
from lfcore.scene.model import Scene

CAMERA = Camera(focal_length_m=0.05, sensor_width_m=0.036, f_number=2.0, focus_m=2.0)


def scene(triangles, **changes):
    """A grey scene of ``triangles`` (T, 3, 3), clipped at white; ``changes`` are fields of
    Scene."""
    triangles = np.ascontiguousarray(triangles, np.float32)
    base = Scene(
        name="test",
        camera=CAMERA,
        triangles=triangles,
        normals=np.zeros((0, 3, 3), np.float32),
        uvs=np.zeros((0, 3, 2), np.float32),
        colours=np.zeros((0, 3, 3), np.float32),
        material_ids=np.zeros(len(triangles), np.int32),
        materials=[Material("grey", diffuse=(0.5, 0.5, 0.5))],
        textures=[],
        lights=[],
        ambient=(0.1, 0.2, 0.3),
        background=(0.7, 0.8, 0.9),
        clip=True,
    )
    return dataclasses.replace(base, **changes)


def wall(z, half=10.0):
    """Two triangles across the axis at depth z."""
    a, b, c, d = ([x * half, y * half, z] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.float32([[a, b, c], [a, c, d]])
