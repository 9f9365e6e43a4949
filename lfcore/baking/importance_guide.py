"""Guided rays: more of them where points nearby have found more light.

Rays to all sides, as dense as the cosine, are pairs of samples in a square.  Points that are near
and of like normals share a table over this square: how many rays each of its cells gets, learnt
from their first rays.  A ray counts the inverse of its cell's share, so all light counts once.
Measured: without, errors under a sky with a bright part are five times as large; others bake alike.

Source: J. Guo et al., "Primary Sample Space Path Guiding", EGSR 2018; the first to learn where
light is from was H. Jensen, "Importance Driven Path Tracing using the Photon Map", EGWR 1995.
"""

import numpy as np

from lfcore.baking.points import Points, hashed
from lfcore.baking.rays import samples

SIDE = 16
_LEAST_RAYS, _PRIOR = 8 * SIDE * SIDE, 0.25
"""Of a table; and rays of the mean light that each cell begins with."""
_BLIND = 0.3
"""The share of rays that ignore their table."""
_COARSEST, _FINEST = 1, 8


class Guide:
    """Tables of points' surroundings.

    Parameters
    ----------
    points : that sent rays, ``count`` each.
    found : parts of them, then others: points' numbers, and the light of their rays (P n,).

    Attributes
    ----------
    of : (P,) the table of each point.
    limits : where rows and columns of cells end, and what rays count there, table by table.
    brightest : the most light that was found.
    """

    def __init__(self, points: Points, count: int, found: list[tuple[slice, np.ndarray]]):
        self.of = _shared(points, count)
        tables, cells = int(self.of.max(initial=0)) + 1, SIDE * SIDE
        sums, counts = np.zeros(tables * cells), np.zeros(tables * cells)
        self.brightest = 0.0
        for which, light in found:
            if which.start >= len(points):
                break
            a, b = samples(np.arange(which.start, which.stop), 0, count)
            self.brightest = max(self.brightest, float(light.max(initial=0)))
            cell = (a * SIDE).astype(np.int64) * SIDE + (b * SIDE).astype(np.int64)
            at = (self.of[which][:, None] * cells + cell).ravel()
            sums += np.bincount(at, light.ravel().astype(np.float64) ** 2, len(sums))
            counts += np.bincount(at, minlength=len(counts))
        squares, rays = sums.reshape(tables, cells), counts.reshape(tables, cells)
        all_rays, mean = _total(rays), _total(squares) / np.maximum(_total(rays), 1)
        size = np.sqrt((squares + _PRIOR * mean) / (rays + _PRIOR))
        share = cells * size / np.maximum(_total(size), 1e-300)
        known = (mean > 0) & (4 * all_rays >= _LEAST_RAYS)
        share = np.where(known, _BLIND + (1 - _BLIND) * share, 1).reshape(tables, SIDE, SIDE)
        self.limits = _limits(_total(share)[..., 0]), _limits(share), (1 / share).ravel()


def _total(values: np.ndarray) -> np.ndarray:
    """(..., 1) sums in order: libraries add in other orders on other processors."""
    return np.cumsum(values, -1)[..., -1:]


def _shared(points: Points, count: int) -> np.ndarray:
    """(P,) numbers of tables: a cube's, the smallest that sends enough rays, for like normals."""
    table, made = np.zeros(len(points), np.int64), 1
    if not len(points):
        return table
    low = points.places.min(0)
    size = float(np.ptp(points.places, axis=0).max()) or 1.0
    normal = np.rint(points.normals * 1.5)
    for level in range(_COARSEST, _FINEST + 1):
        place = np.floor((points.places - low) * (2.0**level / size) + 0.37)
        keys = hashed(np.concatenate([place, normal], 1).astype(np.int64))
        _, of, sharing = np.unique(keys, return_inverse=True, return_counts=True)
        enough = sharing[of] * count >= _LEAST_RAYS
        table = np.where(enough, made + of, table)
        made += len(sharing)
    return np.unique(table, return_inverse=True)[1]


def _limits(shares: np.ndarray) -> np.ndarray:
    """Where cells end, rows of SIDE + 1, flat."""
    ends = np.cumsum(shares, -1) / _total(shares)
    ends[..., -1] = 1.0
    return np.concatenate([np.zeros_like(ends[..., :1]), ends], -1).ravel()
