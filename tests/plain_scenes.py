"""Scenes of a few triangles, with nothing that they do not need."""

from pathlib import Path

import numpy as np

from lfcore.evaluation.stability.tested_tracer import CAMERA, bare_scene
from lfcore.scene.appearance import Material

__all__ = ["CAMERA", "CHART", "scene", "wall"]
CHART = Path(__file__).parents[1] / "scenes" / "chart"


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


def wall(z, half=10.0):
    """Two triangles across the axis at depth z."""
    a, b, c, d = ([x * half, y * half, z] for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)))
    return np.float32([[a, b, c], [a, c, d]])
