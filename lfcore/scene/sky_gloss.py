"""What surfaces of metal and roughness reflect of a sky, by the split sum.

The light of a lobe is the product of two factors: the mean of the sky over the lobe of a surface
seen from straight above, and the share that a surface reflects of an even sky, A f0 + B.  What this
neglects: lobes are round, where seen flatly they are long; and the sky is there though something
may stand before it.  For the latter, a reflection is dimmed as the light that was baked is against
that of the open sky.

Source: B. Karis, "Real Shading in Unreal Engine 4", SIGGRAPH 2013 course; D. Lazarov, "Getting More
Physical in Call of Duty: Black Ops II", SIGGRAPH 2013 course, for the dimming.
"""

import weakref
from collections.abc import Callable

import numpy as np

from lfcore.scene.sky import octahedron, radiance, solid_angles, suns, texel_directions

LEVELS, SIDE, SHARES = 6, 128, 32
"""Maps of roughness 0, 1/5, ... 1, then one of light over pi; their side; the side of A and B."""
_SIDES, _SOURCE = (128, 64, 32, 32, 16, 16), 64
"""The sides of maps before they are enlarged, and of the sky that most are made from."""
_SAMPLES = 256
Source = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Directions (S, 3), light (S, 3) and solid angles (S,) of texels."""
_made: dict[int, tuple[weakref.ref[np.ndarray], np.ndarray]] = {}


def sky_gloss(sky: np.ndarray) -> np.ndarray:
    """(LEVELS + 1) SIDE^2 and SHARES^2 rows (G, 3) float32: maps, then A and B.

    Maps are octahedral, their outermost texels on the border; A and B are over rows of roughness
    and columns of the cosine to the viewer, both from 0 to 1.  Suns are lights, and not in them.
    They are kept as long as the sky is.
    """
    key = id(sky)
    if key not in _made or _made[key][0]() is not sky:
        rest = suns(sky)[0]
        maps = [_enlarged(_mean_over_lobes(rest, k / (LEVELS - 1), side), SIDE)
                for k, side in enumerate(_SIDES)]  # fmt: skip
        maps.append(_enlarged(_light(rest), SIDE))
        rows = [part.reshape(-1, 3) for part in (*maps, reflected_shares())]
        gloss = np.concatenate(rows).astype(np.float32)
        _made[key] = weakref.ref(sky, lambda _: _made.pop(key, None)), gloss
    return _made[key][1]


def _rounded(values: np.ndarray) -> np.ndarray:
    """To 12 bits: libraries round otherwise on other processors."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.rint(mantissa * 4096) / 4096, exponent)


def _corners(side: int) -> np.ndarray:
    """(side, side, 3) directions of a map's texels, the outermost on its border."""
    axis = np.linspace(-1, 1, side)
    return octahedron(np.stack(np.meshgrid(axis, axis), -1))


def _source(sky: np.ndarray, side: int) -> Source:
    """The texels of a map as fine as needed, of ``side`` texels a side at most."""
    side = min(side, max(len(sky), 32))
    towards = texel_directions(side).reshape(-1, 3)
    return towards, _reduced(sky, side, towards), solid_angles(side).ravel()


def _reduced(sky: np.ndarray, side: int, towards: np.ndarray) -> np.ndarray:
    import cv2  # loaded for skies alone

    if len(sky) > side:
        sky = cv2.resize(sky, (side, side), interpolation=cv2.INTER_AREA)
    return radiance(sky, towards).astype(np.float64)


def _mean_over_lobes(sky: np.ndarray, roughness: float, side: int) -> np.ndarray:
    """(side, side, 3): of each direction, the sky weighted by D(h) N . L, for V = N."""
    towards = _corners(side).reshape(-1, 3)
    if not roughness:
        return _rounded(_reduced(sky, side, towards)).reshape(side, side, 3)
    source, square = _source(sky, 2 * _SOURCE if roughness < 0.3 else _SOURCE), roughness**4

    def weights(cosine: np.ndarray) -> np.ndarray:
        halfway = (1 + cosine) / 2  # (N . H)^2
        return np.maximum(cosine, 0) / (halfway * (square - 1) + 1) ** 2

    return _rounded(_weighted(towards, source, weights)).reshape(side, side, 3)


def _light(sky: np.ndarray) -> np.ndarray:
    """(16, 16, 3): light over pi on a surface of each direction."""
    towards = _corners(16).reshape(-1, 3)
    found = _weighted(towards, _source(sky, _SOURCE), lambda cosine: np.maximum(cosine, 0))
    return _rounded(found).reshape(16, 16, 3)


def _weighted(
    towards: np.ndarray, source: Source, weights: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    made, (texels, light, angles) = [], source
    for some in np.array_split(towards, max(1, len(towards) * len(texels) >> 22)):
        share = weights(some @ texels.T) * angles
        made.append(share @ light / share.sum(1, keepdims=True))
    return np.concatenate(made)


def _enlarged(small: np.ndarray, side: int) -> np.ndarray:
    """A map with the outermost texels on its border, linearly."""
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
    seen = np.maximum(np.sqrt(1 - cosine**2) * along + cosine * up, 0)  # V . H
    light = np.maximum(2 * seen * up - cosine, 0)  # N . L

    def masked(c: np.ndarray) -> np.ndarray:
        return c + np.sqrt(square + (1 - square) * c * c)

    share = 4 * light * seen / (masked(light) * masked(cosine) * up)
    grazing = (1 - seen) ** 5
    a, b = (share * (1 - grazing)).mean(-1), (share * grazing).mean(-1)
    return _rounded(np.stack([a, b, np.zeros_like(a)], -1))
