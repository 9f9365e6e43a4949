"""First hits of rays: the reference for every tracer.

Brute force over all pairs, decided exactly (see ``crossings``): right at edges, at vertices and at
grazing incidence, and slow: 10^4 rays by 10^4 triangles take seconds.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lfcore.oracle.crossings import ULP, Crossings, crossings

Solid = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""(C,) bool of triangles (C,) and weights (C, 3): whether the triangle stops a ray there."""
# The relative distance below which crossings are equal: t is known to 1e-10.
SAME = 4e-10
TINY = 1e-300
"""Keeps a division by 0 finite."""


@dataclass(frozen=True)
class Hits:
    """The first hits of R rays, (R,) each."""

    triangle: np.ndarray
    """-1 for a miss; at equal distance the lowest number."""
    t: np.ndarray
    """The hit is origin + t * direction; inf for a miss."""
    weights: np.ndarray
    """(R, 3) barycentric weights of the corners p, q, r; NaN for a miss."""
    margin: np.ndarray
    """The angle seen from the origin between the ray and the nearest edge of any triangle not
    behind the hit, in units of 2^-24, at most ``near``: if it is small, float32 may differ."""
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
    after: np.ndarray | float = 0.0,
    exclude: np.ndarray | None = None,
    solid: Solid | None = None,
) -> Hits:
    """First crossings at t > ``after`` of rays (R, 3) and triangles (T, 3, 3), from both sides.

    ``near`` is the largest ``margin`` reported, in units of 2^-24.  Each ray ignores the triangles
    ``exclude`` (R,) or (R, K), -1 for none.  ``solid`` tests for holes.
    """
    rays = len(origins)
    best, far, weights = np.full(rays, np.inf), np.full(rays, np.inf), np.full((rays, 3), np.nan)
    margin = np.full(rays, float(near))
    hits = Hits(np.full(rays, -1), best, weights, margin, far, far.copy(), float(near))
    after = np.broadcast_to(after, rays)
    ignored = np.full((rays, 1), -1) if exclude is None else np.reshape(exclude, (rays, -1))
    for pairs in crossings(triangles, origins, directions, near=near):
        allowed = (pairs.triangle[:, None] != ignored[pairs.ray]).all(1)
        hit = np.flatnonzero(pairs.inside & (pairs.t > after[pairs.ray]) & allowed)
        if solid is not None:
            hit = hit[solid(pairs.triangle[hit], pairs.weights[hit])]
        np.minimum.at(best, pairs.ray[hit], pairs.t[hit])
        first = hit[pairs.t[hit] <= (best + SAME * np.abs(best))[pairs.ray[hit]]]
        _take_lowest(hits, pairs, first)
        _gaps(hits, pairs, hit)
        # NaN, a ray in the plane of the triangle, counts as not behind.
        close = allowed & (np.abs(pairs.margin) < near) & ~(pairs.nearest > best[pairs.ray])
        close &= ~(pairs.t <= 0)
        np.minimum.at(hits.margin, pairs.ray[close], np.abs(pairs.margin[close]))
    return hits


def _take_lowest(hits: Hits, pairs: Crossings, first: np.ndarray) -> None:
    order = first[np.lexsort((pairs.triangle[first], pairs.ray[first]))]
    ray, at = np.unique(pairs.ray[order], return_index=True)
    chosen = order[at]
    hits.triangle[ray] = pairs.triangle[chosen]
    hits.t[ray] = pairs.t[chosen]
    hits.weights[ray] = pairs.weights[chosen]
    hits.grazing[ray] = pairs.grazing[chosen]


def _gaps(hits: Hits, pairs: Crossings, hit: np.ndarray) -> None:
    behind = hit[pairs.triangle[hit] != hits.triangle[pairs.ray[hit]]]
    ray = pairs.ray[behind]
    gap = np.abs(pairs.t[behind] - hits.t[ray]) / np.maximum(np.abs(hits.t[ray]), TINY) / ULP
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
    """(R,) bool: whether a triangle other than ``exclude`` is at ``after`` < t < ``until``.

    ``solid`` as for :func:`closest_hits`.
    """
    result = np.zeros(len(origins), bool)
    after, until = (np.broadcast_to(t, len(origins)) for t in (after, until))
    for pairs in crossings(triangles, origins, directions, near=0.0):
        blocks = pairs.inside & (pairs.t > after[pairs.ray]) & (pairs.t < until[pairs.ray])
        if exclude is not None:
            blocks &= pairs.triangle != np.asarray(exclude)[pairs.ray]
        if solid is not None:
            blocks[blocks] = solid(pairs.triangle[blocks], pairs.weights[blocks])
        result[pairs.ray[blocks]] = True
    return result
