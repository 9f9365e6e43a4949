"""Scenes of a few triangles, with nothing that they do not need; and calls that are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lfcore import LfcoreError, Material
from lfcore.evaluation.stability.tested_tracer import CAMERA, bare_scene
from lfcore.readers.meshes import read_mesh
from lfcore.scene.baked import NO_SKY

__all__ = ["CAMERA", "CHART", "SCENES", "balls", "in_even_light", "refused", "scene", "wall"]
SCENES = Path(__file__).parents[1] / "scenes"
CHART = SCENES / "chart"


def scene(triangles, **changes):
    """A grey scene of ``triangles`` (T, 3, 3), clipped at white; ``changes`` are fields of
    Scene."""
    grey = {
        "name": "test",
        "materials": [Material("grey", diffuse=(0.5, 0.5, 0.5))],
        "ambient": (0.1, 0.2, 0.3),
        "background": (0.7, 0.8, 0.9),
        "clip": True,
    }
    return bare_scene(triangles, **{**grey, **changes})


def in_even_light(made):
    """A scene whose surfaces show their own colours, whatever is around them."""
    white = (1.0, 1.0, 1.0)
    return replace(made, bake=None, sky=NO_SKY, ambient=white, background=white)


def wall(z, half=10.0):
    """Two triangles across the axis at depth z."""
    a, b, c, d = ([x * half, y * half, z] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.float32([[a, b, c], [a, c, d]])


def balls():
    """A ball of radius 1, and a smaller one before it to the left, as seen from the front."""
    near = trimesh.creation.icosphere(3, radius=0.4).apply_translation((-0.8, 0.3, 2.0))
    return trimesh.util.concatenate([trimesh.creation.icosphere(3), near])


def load_mesh(path, **how):
    """The parts of a mesh file."""
    return read_mesh(path, **how).parts


def refused(words, call, *arguments, **more):
    """The error of the library that a call raises, which says this in one line."""
    with pytest.raises(LfcoreError, match=words) as caught:
        call(*arguments, **more)
    assert "\n" not in str(caught.value)
    return caught.value
