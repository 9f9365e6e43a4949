"""Pictures of the OpenCL tracer against the oracle's, ray by ray (one lens sample)."""

import dataclasses

import numpy as np
import pytest

from lfcore.evaluation.stability.shapes import grid, sphere
from lfcore.evaluation.stability.tested_tracer import CAMERA, TracerUnderTest, bare_scene
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels, slab_hits, trace
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material

pytestmark = pytest.mark.kernels

CENTRE = np.array([0.13, 0.07, 2.2])
BALL = sphere(10, 16, 0.5, CENTRE)
WALL = grid(3, 3, [-3, -3, 4], [6, 0, 0.5], [0, 6, 0])
MESH = np.float32(np.concatenate([BALL, WALL]))
MATERIALS = [
    Material("ball", (0.9, 0.5, 0.7), (0.3, 0.2, 0.1), 20.0, (0.02, 0, 0), 0),
    Material("wall", (0.5, 0.6, 0.9)),
]
SUN = np.array([-0.5, -1, -1]) / 1.5
LIGHTS = [
    Light(POINT, (1.0, -2.0, 0.5), (1.0, 0.9, 0.8), 2.5),
    Light(DIRECTIONAL, tuple(SUN.tolist()), (0.4, 0.4, 0.5)),
    Light(POINT, (-1.0, 0.0, 0.0), (0.2, 0.1, 0.1), casts_shadows=False),
]


# Without shadows, whose programs are slow to build: for what "lights" and "all" see with them.
OPEN = [dataclasses.replace(light, casts_shadows=False) for light in LIGHTS]


def normals():
    ball = (BALL - CENTRE) / np.linalg.norm(BALL - CENTRE, axis=-1, keepdims=True)
    wall = np.broadcast_to(np.array([0.5, 0, -6.0]) / np.hypot(0.5, 6), WALL.shape)
    return np.float32(np.concatenate([ball, wall]))


def features():
    rng = np.random.default_rng(1)
    count = len(MESH)
    # Texels larger than pixels: the oracle has no mip levels.
    uvs = rng.uniform(-1, 2, (count, 1, 2)) + rng.uniform(0, 0.05, (count, 3, 2))
    ids = np.concatenate([np.zeros(len(BALL)), np.ones(len(WALL))]).astype(np.int32)
    textured = {
        "uvs": np.float32(uvs),
        "textures": [rng.integers(0, 256, (4, 5, 3)).astype(np.uint8)],
    }
    plain = [dataclasses.replace(material, texture=-1) for material in MATERIALS]
    return {
        "ambient": {},
        "lights": {"lights": LIGHTS},
        "normals": {"lights": OPEN, "normals": normals()},
        "highlights": {"lights": OPEN, "materials": plain, "material_ids": ids},
        "texture": {**textured, "materials": MATERIALS, "material_ids": ids},
        "vertex colours": {"colours": np.float32(rng.uniform(0.2, 1, (count, 3, 3)))},
        "all": {
            **textured,
            "lights": LIGHTS,
            "normals": normals(),
            "materials": MATERIALS,
            "material_ids": ids,
            "colours": np.float32(rng.uniform(0.2, 1, (count, 3, 3))),
        },
    }


@pytest.fixture(scope="module")
def tracer():
    return TracerUnderTest()


@pytest.mark.parametrize("name", features())
def test_picture_equals_the_oracle(name, tracer):
    scene = bare_scene(
        MESH, ambient=(0.1, 0.1, 0.2), background=(0.3, 0.2, 0.1), **features()[name]
    )
    slab = Slab(CAMERA, 1, 32)
    pixels = all_pixels(slab)
    clear = slab_hits(scene, slab, pixels).clear(32)
    assert clear.mean() > 0.9
    expected = trace(scene, slab, pixels)[:, 0, 0]
    plane = SensorPlane(CAMERA.focus_m, CAMERA.f_number, "square")
    found = tracer.picture(scene, slab, plane).reshape(-1, 3)
    error = np.abs(found - expected).max(1)[clear]
    # Texels are square roots in 10 bits, half a step is 1 / 1023 near white, under light up to 2.
    bound = 2 / 1023 if "textures" in features()[name] else 2e-5
    # A shadow's very edge may fall on a pixel or two.
    assert np.sort(error)[:-2].max() < bound
