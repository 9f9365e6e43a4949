"""Verification: the error of baked light, measured at places that the camera sees.

Two independent estimates are gathered at each place.  The product of the baked light's differences
to both is, in the mean, its squared error: their noise cancels.  So errors of interpolation, at
contacts above all, count as those of noise; and so do the hard shadows of suns, which are discs.
"""

import math

import numpy as np

from lfcore.baking.irradiance_cache import IrradianceCache
from lfcore.baking.mesh_colours import Points, grid_point, longest_edge
from lfcore.baking.sampling import samples
from lfcore.baking.surroundings import Surroundings, mean_colour
from lfcore.scene.arrays import dot
from lfcore.scene.baked import DARK, BakedLight
from lfcore.scene.sky import solid_angles, texel_directions

_PLACES = 1600
"""Places in the picture, of a sequence: a lattice can hit nothing but edges."""
_RAYS = 256
"""Rays per estimate: their noise is then a few percent, and cancels over all places."""
_FIRST_SEED = 1 << 40
"""Makes samples independent of those of the bake."""


def measured_error(cache: IrradianceCache, light: BakedLight) -> float:
    """Return the root mean square error in the picture, a share of the light."""
    around, camera = cache.around, cache.grids.scene.camera
    x, y = (camera.field_width * (a[0] - 0.5) for a in samples(np.zeros(1, np.uint64), 0, _PLACES))
    towards = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3).astype(np.float32)
    faces, weights, distance = around.cast(np.zeros_like(towards), towards)
    # On an emitter, baked light hardly shows; other rays of the bake missed some small faces.
    on = np.flatnonzero(cache.seen[faces] & (faces >= 0) & ~around.emits[faces // 2])
    if not len(on):
        return 0.0
    faces, weights = faces[on], weights[on]
    places = (distance[on, None] * towards[on]).astype(np.float32)
    edge = longest_edge(cache.grids.scene.triangles[faces // 2].astype(np.float64))
    normals = cache.grids.shading_normals(faces, weights)
    cells = edge / cache.grids.sides[faces // 2]
    points = Points(places, normals, around.flat_of(faces), cells)
    near, baked = (
        cache.grids.nearest(faces, weights),
        mean_colour(_looked_up(light, faces, weights)),
    )
    hard = mean_colour(around.of_lights(points, around.suns))
    lights = mean_colour(around.of_lights(points))
    estimates = []
    for number in range(2):
        seeds = _FIRST_SEED + number * len(on) + np.arange(len(on))
        sums = cache.gather(points, near, seeds, 0, _RAYS)[0].sum(0)
        estimates.append(mean_colour(sums) / _RAYS + _of_discs(around, points, seeds) - hard)
    level = np.maximum((estimates[0] + estimates[1]) / 2, baked) + lights
    level = np.maximum(level, max(DARK * _mean(level), 1e-30))
    squared = (baked - estimates[0]) * (baked - estimates[1]) / level**2
    return math.sqrt(max(_mean(squared), 0.0))


def _of_discs(around: Surroundings, points: Points, seeds: np.ndarray) -> np.ndarray:
    """Return the mean irradiance over pi (P,) of the suns' discs: that of one texel per point,
    chosen by its light."""
    if not around.suns:
        return np.zeros(len(points))
    disc = mean_colour(around.scene.sky - around.sky).ravel()
    texels = np.flatnonzero(disc > 0)
    side = len(around.scene.sky)
    light = disc[texels] * solid_angles(side).ravel()[texels] / math.pi
    ends = np.cumsum(light, dtype=np.float64)
    choice = np.searchsorted(ends, samples(seeds, 0, 1)[0][:, 0] * ends[-1])
    chosen = texels[np.minimum(choice, len(texels) - 1)]
    towards = texel_directions(side).reshape(-1, 3)[chosen].astype(np.float32)
    hit = around.cast(around.starts(points, slice(None), towards), towards)[0]
    return np.where(hit < 0, ends[-1] * np.maximum(dot(points.normals, towards), 0), 0)


def _looked_up(light: BakedLight, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the baked light (R, 3) at barycentric ``weights`` (R, 3) of faces (R,), linear between
    points, as kernels look it up."""
    first, side = light.grids[faces // 2, faces % 2], light.grids[faces // 2, 2].astype(np.int64)
    x, y = (weights[:, k] * side for k in (1, 2))
    i = np.clip(x.astype(np.int64), 0, side - 1)
    j = np.clip(y.astype(np.int64), 0, side - 1 - i)
    f, g = x - i, y - j
    far = (f + g > 1) & (i + j < side - 1)
    corners = [
        (i + far, j + far, np.where(far, f + g - 1, 1 - f - g)),
        (i + 1, j, np.where(far, 1 - g, f)),
        (i, j + 1, np.where(far, 1 - f, g)),
    ]
    return sum(
        share[:, None] * light.values[first + grid_point(a, b, side)] for a, b, share in corners
    )


def _mean(values: np.ndarray) -> float:
    """Return the mean of values (R,), added in order: libraries add in other orders on other
    processors."""
    return float(np.cumsum(values, dtype=np.float64)[-1]) / len(values)
