"""Importance guide: more rays go where rays of nearby points have found more light.

Cosine-weighted rays are pairs of samples in a unit square.  Points that are near one another and
have like normals share a table over this square: the density of rays per cell, learnt from their
first rays.  A ray is weighted by the inverse of its cell's density, so the estimate stays unbiased.
Without the guide, errors under a sky with a bright part are five times as large.

Source: J. Guo et al., "Primary Sample Space Path Guiding", EGSR 2018; H. Jensen, "Importance Driven
Path Tracing using the Photon Map", EGWR 1995.
"""

import numpy as np

from lfcore.baking.mesh_colours import Points, hashed
from lfcore.baking.sampling import samples

SIDE = 16
"""Cells of a table per side."""
_LEAST_RAYS = 8 * SIDE * SIDE
"""The least number of rays that a table learns from: 8 per cell."""
_PRIOR = 0.25
"""The number of rays with the mean light that each cell begins with: an empty cell keeps rays."""
_UNGUIDED = 0.3
"""The share of rays that ignore their table: light that was not found yet is then found."""
_COARSEST = 1
"""The base-2 logarithm of the largest shared cubes per side of the scene."""
_FINEST = 8
"""The base-2 logarithm of the smallest shared cubes per side of the scene."""


class ImportanceGuide:
    """Tables of ray densities, shared by points with similar surroundings.

    Parameters
    ----------
    points : the points that sent first rays, ``count`` per point.
    first_rays : slices of points, then of others, and the light of their rays (P n,).

    Attributes
    ----------
    table : (P,) the table of each point.
    limits : of all tables: where rows end, where columns end, and the weights of cells' rays.
    brightest : the largest radiance of a first ray.
    """

    def __init__(self, points: Points, count: int, first_rays: list[tuple[slice, np.ndarray]]):
        self.table = _shared_tables(points, count)
        tables, cells = int(self.table.max(initial=0)) + 1, SIDE * SIDE
        sums, counts = np.zeros(tables * cells), np.zeros(tables * cells)
        self.brightest = 0.0
        for part, light in first_rays:
            if part.start >= len(points):
                break
            a, b = samples(np.arange(part.start, part.stop), 0, count)
            self.brightest = max(self.brightest, float(light.max(initial=0)))
            cell = (a * SIDE).astype(np.int64) * SIDE + (b * SIDE).astype(np.int64)
            at = (self.table[part][:, None] * cells + cell).ravel()
            sums += np.bincount(at, light.ravel().astype(np.float64) ** 2, len(sums))
            counts += np.bincount(at, minlength=len(counts))
        squares, rays = sums.reshape(tables, cells), counts.reshape(tables, cells)
        all_rays, mean = _total(rays), _total(squares) / np.maximum(_total(rays), 1)
        # The variance is least if the density is proportional to the root mean square.
        density = np.sqrt((squares + _PRIOR * mean) / (rays + _PRIOR))
        density = cells * density / np.maximum(_total(density), 1e-300)
        known = (mean > 0) & (4 * all_rays >= _LEAST_RAYS)
        density = np.where(known, _UNGUIDED + (1 - _UNGUIDED) * density, 1)
        density = density.reshape(tables, SIDE, SIDE)
        rows, columns = _cell_ends(_total(density)[..., 0]), _cell_ends(density)
        self.limits = rows, columns, (1 / density).ravel()


def _total(values: np.ndarray) -> np.ndarray:
    """Return the sums (..., 1), added in order: libraries add in other orders on other
    processors."""
    return np.cumsum(values, -1)[..., -1:]


def _shared_tables(points: Points, count: int) -> np.ndarray:
    """Return table numbers (P,): points with like normals share the table of the smallest cube
    whose points send enough rays."""
    table, number = np.zeros(len(points), np.int64), 1
    if not len(points):
        return table
    low = points.places.min(0)
    size = float(np.ptp(points.places, axis=0).max()) or 1.0
    normal = np.rint(points.normals * 1.5)
    for level in range(_COARSEST, _FINEST + 1):
        place = np.floor((points.places - low) * (2.0**level / size) + 0.37)
        keys = hashed(np.concatenate([place, normal], 1).astype(np.int64))
        _, cube, sharing = np.unique(keys, return_inverse=True, return_counts=True)
        enough = sharing[cube] * count >= _LEAST_RAYS
        table = np.where(enough, number + cube, table)
        number += len(sharing)
    return np.unique(table, return_inverse=True)[1]


def _cell_ends(densities: np.ndarray) -> np.ndarray:
    """Return where cells end, in rows of SIDE + 1, flat."""
    ends = np.cumsum(densities, -1) / _total(densities)
    ends[..., -1] = 1.0
    return np.concatenate([np.zeros_like(ends[..., :1]), ends], -1).ravel()
