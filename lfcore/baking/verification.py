"""Verification: the error of baked light, measured at places that the camera sees.

Two independent estimates are gathered at each place.  The product of the baked light's differences
to both is, in the mean, its squared error: their noise cancels.  It counts the bake's noise and its
errors of interpolation, which are largest where surfaces touch.

The hard shadows of suns, which are discs, are errors, too.  Half-shadows are narrow, so they are
measured at many more places, each with two rays to the discs.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

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
_SUN_PLACES = 1 << 15
"""Places where half-shadows are measured.  With 1600, none lay in the half-shadow of a disc of half
a degree, and an error of 2 % was missed."""
_RAYS = 256
"""Rays per estimate: their noise is then a few percent, and cancels over all places."""
_FIRST_SEED = 1 << 40
"""Makes samples independent of those of the bake."""


class _Seen(NamedTuple):
    """Places in the picture: points, and the light that is shown there (P,)."""

    points: Points
    nearest: np.ndarray
    baked: np.ndarray
    lights: np.ndarray

    @classmethod
    def of(cls, cache: IrradianceCache, light: BakedLight, count: int) -> "_Seen":
        """What rays through ``count`` places in the picture hit."""
        around, grids, camera = cache.around, cache.grids, cache.grids.scene.camera
        x, y = (
            camera.field_width * (a[0] - 0.5) for a in samples(np.zeros(1, np.uint64), 0, count)
        )
        towards = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3).astype(np.float32)
        faces, weights, distance = around.cast(np.zeros_like(towards), towards)
        # On an emitter, baked light hardly shows; other rays of the bake missed some small faces.
        on = np.flatnonzero(cache.seen[faces] & (faces >= 0) & ~around.emits[faces // 2])
        faces, weights = faces[on], weights[on]
        places = (distance[on, None] * towards[on]).astype(np.float32)
        edge = longest_edge(grids.scene.triangles[faces // 2].astype(np.float64))
        normals = grids.shading_normals(faces, weights)
        points = Points(places, normals, around.flat_of(faces), edge / grids.sides[faces // 2])
        baked = mean_colour(_looked_up(light, faces, weights))
        lights = mean_colour(around.of_lights(points))
        return cls(points, grids.nearest(faces, weights), baked, lights)

    def seeds(self) -> Iterator[np.ndarray]:
        """The seeds (P,) of two independent estimates."""
        for number in range(2):
            yield _FIRST_SEED + number * len(self.points) + np.arange(len(self.points))

    def squared(self, estimates: list[np.ndarray], shown: np.ndarray) -> float:
        """The mean squared error of light ``shown`` (P,) by two estimates of it, as a share of all
        light."""
        of_shown = np.maximum((estimates[0] + estimates[1]) / 2, shown) - shown
        level = self.baked + self.lights + of_shown
        level = np.maximum(level, max(DARK * _mean(level), 1e-30))
        return _mean((shown - estimates[0]) * (shown - estimates[1]) / level**2)


def measured_error(cache: IrradianceCache, light: BakedLight) -> float:
    """Return the root mean square error in the picture, a share of the light."""
    around, seen = cache.around, _Seen.of(cache, light, _PLACES)
    if not len(seen.points):
        return 0.0
    sums = (
        cache.gather(seen.points, seen.nearest, each, 0, _RAYS)[0].sum(0) for each in seen.seeds()
    )
    squared = seen.squared([mean_colour(each) / _RAYS for each in sums], seen.baked)
    if around.suns:
        seen = _Seen.of(cache, light, _SUN_PLACES)
        hard = mean_colour(around.of_lights(seen.points, around.suns))
        squared += seen.squared(
            [_of_discs(around, seen.points, each) for each in seen.seeds()], hard
        )
    return math.sqrt(max(squared, 0.0))


def _of_discs(around: Surroundings, points: Points, seeds: np.ndarray) -> np.ndarray:
    """Return the mean irradiance over pi (P,) of the suns' discs: that of one texel per point,
    chosen by its light."""
    disc = mean_colour(around.scene.sky - around.sky).ravel()
    texels = np.flatnonzero(disc > 0)
    side = len(around.scene.sky)
    light = disc[texels] * solid_angles(side).ravel()[texels] / math.pi
    ends = np.cumsum(light, dtype=np.float64)
    choice = np.searchsorted(ends, samples(seeds, 0, 1)[0][:, 0] * ends[-1])
    chosen = texels[np.minimum(choice, len(texels) - 1)]
    towards = texel_directions(side).reshape(-1, 3)[chosen].astype(np.float32)
    hit = around.cast(around.starts(points, slice(None), towards), towards).faces
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
