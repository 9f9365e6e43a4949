"""The first triangle that a ray meets: the reference that every tracer is held to.

Brute force over all pairs, decided exactly (see ``crossings``), so that it is right at edges,
at vertices and at grazing incidence, and slow: 10^4 rays by 10^4 triangles take seconds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lfcore.oracle.crossings import ULP, Crossings, crossings

Solid = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(C,) bool of triangles (C,) and weights (C, 3): whether what crosses there is stopped."""
# Crossings nearer to each other than this, relatively, are one: t is known to 1e-10.
SAME = 4e-10


@dataclass(frozen=True)
class Hits:
    """What R rays meet first, (R,) each."""

    triangle: np.ndarray
    """-1 for a miss; of several at one distance the lowest."""
    t: np.ndarray
    """The hit is origin + t * direction; inf for a miss."""
    weights: np.ndarray
    """(R, 3) barycentric weights of the corners p, q, r; NaN for a miss."""
    margin: np.ndarray
    """The angle seen from the origin between the ray and the nearest edge of any triangle not
    behind the hit, in units of 2^-24, at most ``near``: float32 may differ where it is small."""
    gap: np.ndarray
    """The distance to the next crossing behind, relative to t and in units of 2^-24."""
    grazing: np.ndarray
    """The condition number of t, 1 / |sine| of the angle of incidence."""
    near: float

    def clear(self, ulp: float = 16.0) -> np.ndarray:
        """(R,) bool: rays farther than ``ulp`` from every edge and from an equal depth."""
        if not ulp < self.near:
            raise ValueError(f"margins were measured up to {self.near} only, not {ulp}")
        grazing = np.where(self.triangle < 0, 1.0, self.grazing)
        return (self.margin > ulp) & (self.gap > ulp * grazing)


def closest_hits(
    triangles: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    *,
    near: float = 64.0,
    exclude: np.ndarray | None = None,
    solid: Solid | None = None,
) -> Hits:
    """First crossings at t > 0 of rays (R, 3) and triangles (T, 3, 3), from both sides.

    ``near`` is the largest ``margin`` reported, in units of 2^-24.  Each ray ignores the triangle
    ``exclude`` (R,), -1 for none.  ``solid`` says where triangles have no holes.
    """
    rays = len(origins)
    best, far, some = np.full(rays, np.inf), np.full(rays, np.inf), np.full((rays, 3), np.nan)
    margin = np.full(rays, float(near))
    hits = Hits(np.full(rays, -1), best, some, margin, far, far.copy(), float(near))
    for found in crossings(triangles, origins, directions, near=near):
        seen = np.ones(len(found.ray), bool)
        if exclude is not None:
            seen = found.triangle != np.asarray(exclude)[found.ray]
        hit = np.flatnonzero(found.inside & (found.t > 0) & seen)
        if solid is not None:
            hit = hit[solid(found.triangle[hit], found.weights[hit])]
        np.minimum.at(best, found.ray[hit], found.t[hit])
        first = hit[found.t[hit] <= best[found.ray[hit]] * (1 + SAME)]
        _take_lowest(hits, found, first)
        _gaps(hits, found, hit)
        # NaN, the ray in the plane of the triangle, counts as not behind.
        close = seen & (np.abs(found.margin) < near) & ~(found.nearest > best[found.ray])
        close &= ~(found.t <= 0)
        np.minimum.at(hits.margin, found.ray[close], np.abs(found.margin[close]))
    return hits


def _take_lowest(hits: Hits, found: Crossings, first: np.ndarray) -> None:
    order = first[np.lexsort((found.triangle[first], found.ray[first]))]
    ray, at = np.unique(found.ray[order], return_index=True)
    chosen = order[at]
    hits.triangle[ray] = found.triangle[chosen]
    hits.t[ray] = found.t[chosen]
    hits.weights[ray] = found.weights[chosen]
    hits.grazing[ray] = found.grazing[chosen]


def _gaps(hits: Hits, found: Crossings, hit: np.ndarray) -> None:
    other = hit[found.triangle[hit] != hits.triangle[found.ray[hit]]]
    ray = found.ray[other]
    gap = np.abs(found.t[other] - hits.t[ray]) / hits.t[ray] / ULP
    np.minimum.at(hits.gap, ray, gap)


def occluded(
    triangles: np.ndarray,
    origins: np.ndarray,
    directions: np.ndarray,
    *,
    after: np.ndarray | float = 0.0,
    until: np.ndarray | float = np.inf,
    exclude: np.ndarray | None = None,
    solid: Solid | None = None,
) -> np.ndarray:
    """(R,) bool: whether anything but triangle ``exclude`` lies at ``after`` < t < ``until``.

    ``solid`` as for :func:`closest_hits`.
    """
    result = np.zeros(len(origins), bool)
    after, until = (np.broadcast_to(t, len(origins)) for t in (after, until))
    for found in crossings(triangles, origins, directions, near=0.0):
        blocks = found.inside & (found.t > after[found.ray]) & (found.t < until[found.ray])
        if exclude is not None:
            blocks &= found.triangle != np.asarray(exclude)[found.ray]
        if solid is not None:
            blocks[blocks] = solid(found.triangle[blocks], found.weights[blocks])
        result[found.ray[blocks]] = True
    return result
