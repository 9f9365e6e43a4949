"""Scenes for the tracer's tests."""

import dataclasses
import math

import numpy as np
import plain_scenes
import trimesh

from lfcore.scene.appearance import POINT, Light, Material

CAMERA = dataclasses.replace(plain_scenes.CAMERA, f_number=1.0)


def scene(triangles, **changes):
    """A plain scene through a wider lens."""
    defaults = {"camera": CAMERA, "ambient": (0.2, 0.4, 0.6), "background": (0.7, 0.1, 0.3)}
    return plain_scenes.scene(triangles, **{**defaults, **changes})


def unit(*vector):
    """The direction of a vector, the same numbers on every processor."""
    return tuple(each / math.hypot(*vector) for each in vector)


def soup(count, seed, size=0.3):
    """``count`` random triangles before the lens, from slivers to large."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform([-0.7, -0.7, 0.6], [0.7, 0.7, 4.0], (count, 1, 3))
    return middle + rng.normal(size=(count, 3, 3)) * size * rng.random((count, 1, 1)) ** 3


def closed_room(subdivisions=3):
    """A sphere around the lens."""
    return trimesh.creation.icosphere(subdivisions, radius=3.0).triangles


def lit_soup(seed=3):
    """A soup before a wall, with smooth normals, vertex colours, gloss and a shadowing light."""
    rng = np.random.default_rng(seed)
    wall = np.float32([[[-9, -9, 5], [9, -9, 5], [9, 9, 5]], [[-9, -9, 5], [9, 9, 5], [-9, 9, 5]]])
    triangles = np.concatenate([soup(150, seed, 0.5), wall]).astype(np.float32)
    face = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals = face[:, None] / np.linalg.norm(face, axis=1)[:, None, None]
    normals = normals + rng.normal(size=(len(triangles), 3, 3)) * 0.2
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return scene(
        triangles,
        normals=normals.astype(np.float32),
        colours=rng.random((len(triangles), 3, 3)).astype(np.float32),
        materials=[Material("gloss", (0.7, 0.6, 0.5), (0.3, 0.3, 0.3), 20.0, (0.01, 0.02, 0.0))],
        lights=[Light(POINT, (1.0, -2.0, 0.5), (0.9, 0.8, 0.7), 2.0, True)],
    )


def painted_soup():
    """The lit soup in ambient light alone: its programs are built in less than half the time."""
    lit = lit_soup()
    return scene(lit.triangles, colours=lit.colours)
