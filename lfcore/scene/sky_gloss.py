"""Reflection of a sky by metallic-roughness surfaces, by the split sum.

Reflected radiance is the product of two factors: the sky's mean over the lobe of a surface viewed
along its normal, and the share of a uniform sky that a surface reflects, A f0 + B.  Two effects are
neglected: lobes get longer at grazing angles, and objects occlude the sky.  For the second, a
reflection is multiplied by the ratio of baked irradiance to that of the open sky.

Source: B. Karis, "Real Shading in Unreal Engine 4", SIGGRAPH 2013 course; D. Lazarov, "Getting More
Physical in Call of Duty: Black Ops II", SIGGRAPH 2013 course, for the dimming.
"""

import weakref
from collections.abc import Callable

import numpy as np

from lfcore.scene.sky import octahedron, radiance, rounded, solid_angles, suns, texel_directions

LEVELS = 6
"""The number of maps, of roughness 0, 1/5, ... 1; one of irradiance over pi follows."""
SIDE = 128
"""The side of the maps, texels."""
SHARES = 32
"""The side of the tables A and B."""
_SIDES = (128, 64, 32, 32, 16, 16)
"""The sides of the maps before they are enlarged: rough lobes are smooth."""
_SOURCE = 64
"""The side of the sky that rough lobes are computed from; smooth lobes use twice the side."""
_SAMPLES = 256
"""The samples per entry of A and B."""
Source = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Directions (S, 3), light (S, 3) and solid angles (S,) of texels."""
_cache: dict[int, tuple[weakref.ref[np.ndarray], np.ndarray]] = {}


def sky_gloss(sky: np.ndarray) -> np.ndarray:
    """(LEVELS + 1) SIDE^2 and SHARES^2 rows (G, 3) float32: maps, then A and B.

    Maps are octahedral, their outermost texels on the border; A and B are over rows of roughness
    and columns of the cosine to the viewer, both from 0 to 1.  Suns are lights, and not in them.
    They are kept as long as the sky is.
    """
    key = id(sky)
    if key not in _cache or _cache[key][0]() is not sky:
        rest = suns(sky)[0]
        maps = [_enlarged(_mean_over_lobes(rest, k / (LEVELS - 1), side), SIDE)
                for k, side in enumerate(_SIDES)]  # fmt: skip
        maps.append(_enlarged(_light(rest), SIDE))
        rows = [part.reshape(-1, 3) for part in (*maps, reflected_shares())]
        _keep(sky, np.concatenate(rows).astype(np.float32))
    return _cache[key][1]


def _keep(sky: np.ndarray, gloss: np.ndarray) -> None:
    key = id(sky)
    _cache[key] = weakref.ref(sky, lambda _: _cache.pop(key, None)), gloss


def brighter_sky(sky: np.ndarray, stops: int) -> np.ndarray:
    """A sky times two to the power of ``stops``, and its maps, without their computation."""
    by, gloss = np.float32(2.0**stops), sky_gloss(sky).copy()
    gloss[: -(SHARES**2)] *= by
    brighter = sky * by
    _keep(brighter, gloss)
    return brighter


def _corners(side: int) -> np.ndarray:
    """(side, side, 3) directions of a map's texels, the outermost on its border."""
    axis = np.linspace(-1, 1, side)
    return octahedron(np.stack(np.meshgrid(axis, axis), -1))


def _source(sky: np.ndarray, side: int) -> Source:
    """The texels of a map of at most ``side`` texels per side."""
    side = min(side, max(len(sky), 32))
    towards = texel_directions(side).reshape(-1, 3)
    return towards, _reduced(sky, side, towards), solid_angles(side).ravel()


def _reduced(sky: np.ndarray, side: int, towards: np.ndarray) -> np.ndarray:
    import cv2  # loaded for skies alone

    if len(sky) > side:
        sky = cv2.resize(sky, (side, side), interpolation=cv2.INTER_AREA)
    return radiance(sky, towards).astype(np.float64)


def _mean_over_lobes(sky: np.ndarray, roughness: float, side: int) -> np.ndarray:
    """(side, side, 3): the sky's mean weighted by D(h) N . L with V = N, per direction N."""
    towards = _corners(side).reshape(-1, 3)
    if not roughness:
        return rounded(_reduced(sky, side, towards)).reshape(side, side, 3)
    source, square = _source(sky, 2 * _SOURCE if roughness < 0.3 else _SOURCE), roughness**4

    def weights(cosine: np.ndarray) -> np.ndarray:
        halfway = (1 + cosine) / 2  # (N . H)^2
        return np.maximum(cosine, 0) / (halfway * (square - 1) + 1) ** 2

    return rounded(_weighted(towards, source, weights)).reshape(side, side, 3)


def _light(sky: np.ndarray) -> np.ndarray:
    """(16, 16, 3): irradiance over pi, per normal."""
    towards = _corners(16).reshape(-1, 3)
    irradiance = _weighted(towards, _source(sky, _SOURCE), lambda cosine: np.maximum(cosine, 0))
    return rounded(irradiance).reshape(16, 16, 3)


def _weighted(
    towards: np.ndarray, source: Source, weights: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    means, (texels, light, angles) = [], source
    for some in np.array_split(towards, max(1, len(towards) * len(texels) >> 22)):
        share = weights(some @ texels.T) * angles
        means.append(share @ light / share.sum(1, keepdims=True))
    return np.concatenate(means)


def _enlarged(small: np.ndarray, side: int) -> np.ndarray:
    """Enlarge a map with its outermost texels on the border, linearly."""
    at = np.linspace(0, len(small) - 1, side)
    low = np.minimum(at.astype(np.int64), len(small) - 2)
    share = (at - low)[:, None, None]
    rows = small[low] + share * (small[low + 1] - small[low])
    share = share.reshape(1, -1, 1)
    return rows[:, low] + share * (rows[:, low + 1] - rows[:, low])


def reflected_shares() -> np.ndarray:
    """(SHARES, SHARES, 3): A, B and 0; rows of roughness, columns of N . V."""
    number = np.arange(_SAMPLES)
    first = (number + 0.5) / _SAMPLES
    turn = 2 * np.pi * (number * 0.61803398874989485 % 1)
    rough, cosine = np.meshgrid(*[np.linspace(0, 1, SHARES)] * 2, indexing="ij")
    rough, cosine = np.maximum(rough, 0.05)[..., None], np.maximum(cosine, 1e-3)[..., None]
    square = rough**4
    up = np.sqrt((1 - first) / (1 + (square - 1) * first))  # N . H
    along = np.sqrt(1 - up**2) * np.cos(turn)
    view_cosine = np.maximum(np.sqrt(1 - cosine**2) * along + cosine * up, 0)  # V . H
    light = np.maximum(2 * view_cosine * up - cosine, 0)  # N . L

    def masked(c: np.ndarray) -> np.ndarray:
        return c + np.sqrt(square + (1 - square) * c * c)

    share = 4 * light * view_cosine / (masked(light) * masked(cosine) * up)
    grazing = (1 - view_cosine) ** 5
    a, b = (share * (1 - grazing)).mean(-1), (share * grazing).mean(-1)
    return rounded(np.stack([a, b, np.zeros_like(a)], -1))
