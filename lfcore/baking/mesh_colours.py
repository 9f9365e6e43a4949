"""Mesh colours: points on triangles where irradiance is kept, shared between neighbours.

A *face* is one side of a triangle: face 2 t is its front (corners counter-clockwise), 2 t + 1 its
back.  A face's grid has the layout of :class:`lfcore.scene.baked.BakedLight`.  Faces much smaller
than a cell of the picture share points with others nearby, so that the picture bounds the points.

Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from lfcore.scene.arrays import columnwise, dot
from lfcore.scene.model import Scene

_SAME_PLACE = 2.0**-22
"""The distance below which two points are one, a share of the scene's size: rounding of float32."""
_SAME_NORMAL = 2.0**-8
"""The difference of unit normals, per component, below which two points are one."""
LIKE_NORMAL = 1 / 2
"""The same for points that small faces share."""
_ROUNDING_OFFSET = 0.37
"""Added before keys are rounded: round numbers, which models prefer, are then no boundaries."""
_INSET = 0.02
"""How far points are moved into their triangle, a share of a cell: corners touch other walls."""
_NORMAL_WEIGHT = 0.1
"""The distance, a share of the scene's size, that counts as much as unit normals 1 apart."""
_NEXT_TO = 1 / 64
"""The largest distance of a point that is next to a face, a share of the scene's size."""
_SUBSTITUTE_CUBES = 256
"""Cubes along the scene; faces in one cube with about the same normal share a substitute."""
GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""The increment of splitmix64: 2^64 over the golden ratio."""


@cache
def lattice(side: int) -> np.ndarray:
    """((side + 1) (side + 2) / 2, 2) columns and rows of a grid's points, in their order."""
    rows = [
        np.stack([np.arange(side + 1 - j), np.full(side + 1 - j, j)], 1) for j in range(side + 1)
    ]
    return np.concatenate(rows)


def lattice_weights(side: int) -> np.ndarray:
    """(n, 3) barycentric weights of a grid's points."""
    places = lattice(side)
    return np.column_stack([side - places.sum(1), places]) / side


def grid_point(i: np.ndarray, j: np.ndarray, side: np.ndarray | np.int64) -> np.ndarray:
    """The index on its grid of the point in column i and row j."""
    return j * (2 * side + 3 - j) // 2 + i


@dataclass(frozen=True)
class Points:
    """Points that gather light.

    Attributes
    ----------
    places : (P, 3) float32, metres.
    normals : (P, 3) float32 unit shading normals, on the side of the face.
    flat : (P, 3) float32 unit normals of the triangles, on the side of the face.
    cells : (P,) the longest edge of a cell, metres.
    """

    places: np.ndarray
    normals: np.ndarray
    flat: np.ndarray
    cells: np.ndarray

    def __len__(self) -> int:
        return len(self.places)

    def take(self, which: np.ndarray | slice) -> Points:
        return Points(*(array[which] for array in vars(self).values()))

    @classmethod
    def joined(cls, parts: list[Points]) -> Points:
        return cls(*map(np.concatenate, zip(*(vars(p).values() for p in parts), strict=True)))


def corner_normals(
    scene: Scene, lens: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return shading normals (F, 3, 3) at the corners of faces (F,), and the triangles' own normals
    (F, 3) on that side; unit float64.

    A shading normal is on the side of its face.  If a face is turned to a point of the ``lens``
    (n, 2), but its normals are turned away from all of them, the kernels flip the normals; so does
    this function.
    """
    triangles, back = scene.triangles[faces // 2], faces % 2 == 1
    side = np.where(back, -1.0, 1.0)
    p, q, r = triangles.astype(np.float64).swapaxes(0, 1)
    flat = _unit(np.cross(q - p, r - p))
    own = flat * side[:, None]
    normals = np.repeat(own[:, None], 3, axis=1)
    if len(scene.normals):
        normals = scene.normals[faces // 2] * side[:, None, None]
        is_reversed = columnwise(np.maximum, dot(normals, own[:, None])) < 0
        normals[is_reversed] *= -1
    sees_lens, turned_away = np.zeros(len(faces), bool), np.ones(len(faces), bool)
    for lens_point in lens:
        rays = triangles - np.append(lens_point, 0)
        sees_lens |= (dot(flat, rays[:, 0]) < 0) != back
        turned_away &= columnwise(np.logical_and, dot(normals, rays) > 0)
    normals[sees_lens & turned_away] *= -1
    return normals, own


class Grids:
    """The grids of faces; points at the same place with the same normal are one.

    Parameters
    ----------
    scene : the scene.
    lens : (n, 2) lens points: see :func:`corner_normals`.
    sides : (T,) cells along an edge.
    steps : (T,) the cubes' sides, metres, in which faces share points; 0: none but equal ones.

    Attributes
    ----------
    sides, steps : as given.
    first : (2 T,) where a face's grid begins in ``index``; -1 without a grid.
    index : (G,) the point of each grid point.
    substituted : (G,) whether a grid point uses the point of another place.
    substitute : (2 T,) for a face without a grid: a point that has about its light.
    lacking, group, examples : faces without a grid, the group of each, which have one substitute,
        and a face of each group; after :meth:`find_substitutes`.
    points : the points.
    """

    def __init__(self, scene: Scene, lens: np.ndarray, sides: np.ndarray, steps: np.ndarray):
        self.scene, self.sides, self.steps, self._lens = scene, sides, steps, lens
        self.first = np.full(2 * len(sides), -1, np.int64)
        self.substitute = np.zeros(2 * len(sides), np.int64)
        self.index, self.substituted = np.zeros(0, np.int64), np.zeros(0, bool)
        self._hashes = np.zeros(0, np.uint64)
        empty = np.zeros((0, 3), np.float32)
        self.points = Points(empty, empty, empty, np.zeros(0))
        self._low, self._size = extent(scene.triangles)

    def add(self, faces: np.ndarray) -> slice:
        """Make grids for faces that have none; returns the range of their new points."""
        faces = np.unique(faces[self.first[faces] < 0])
        before, hashes, parts = len(self.points), [self._hashes], [self.points]
        length = len(self.index)
        for side in np.unique(self.sides[faces // 2]).tolist():
            of_side = faces[self.sides[faces // 2] == side]
            points, keys = self.points_at(of_side, lattice(side), side)
            count = len(lattice(side))
            self.first[of_side] = length + count * np.arange(len(of_side))
            length += count * len(of_side)
            hashes.append(keys)
            parts.append(points)
        all_hashes = np.concatenate(hashes)
        unique, first, where = np.unique(all_hashes, return_index=True, return_inverse=True)
        # Old points keep their numbers, new ones follow in order.
        order = np.argsort(first, kind="stable")
        number = np.empty(len(unique), np.int64)
        number[order] = np.arange(len(unique))
        self.points = Points.joined(parts).take(first[order])
        self._hashes = all_hashes[first[order]]
        self.index = np.concatenate([self.index, number[where[before:]]])
        added = len(self.index) - len(self.substituted)
        self.substituted = np.pad(self.substituted, (0, added))
        return slice(before, len(self.points))

    def points_at(
        self, faces: np.ndarray, places: np.ndarray, side: int
    ) -> tuple[Points, np.ndarray]:
        """Return the points (F n) at columns and rows ``places``, (n, 2) or (F, n, 2), of the
        grids of faces (F,), and the hashes of place and normal."""
        rest, number = side - places.sum(-1, keepdims=True), places.shape[-2]
        weights = np.concatenate([rest, places], -1).astype(np.float64)
        step = self.steps[faces // 2]
        corners = self.scene.triangles[faces // 2].astype(np.float64)
        exact = _interpolated(weights, corners) / side
        of_corners, own = corner_normals(self.scene, self._lens, faces)
        flat = np.repeat(own[:, None], number, axis=1)
        normals = _unit(_interpolated(weights, of_corners), flat)
        inset = exact + _INSET / side * (corners.mean(1, keepdims=True) - exact)
        edge = np.maximum(longest_edge(corners) / side, step)
        keys = self.keys(exact, normals, step)
        inset, normals, flat = (
            array.reshape(-1, 3).astype(np.float32) for array in (inset, normals, flat)
        )
        return Points(inset, normals, flat, np.repeat(edge, number)), keys

    def keys(
        self, places: np.ndarray, normals: np.ndarray, step: np.ndarray, finer: int = 1
    ) -> np.ndarray:
        """Return hashes (F n,) of places (F, n, 3) and normals in cubes of sides ``step`` (F,), and
        so many times ``finer``."""
        shared = step[:, None, None] > 0
        place_step = np.where(shared, step[:, None, None] / finer, self._size * _SAME_PLACE)
        normal_step = np.where(shared, LIKE_NORMAL / finer, _SAME_NORMAL)
        level = np.repeat(np.frexp(step)[1], places.shape[1])
        key = np.concatenate(
            [np.rint((places - self._low) / place_step + _ROUNDING_OFFSET),
             np.rint(normals / normal_step + _ROUNDING_OFFSET)], -1
        ).astype(np.int64)  # fmt: skip
        return hashed(np.column_stack([key.reshape(-1, 6), level]))

    def shading_normals(self, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the unit normals (R, 3), float32, at barycentric ``weights`` (R, 3) of faces."""
        of_corners, own = corner_normals(self.scene, self._lens, faces)
        return _unit(_interpolated(weights[:, None], of_corners)[:, 0], own).astype(np.float32)

    def nearest(self, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the points (R,) nearest to hits on faces (R,) with barycentric ``weights`` (R, 3);
        a face without a grid has its substitute."""
        side = self.sides[faces // 2]
        i = np.rint(weights[:, 1] * side).astype(np.int64)
        j = np.rint(weights[:, 2] * side).astype(np.int64)
        over = i + j > side
        i = np.clip(i - (over & (weights[:, 1] >= weights[:, 2])), 0, side)
        j = np.clip(j, 0, side - i)
        first = self.first[faces]
        at = np.maximum(first, 0) + grid_point(i, j, side)
        return np.where(first < 0, self.substitute[faces], self.index[np.where(first < 0, 0, at)])

    def move(self, faces: np.ndarray, weights: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Move the points in the mask ``which`` (P,), of faces of one cell, to barycentric
        ``weights`` (F, 3) of their face; returns the mask of moved points."""
        is_one_cell = self.sides[faces // 2] == 1
        index = self.index[self.first[faces[is_one_cell], None] + np.arange(3)]
        row, corner = np.nonzero(which[index])
        at, target, face = (
            index[row, corner],
            weights[is_one_cell][row, None],
            faces[is_one_cell][row],
        )
        corners = self.scene.triangles[face // 2].astype(np.float64)
        of_corners, own = corner_normals(self.scene, self._lens, face)
        self.points.places[at] = _interpolated(target, corners)[:, 0]
        self.points.normals[at] = _unit(_interpolated(target, of_corners)[:, 0], own)
        self.points.flat[at] = own
        return np.isin(np.arange(len(which)), at)

    def substitute_points(self, which: np.ndarray) -> None:
        """Use, for the points in the mask ``which`` (P,), the nearest other points with like
        normals."""
        if which.any() and not which.all():
            new = np.arange(len(which))
            kept, replaced = np.flatnonzero(~which), self.points.take(which)
            found = self._most_alike(self.points.take(kept), replaced.places, replaced.normals)
            new[which] = kept[found]
            self.substituted = which[self.index]
            self.index = new[self.index]

    def find_substitutes(self, unit: np.ndarray) -> None:
        """Find, for faces without a grid, the nearest points with like normals.

        Those in one cube with about the same of the triangles' normals ``unit`` (T, 3) share one.
        """
        cube = self.scene.triangles.sum(1) / 3 - self._low.astype(np.float32)
        cube = np.rint(cube * np.float32(_SUBSTITUTE_CUBES / self._size)).astype(np.int64)
        normal = np.rint(1.5 * unit).astype(np.int64)
        keys = np.stack([normal, -normal], 1) + 2
        self.lacking, used = np.flatnonzero(self.first < 0), np.unique(self.index)
        keys = _packed(np.repeat(cube, 2, axis=0), 10) << 9 | _packed(keys.reshape(-1, 3), 3)
        _, first, self.group = np.unique(keys[self.lacking], return_index=True, return_inverse=True)
        self.examples = self.lacking[first]
        found = used[self._most_alike(self.points.take(used), *self._centres(self.examples))]
        self.substitute[self.lacking] = found[self.group]

    def prefer_adjacent(
        self, faces: np.ndarray, candidates: np.ndarray, points: np.ndarray
    ) -> np.ndarray:
        """Return ``points`` (F, n) of faces (F,), where faces next to a candidate point use it."""
        places, normals = self._centres(faces)
        found = self._most_alike(self.points.take(candidates), places, normals, _NEXT_TO)
        near = found < len(candidates)
        points[near] = candidates[found[near], None]
        return points

    def _centres(self, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the centres (F, 3) of faces, and the shading normals there."""
        of_corners, _ = corner_normals(self.scene, self._lens, faces)
        attributes = self.scene.triangles[faces // 2], of_corners
        places, normals = ((at[:, 0] + at[:, 1] + at[:, 2]) / 3 for at in attributes)
        return places, normals

    def _most_alike(
        self, points: Points, places: np.ndarray, normals: np.ndarray, within: float = np.inf
    ) -> np.ndarray:
        """Return the index (P,) of the point nearest in place and normal (P, 3); ``len(points)``
        where none is nearer than ``within``, a share of the scene's size."""
        return nearest_points(points, places, normals, (self._size, _NORMAL_WEIGHT), 1, within)[1]


def nearest_points(
    points: Points,
    places: np.ndarray,
    normals: np.ndarray,
    units: tuple[float, float],
    count: int | np.ndarray,
    within: float = np.inf,
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances and indices (P, count), (P,) of one, of the points nearest in place and
    normal (P, 3).

    ``units`` are the length, metres, that counts as 1, and what normals 1 apart count.
    """
    from scipy.spatial import cKDTree  # slow to import

    scale, weight = np.float64(1 / units[0]), units[1]
    tree = cKDTree(np.concatenate([points.places * scale, weight * points.normals], 1))
    sought = np.concatenate([places * scale, weight * normals], 1)
    return tree.query(sought, count, distance_upper_bound=within)


def _packed(numbers: np.ndarray, bits: int) -> np.ndarray:
    """Return three small numbers (P, 3), of so many ``bits`` each, as one (P,)."""
    return (numbers[:, 0] << bits | numbers[:, 1]) << bits | numbers[:, 2]


def extent(triangles: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the low corner (3,) of the box around triangles (T, 3, 3), and its longest side."""
    axes = triangles.reshape(-1, 3).T  # one by one: numpy takes ten times as long for all three
    low, high = (np.array([float(of(axis)) for axis in axes]) for of in (np.min, np.max))
    return low, float((high - low).max())


def longest_edge(corners: np.ndarray) -> np.ndarray:
    """Return the longest edge (T,) of triangles (T, 3, 3)."""
    edges = corners - np.roll(corners, 1, axis=1)
    a, b, c = np.sqrt(dot(edges, edges)).T
    return np.maximum(np.maximum(a, b), c)


def _unit(vectors: np.ndarray, instead: np.ndarray | float = 0.0) -> np.ndarray:
    """Unit vectors (..., 3); ``instead`` where normals that oppose one another add up to zero."""
    length = np.sqrt(dot(vectors, vectors))[..., None]
    return np.where(length > 0, vectors / np.where(length > 0, length, 1), instead)


def _interpolated(weights: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Interpolate corners (F, 3, 3) by weights, (n, 3) or (F, n, 3), to (F, n, 3).  The sum is
    taken term by term, so that points of shared edges agree to the last bit."""
    a, b, c = (weights[..., k, None] * corners[:, None, k] for k in range(3))
    return a + b + c


def hashed(keys: np.ndarray) -> np.ndarray:
    """Return uint64 hashes (P,) of integers (P, n)."""
    hashes = np.zeros(len(keys), np.uint64)
    for column in keys.T.astype(np.uint64):
        hashes = shuffled((hashes ^ column) + GOLDEN)
    return hashes


def shuffled(x: np.ndarray) -> np.ndarray:
    """Return uint64 (P,) after the finaliser of splitmix64 (G. Steele et al., 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
