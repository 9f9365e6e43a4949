"""Mesh colours: points on triangles where light is baked, shared between neighbours.

A *face* is a side of a triangle, 2 t in front (where corners run counter-clockwise) and 2 t + 1
behind.  Its grid is that of :class:`lfcore.scene.baked.BakedLight`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from lfcore.scene.model import Scene

# Points whose places differ by less than this share of the scene's size, and normals by less than
# the other, are one.
_PLACE, _NORMAL = 2.0**-22, 2.0**-8
# Rays start this share of a cell inside the triangle: corners lie on neighbouring walls.
_INSET = 0.02
# Opposite normals are as unlike as places this share of the scene's size apart.
_ALIKE = 0.1
_BESIDE, _CUBES = 1 / 64, 256
GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@cache
def lattice(side: int) -> np.ndarray:
    """((side + 1) (side + 2) / 2, 2) columns and rows of a grid's points, in order."""
    rows = [
        np.stack([np.arange(side + 1 - j), np.full(side + 1 - j, j)], 1) for j in range(side + 1)
    ]
    return np.concatenate(rows)


def grid_point(i: np.ndarray, j: np.ndarray, side: np.ndarray | np.int64) -> np.ndarray:
    """The number of a point on its grid."""
    return j * (2 * side + 3 - j) // 2 + i


@dataclass(frozen=True)
class Points:
    """Places that gather light: float32 (P, 3) each; ``normals`` and ``flat``, the triangle's own,
    on the side of the face, and ``cells``, metres (P,)."""

    places: np.ndarray
    normals: np.ndarray
    flat: np.ndarray
    cells: np.ndarray

    def __len__(self) -> int:
        return len(self.places)

    def of(self, which: np.ndarray | slice) -> Points:
        return Points(*(array[which] for array in vars(self).values()))

    @classmethod
    def joined(cls, parts: list[Points]) -> Points:
        return cls(*map(np.concatenate, zip(*(vars(p).values() for p in parts), strict=True)))


def corner_normals(scene: Scene, lens: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(T, 2, 3, 3) unit float64 shading normals in front and behind, and (T, 3) the triangles' own,
    in front.  Of faces towards points of the lens (n, 2) they are turned to it, as by kernels;
    others to their side."""
    p, q, r = scene.triangles.astype(np.float64).swapaxes(0, 1)
    flat = _unit(np.cross(q - p, r - p))
    front = np.repeat(flat[:, None], 3, axis=1)
    if len(scene.normals):
        front = scene.normals.astype(np.float64)
        away = dot(front, flat[:, None]).max(1) < 0
        front = np.where(away[:, None, None], -front, front)
    both = np.stack([front, -front], 1)
    towards, away = np.zeros((len(flat), 2), bool), np.ones((len(flat), 2), bool)
    for at in lens:
        ways = scene.triangles - np.append(at, 0)
        up = dot(flat, ways[:, 0]) < 0
        towards |= np.stack([up, ~up], 1)
        off = dot(front, ways)
        away &= np.stack([(off > 0).all(1), (off < 0).all(1)], 1)
    return np.where((towards & away)[..., None, None], -both, both), flat


class Grids:
    """Points of the grids of faces, each place once; normals are :func:`corner_normals`.

    Attributes
    ----------
    sides : (T,) cells along an edge.
    first : (2 T,) where a face's grid begins in ``index``; -1 without one.
    index : (G,) the point of each grid point; ``moved`` (G,), whether another took its place.
    instead : (2 T,) of faces without a grid, a point that has about their light.
    points : the points.
    """

    def __init__(self, scene: Scene, sides: np.ndarray, normals: np.ndarray, flat: np.ndarray):
        self.scene, self.sides = scene, sides
        self.first = np.full(2 * len(sides), -1, np.int64)
        self.instead = np.zeros(2 * len(sides), np.int64)
        self.index, self.moved = np.zeros(0, np.int64), np.zeros(0, bool)
        self._hashes = np.zeros(0, np.uint64)
        empty = np.zeros((0, 3), np.float32)
        self.points = Points(empty, empty, empty, np.zeros(0))
        self._normals, self._flat = normals, flat
        self._low, self._size = extent(scene.triangles)

    def add(self, faces: np.ndarray) -> slice:
        """Grids of faces that have none; returns their new points."""
        faces = np.unique(faces[self.first[faces] < 0])
        before, hashes, made = len(self.points), [self._hashes], [self.points]
        length = len(self.index)
        for side in np.unique(self.sides[faces // 2]).tolist():
            of_side = faces[self.sides[faces // 2] == side]
            points, keys = self.at(of_side, lattice(side), side)
            count = len(lattice(side))
            self.first[of_side] = length + count * np.arange(len(of_side))
            length += count * len(of_side)
            hashes.append(keys)
            made.append(points)
        every = np.concatenate(hashes)
        unique, first, where = np.unique(every, return_index=True, return_inverse=True)
        # Old points keep their numbers, new ones follow in order.
        order = np.argsort(first, kind="stable")
        number = np.empty(len(unique), np.int64)
        number[order] = np.arange(len(unique))
        joined = Points.joined(made)
        self.points, self._hashes = joined.of(first[order]), every[first[order]]
        self.index = np.concatenate([self.index, number[where[before:]]])
        self.moved = np.pad(self.moved, (0, len(self.index) - len(self.moved)))
        return slice(before, len(self.points))

    def at(self, faces: np.ndarray, places: np.ndarray, side: int) -> tuple[Points, np.ndarray]:
        """Points (F n) at columns and rows (n, 2), or (F, n, 2), of grids of faces (F,), and their
        hashes."""
        rest, number = side - places.sum(-1, keepdims=True), places.shape[-2]
        weights = np.concatenate([rest, places], -1).astype(np.float64)
        triangle, sign = faces // 2, 1.0 - 2.0 * (faces % 2)
        corners = self.scene.triangles[triangle].astype(np.float64)
        exact = _mixed(weights, corners) / side
        normals = _unit(_mixed(weights, self._normals[triangle, faces % 2]))
        flat = np.repeat((self._flat[triangle] * sign[:, None])[:, None], number, axis=1)
        inset = exact + _INSET / side * (corners.mean(1, keepdims=True) - exact)
        edge = longest_edge(corners) / side
        key = np.concatenate(
            [np.rint((exact - self._low) / (self._size * _PLACE) + 0.37),
             np.rint(normals / _NORMAL + 0.37)], -1
        ).astype(np.int64)  # fmt: skip
        made = (array.reshape(-1, 3).astype(np.float32) for array in (inset, normals, flat))
        points = Points(next(made), next(made), next(made), np.repeat(edge, number))
        return points, hashed(key.reshape(-1, 6))

    def nearest(self, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """The points that are nearest to hits of barycentric ``weights`` (R, 3); -1 without any."""
        side = self.sides[faces // 2]
        i = np.rint(weights[:, 1] * side).astype(np.int64)
        j = np.rint(weights[:, 2] * side).astype(np.int64)
        over = i + j > side
        i = np.clip(i - (over & (weights[:, 1] >= weights[:, 2])), 0, side)
        j = np.clip(j, 0, side - i)
        first = self.first[faces]
        at = np.maximum(first, 0) + grid_point(i, j, side)
        return np.where(first < 0, self.instead[faces], self.index[np.where(first < 0, 0, at)])

    def move(self, faces: np.ndarray, spots: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Move points ``which`` (P,) of faces of one cell to spots (F, 3) there; returns which."""
        is_one = self.sides[faces // 2] == 1
        index = self.index[self.first[faces[is_one], None] + np.arange(3)]
        of, corner = np.nonzero(which[index])
        at, spot, face = index[of, corner], spots[is_one][of, None], faces[is_one][of]
        corners, normals = self.scene.triangles[face // 2], self._normals[face // 2, face % 2]
        self.points.places[at] = _mixed(spot, corners.astype(np.float64))[:, 0]
        self.points.normals[at] = _unit(_mixed(spot, normals)[:, 0])
        self.points.flat[at] = self._flat[face // 2] * (1 - 2 * (face % 2))[:, None]
        return np.isin(np.arange(len(which)), at)

    def replace(self, which: np.ndarray) -> None:
        """Let others take the place of points ``which`` (P,): the nearest that look alike."""
        if which.any() and not which.all():
            other = np.arange(len(which))
            others, some = np.flatnonzero(~which), self.points.of(which)
            other[which] = others[self._alike(self.points.of(others), some.places, some.normals)]
            self.moved = which[self.index]
            self.index = other[self.index]

    def stand_in(self) -> None:
        """Find points for faces without grids: the nearest that look alike."""
        lacking, used = np.flatnonzero(self.first < 0), np.unique(self.index)
        places, normals = self._middles(lacking)
        # One for all faces of a small cube that look about the same way.
        cube = (places - self._low) * (_CUBES / self._size)
        keys = hashed(np.rint(np.concatenate([cube, 1.5 * normals], 1)).astype(np.int64))
        _, first, of = np.unique(keys, return_index=True, return_inverse=True)
        found = self._alike(self.points.of(used), places[first], normals[first])
        self.instead[lacking] = used[found][of]

    def beside(self, faces: np.ndarray, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Points (F, n) of faces: of ``which`` where one is next to a face, else of ``points``."""
        places, normals = self._middles(faces)
        found = self._alike(self.points.of(which), places, normals, _BESIDE)
        near = found < len(which)
        points[near] = which[found[near], None]
        return points

    def _middles(self, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(F, 3) places and shading normals."""
        triangle = faces // 2
        of = self.scene.triangles[triangle], self._normals[triangle, faces % 2]
        places, normals = ((at[:, 0] + at[:, 1] + at[:, 2]) / 3 for at in of)
        return places, normals

    def _alike(
        self, points: Points, places: np.ndarray, normals: np.ndarray, within: float = np.inf
    ) -> np.ndarray:
        """The index (P,) of the point that is nearest to places and normals (P, 3), ``within`` a
        share of the scene's size; ``len(points)`` where no point is."""
        from scipy.spatial import cKDTree  # slow to import

        scale = np.float64(1 / self._size)
        tree = cKDTree(np.concatenate([points.places * scale, _ALIKE * points.normals], 1))
        sought = np.concatenate([places * scale, _ALIKE * normals], 1)
        return tree.query(sought, distance_upper_bound=within)[1]


def extent(triangles: np.ndarray) -> tuple[np.ndarray, float]:
    """The low corner (3,), float64, of the box around triangles (T, 3, 3), and its longest side."""
    axes = triangles.reshape(-1, 3).T  # one by one: numpy takes ten times as long for all three
    low, high = (np.array([float(of(axis)) for axis in axes]) for of in (np.min, np.max))
    return low, float((high - low).max())


def longest_edge(corners: np.ndarray) -> np.ndarray:
    """(T,) of triangles (T, 3, 3)."""
    edges = corners - np.roll(corners, 1, axis=1)
    a, b, c = np.sqrt(dot(edges, edges)).T
    return np.maximum(np.maximum(a, b), c)


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Term by term: libraries add in other orders on other processors, and numpy takes longer."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.sqrt(dot(vectors, vectors))[..., None]


def _mixed(weights: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(F, n, 3) of weights (n, 3) or (F, n, 3) and corners (F, 3, 3), term by term: shared edges
    have the same points to the last bit."""
    a, b, c = (weights[..., k, None] * corners[:, None, k] for k in range(3))
    return a + b + c


def hashed(keys: np.ndarray) -> np.ndarray:
    """(P,) uint64 of integers (P, n)."""
    hashes = np.zeros(len(keys), np.uint64)
    for column in keys.T.astype(np.uint64):
        hashes = shuffled((hashes ^ column) + GOLDEN)
    return hashes


def shuffled(x: np.ndarray) -> np.ndarray:
    """(P,) uint64, by the finaliser of splitmix64 (G. Steele et al., 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
