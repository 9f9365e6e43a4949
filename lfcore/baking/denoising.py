"""Denoising: irradiance is averaged over neighbouring points, where they differ by noise alone."""

import numpy as np

from lfcore.baking.irradiance_cache import IrradianceCache
from lfcore.baking.mesh_colours import grid_point, lattice

_STEPS = 4
"""Steps of averaging: noise spreads over about 4 points in each direction."""
_CUTOFF = 7.5
"""Neighbours are averaged if the square of their difference is below this multiple of their
variance: noise alone exceeds it once in 160 cases."""
_LIKE_NORMALS = 0.95
"""The least cosine between the normals of neighbours, 18 degrees."""


def denoised(cache: IrradianceCache) -> np.ndarray:
    """Return the irradiance over pi (P, 3) at all points, averaged at seen ones."""
    light, error = cache.estimate()
    # The difference of the halves is averaged in the same way: the rest of it is the error.
    irradiance = cache.mean()
    values = np.column_stack([irradiance[: len(light)].astype(np.float64), error])
    a, b = _neighbours(cache)
    degree = np.bincount(a, minlength=len(light)) + np.bincount(b, minlength=len(light))
    most = 1 + np.maximum(degree[a], degree[b])
    variance = cache.variance(error)
    for _ in range(_STEPS):
        level = values[:, :3].mean(1)
        squares = (level[a] - level[b]) ** 2
        limit = _CUTOFF * (variance[a] + variance[b]) + 1e-30
        # The exchange is symmetric: the sum of all light is kept.
        share = np.maximum(1 - squares / limit, 0) / most
        keep = 1 - np.bincount(a, share, len(light)) - np.bincount(b, share, len(light))
        mixed = keep[:, None] * values
        for column in range(4):
            mixed[:, column] += np.bincount(a, share * values[b, column], len(light))
            mixed[:, column] += np.bincount(b, share * values[a, column], len(light))
        values, variance = mixed, cache.variance(mixed[:, 3])
    irradiance[: len(light)] = values[:, :3]
    return irradiance


def _neighbours(cache: IrradianceCache) -> tuple[np.ndarray, np.ndarray]:
    """Return all pairs of neighbouring seen points with like normals, each once."""
    grids, pairs = cache.grids, []
    faces = np.flatnonzero(cache.seen)
    for side in np.unique(grids.sides[faces // 2]).tolist():
        of_side = faces[grids.sides[faces // 2] == side]
        places = lattice(side)
        index = grids.index[grids.first[of_side][:, None] + np.arange(len(places))]
        for step in ((1, 0), (0, 1), (-1, 1)):
            to = places + step
            inside = (to >= 0).all(1) & (to.sum(1) <= side)
            ends = grid_point(to[inside, 0], to[inside, 1], np.int64(side))
            pairs.append(np.stack([index[:, inside], index[:, ends]], -1).reshape(-1, 2))
    pair = np.concatenate(pairs) if pairs else np.zeros((0, 2), np.int64)
    pair.sort(axis=1)
    pair = np.unique(pair[:, 0] * len(cache.counts) + pair[:, 1])
    a, b = np.divmod(pair, len(cache.counts))
    normals = grids.points.normals
    alike = ((normals[a] * normals[b]).sum(1) > _LIKE_NORMALS) & (a != b)
    return a[alike], b[alike]
