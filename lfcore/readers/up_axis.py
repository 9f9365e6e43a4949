"""Whether z is up in a mesh file that does not state its axis: by its comments and its shape."""

import re
from pathlib import Path

import numpy as np

from lfcore.scene.arrays import columnwise, dot
from lfcore.scene.surface_mesh import SurfaceMesh, area_vectors

HEAD_BYTES = 4096
"""The part of a file, bytes, that is searched for the words."""
WORDS = re.compile(rb"\bz[-_ ]?(?:axis )?(?:is )?up\b|\bup[-_ ]?(?:axis|vector)?\W{1,3}z\b", re.I)
FOOT = 0.04
"""The least share of the surface that is a foot."""
CLEARLY = 4.0
"""The least ratio of a foot's area on z to the flat area at both ends of y, and at z's top."""
END = 0.02
"""The thickness of a foot, as a share of the greatest extent."""
LEVEL = 0.9
"""The least cosine between a foot's normals and the axis."""
ON_ZERO = 1e-3
"""The greatest distance of a lower end from 0, as a share of the axis's extent."""
ABOUT = 0.25
"""The greatest distance of the middle from y = 0, as a share of the extent of y."""
LOW = 0.35
"""Terrain: the greatest height, as a share of the lesser horizontal extent."""
FACING_UP = 0.7
"""Terrain: the least mean of the normals' z."""


def z_seems_up(parts: list[SurfaceMesh], path: Path) -> bool:
    """Whether a mesh in world space, read from the file ``path``, stands on its xy plane."""
    with path.open("rb") as file:
        if WORDS.search(file.read(HEAD_BYTES)):
            return True
    flat = np.concatenate([part.triangles.reshape(-1, 9) for part in parts])
    largest = columnwise(np.maximum, np.abs(flat))
    finite = np.isfinite(largest)
    size = float(largest[finite].max(initial=0.0))
    if not size:
        return False
    triangles = (flat if finite.all() else flat[finite]).reshape(-1, 3, 3) / size
    low, high = (np.array([of(triangles[..., k]) for k in range(3)]) for of in (np.min, np.max))
    normals = area_vectors(triangles) / 2
    area = np.sqrt(dot(normals, normals))
    across, deep, height = high - low
    if 0 < height < LOW * min(across, deep) and normals[:, 2].sum() > FACING_UP * area.sum():
        return True
    middle = (low[1] + high[1]) / 2
    on_zero = abs(low[2]) < ON_ZERO * height and abs(low[1]) > ON_ZERO * deep
    if on_zero and abs(middle) < ABOUT * deep:
        return True

    def flat_end(axis: int, end: np.ndarray, sign: int) -> float:
        near = np.abs(triangles[:, :, axis] - end[axis]) <= END * (high - low).max()
        at_end = columnwise(np.logical_and, near)
        return float(area[at_end & (sign * normals[:, axis] > LEVEL * area)].sum())

    foot = flat_end(2, low, -1)
    rivals = flat_end(1, low, -1), flat_end(1, high, 1), flat_end(2, high, 1)
    return foot > FOOT * area.sum() and foot > CLEARLY * max(rivals)
