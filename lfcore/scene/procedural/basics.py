"""Short names of types that builders take and return, and surfaces of one colour or texture."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError
from lfcore.scene.surface_mesh import Colour, Surface, SurfaceMesh, hex_colour

Rng = np.random.Generator
Parts = list[SurfaceMesh]
Look = dict[str, Surface]
"""The surfaces of a model by name."""
Point = np.ndarray
"""(3,) float64."""
Vector = ArrayLike
"""(3,) numbers."""
Size = tuple[int, int]
Range = tuple[float, float]


def painted(
    name: str, colour: str, specular: float | Colour = 0.0, shininess: float = 32.0, **more: Any
) -> Surface:
    """A surface of one colour, ``#rrggbb`` in sRGB; a single ``specular`` is grey."""
    return Surface(name, hex_colour(colour), _triple(specular), shininess, **more)


def textured(
    name: str,
    texture: np.ndarray,
    specular: float | Colour = 0.0,
    shininess: float = 32.0,
    tone: float = 1.0,
) -> Surface:
    """A surface with a texture, darkened by ``tone``."""
    return Surface(name, _triple(tone), _triple(specular), shininess, texture=texture)


def _triple(colour: float | Colour) -> Colour:
    return colour if isinstance(colour, tuple) else (colour,) * 3


MOST_TRIANGLES = 50_000_000
"""The most triangles that a builder fills a scene up to: they fit into memory."""


def filled_to(
    triangles: int, parts: Parts, unit: SurfaceMesh, make: Callable[[int], SurfaceMesh]
) -> Parts:
    """``parts``, and ``make(number)`` copies of ``unit``, cut off at ``triangles`` triangles."""
    budget = triangles - sum(part.count for part in parts)
    if budget > MOST_TRIANGLES:
        raise SceneError(f"more than {MOST_TRIANGLES} triangles are asked for", key="triangles")
    if budget < 0:
        problem = f"the model alone has {-budget} triangles more than asked for"
        raise SceneError(problem, key="triangles")
    more = [make(-(-budget // unit.count)).picked(slice(budget))] if budget else []
    return parts + more
