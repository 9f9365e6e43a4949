"""Whether z is up in a mesh whose format does not say: as CAD programs and scanners write it.

Signs of it are a word in the file, a flat foot at the lower end of z and none at the ends of y, a
lower end at z = 0 with y = 0 about in the middle, and a terrain: low along z, with nearly all of
its surface facing +z.
"""

import re
from pathlib import Path

import numpy as np

from lfcore.scene.surface_mesh import SurfaceMesh

HEAD_BYTES = 4096
WORDS = re.compile(rb"\bz[-_ ]?(?:axis )?(?:is )?up\b|\bup[-_ ]?(?:axis|vector)?\W{1,3}z\b", re.I)
FOOT = 0.04
"""The least share of the surface that is a foot."""
CLEARLY = 4.0
"""The least factor between the area of a foot on z and that of flat ends of y, or of z's top."""
END = 0.02
"""The thickness of a foot, as a share of the greatest extent."""
LEVEL = 0.9
"""The least cosine between a foot's normals and the axis."""
ON_ZERO, ABOUT = 1e-3, 0.25
"""The distance of a lower end from z = 0, and of the middle from y = 0, at most, as shares of the
extent of the axis."""
LOW, FACING_UP = 0.35, 0.7
"""Terrain: height per lesser extent, at most; and the mean of the normals' z, at least."""


def z_seems_up(parts: list[SurfaceMesh], path: Path) -> bool:
    """Whether a mesh in world space, read from the file ``path``, stands on its xy plane."""
    with path.open("rb") as file:
        if WORDS.search(file.read(HEAD_BYTES)):
            return True
    triangles = np.concatenate([part.triangles for part in parts])
    triangles = triangles[np.isfinite(triangles).all((1, 2))]
    size = float(np.abs(triangles).max(initial=0.0))
    if not size:
        return False
    triangles = triangles / size
    low, high = triangles.min((0, 1)), triangles.max((0, 1))
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    area = np.linalg.norm(normals, axis=1)
    across, deep, height = high - low
    if 0 < height < LOW * min(across, deep) and normals[:, 2].sum() > FACING_UP * area.sum():
        return True
    middle = (low[1] + high[1]) / 2
    if (
        abs(low[2]) < ON_ZERO * height
        and abs(middle) < ABOUT * deep
        and abs(low[1]) > ON_ZERO * deep
    ):
        return True

    def flat_end(axis: int, end: np.ndarray, sign: int) -> float:
        at_end = (np.abs(triangles[:, :, axis] - end[axis]) <= END * (high - low).max()).all(1)
        return float(area[at_end & (sign * normals[:, axis] > LEVEL * area)].sum())

    foot = flat_end(2, low, -1)
    others = flat_end(1, low, -1), flat_end(1, high, 1), flat_end(2, high, 1)
    return foot > FOOT * area.sum() and foot > CLEARLY * max(others)
