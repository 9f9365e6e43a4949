"""Adaptive refinement: finer grids where irradiance changes fast, such as contact shadows."""

import numpy as np

from lfcore.baking.irradiance_cache import IrradianceCache
from lfcore.baking.mesh_colours import (
    LIKE_NORMAL,
    Points,
    corner_normals,
    grid_point,
    lattice,
    nearest_points,
)
from lfcore.baking.surroundings import mean_colour
from lfcore.scene.baked import DARK, BakedLight

FINEST = 8
"""The most cells along an edge, relative to the cells that are needed at first (times
``fineness``).  The error at a shadow's edge falls with the square root of the cells' size."""
_SURPRISE = 0.06
"""The least difference between a point and its neighbours' mean, a share of the light, for which
cells are halved again; the required error, if that is larger."""
_CONTRAST = 1.5
"""The least difference of two neighbours, a multiple of the surprise, for which a point is put
between them."""
_TRIAL_RAYS = 24
"""The first rays of a new point."""
_RAYS = 128
"""The rays of a new point that surprises or is noisy."""
_NOISY = 0.2
"""A point is noisy if its variance exceeds this share of the squared surprise."""
_DOUBT = 0.6
"""The share of the variance by which differences are reduced; with all of it, details are lost."""
_CUTOFF = 15.0
"""Neighbours are averaged if the square of their difference is below this multiple of the
variance."""
_LARGEST_SIDE = 1024
"""The most cells along an edge: half a million points per face."""
_VALUE_BYTES = 64
"""Memory per point while grids are refined, bytes."""
_FINER = 4
"""Parts, per side, of a cube in which small faces share points: each part has one value."""
_NEAREST = 8
"""The points from which the value of a part is interpolated."""
_STEPS = np.array([[1, -1, 0], [-1, 1, 0], [1, 0, -1], [-1, 0, 1], [0, 1, -1], [0, -1, 1]])
"""Steps to a grid point's six neighbours, in units of barycentric weights."""


class Refinement:
    """The grids of all triangles, some of which are refined.

    Parameters
    ----------
    cache : the converged irradiance cache.
    irradiance : (P, 3) its denoised light.
    cells : (T,) cells along an edge, in the mean, that the picture needs at first.
    """

    def __init__(self, cache: IrradianceCache, irradiance: np.ndarray, cells: np.ndarray):
        self.cache, self.grids, self._cells = cache, cache.grids, cells
        self._light = irradiance.astype(np.float32)
        bright = self._light[: len(cache.is_open)][cache.is_open].mean(-1)
        self._dark = DARK * float(bright.mean()) if len(bright) else 0.0
        self._surprise = max(_SURPRISE, cache.options.error)
        self._finest = FINEST * cache.options.fineness
        self._room = cache.options.mib * 2**20 // 2 // _VALUE_BYTES
        self._next_seed = len(self._light)
        self._stored, self._length = np.zeros((len(cells), 3), np.int32), 0
        self._chunks: list[np.ndarray] = []

    def refine(self) -> BakedLight:
        """Refine where needed; returns the grids of all triangles."""
        grids, seen = self.grids, self.cache.seen.reshape(-1, 2).any(1)
        self._store(1, grids.lacking, self._corner_values(grids.examples), grids.group)
        hidden = np.flatnonzero((grids.first >= 0) & ~self.cache.seen)
        self._store(1, hidden, self._corner_values(hidden))
        shared = seen & (grids.steps > 0)
        self._interpolate(np.flatnonzero(self.cache.seen & np.repeat(shared, 2)))
        for side in np.unique(grids.sides[seen & ~shared]).tolist():
            triangles = np.flatnonzero(seen & ~shared & (grids.sides == side))
            values, covered = self._values(triangles, side)
            self._room -= values.size // 3
            for finer, chosen, light in self._halve(triangles, side, values, covered):
                faces = 2 * chosen[:, None] + np.arange(2)
                self._store(finer, faces.ravel(), light.reshape(-1, *light.shape[2:]))
        return BakedLight(self._stored, np.concatenate(self._chunks, dtype=np.float32))

    def _store(
        self,
        side: int,
        faces: np.ndarray,
        values: np.ndarray,
        row: np.ndarray | slice = slice(None),
    ) -> None:
        """Store grids of ``values`` (G, n, 3); ``row`` (F,) is the grid of each face."""
        firsts = self._length + values.shape[1] * np.arange(len(values))
        self._stored[faces // 2, faces % 2], self._stored[faces // 2, 2] = firsts[row], side
        self._chunks.append(values.reshape(-1, 3))
        self._length += values.size // 3

    def _corner_values(self, faces: np.ndarray) -> np.ndarray:
        """Return the values (F, 3, 3) of grids of one cell of faces (F,)."""
        corners = np.tile(np.eye(3), (len(faces), 1))
        points = self.grids.nearest(np.repeat(faces, 3), corners).reshape(-1, 3)
        # The camera sees some faces that are too small for its sample rays to hit.
        seen = np.flatnonzero(self.cache.is_open)
        return self._light[self.grids.prefer_adjacent(faces, seen, points)]

    def _interpolate(self, faces: np.ndarray) -> None:
        """Store the light at the corners of faces that share points, interpolated between these."""
        grids, steps = self.grids, self.grids.steps[faces // 2]
        seen = np.flatnonzero(self.cache.is_open)
        points, count = grids.points.take(seen), np.arange(min(_NEAREST, len(seen))) + 1
        for step in np.unique(steps):
            chosen = faces[steps == step]
            places = grids.scene.triangles[chosen // 2].astype(np.float64)
            normals, _ = corner_normals(grids.scene, self.cache.around.lens, chosen)
            keys = grids.keys(places, normals, np.full(len(chosen), step), _FINER)
            _, first, at = np.unique(keys, return_index=True, return_inverse=True)
            where = places.reshape(-1, 3)[first], normals.reshape(-1, 3)[first]
            distance, near = nearest_points(points, *where, (step, 1 / LIKE_NORMAL), count)
            # A point's share falls smoothly to nothing where it is no longer one of the nearest.
            reach = np.maximum(distance[:, -1:], 1e-30)
            share = ((1 - (distance / reach) ** 2) ** 2 + 1e-9)[..., None]
            light = (share * self._light[seen[near]]).sum(1) / share.sum(1)
            self._store(1, chosen, light[at].reshape(-1, 3, 3))

    def _values(self, triangles: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the values (T, 2, n, 3) of grids, and the mask (T, 2, n) of points that others
        substitute."""
        faces = 2 * triangles[:, None] + np.arange(2)
        first = self.grids.first[faces][..., None]
        at = np.where(first < 0, 0, first + np.arange(len(lattice(side))))
        substitutes = self.grids.substitute[faces][..., None]
        points = np.where(first < 0, substitutes, self.grids.index[at])
        return self._light[points], self.grids.substituted[at] & (first >= 0)

    def _halve(
        self, triangles: np.ndarray, side: int, values: np.ndarray, covered: np.ndarray
    ) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Halve the cells of triangles with equal sides while new points surprise; returns (side,
        triangles, values) of finished grids."""
        finished, first_side = [], side
        while 2 * side <= _LARGEST_SIDE:
            enough = self._cells[triangles] <= side / self._finest
            finished.append((side, triangles[enough], values[enough]))
            triangles, values, covered = triangles[~enough], values[~enough], covered[~enough]
            ends = _ends(side)
            limit = _CONTRAST * self._surprise
            both_covered, rough = _rough(values, covered, side, ends, self._dark, limit)
            if side == first_side:
                large = self._cells[triangles, None, None] > side / 2
                rough |= (large | both_covered) & _is_new(side)
            rough &= self._visible(triangles, side, rough)
            chosen = rough.any((1, 2))
            cost = int(chosen.sum()) * 2 * both_covered.shape[2]
            if not chosen.any() or cost > self._room:
                break
            finished.append((side, triangles[~chosen], values[~chosen]))
            self._room -= cost
            values = _midpoints(values[chosen], covered[chosen], ends)
            triangles, covered, side = triangles[chosen], both_covered[chosen], 2 * side
            surprising = self._gather(triangles, side, values, covered, rough[chosen])
            finished.append((side, triangles[~surprising], values[~surprising]))
            triangles, values = triangles[surprising], values[surprising]
            covered = covered[surprising]
            if not len(triangles):
                return finished
        return [*finished, (side, triangles, values)]

    def _visible(self, triangles: np.ndarray, side: int, which: np.ndarray) -> np.ndarray:
        """Return the mask ``which`` (T, 2, n), of points of grids of twice the cells, without
        points that the camera does not see."""
        faces = 2 * triangles[:, None] + np.arange(2)
        visible = which & self.cache.seen[faces][..., None]
        at = np.nonzero(visible)
        (u, v), corners = lattice(2 * side)[at[2]].T / (2 * side), self.grids.scene.triangles
        p, q, r = corners[triangles[at[0]]].transpose(1, 2, 0)
        visible[at] = self.cache.around.in_view((p + u * (q - p) + v * (r - p)).T)
        return visible

    def _gather(
        self,
        triangles: np.ndarray,
        side: int,
        values: np.ndarray,
        covered: np.ndarray,
        rough: np.ndarray,
    ) -> np.ndarray:
        """Replace the values of rough points by gathered light; returns the mask (T,) of triangles
        where that differs from the neighbours' mean."""
        at, places = np.nonzero(rough), lattice(side)
        faces, place = 2 * triangles[at[0]] + at[1], places[at[2]]
        points, keys = self.grids.points_at(faces, place[:, None], side)
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        weights = np.column_stack([side - place.sum(1), place])[first] / side
        points, near = points.take(first), self.grids.nearest(faces[first], weights)
        means = values[at][first]
        is_open, light, variance, limit = self._estimate(points, near, means)
        covered[at] = ~is_open[inverse]
        difference = mean_colour(light - means)
        share = np.where(is_open, self._trust(difference, variance, near), 0)
        values[at] = (means + share[:, None] * (light - means))[inverse]
        _smooth(values, at, (share**2 * variance)[inverse], side)
        large = is_open & (difference**2 > limit**2 + 2 * variance)
        surprising = np.zeros(len(values), bool)
        surprising[at[0][large[inverse]]] = True
        return surprising

    def _trust(self, difference: np.ndarray, variance: np.ndarray, near: np.ndarray) -> np.ndarray:
        """Return the share (P,) of differences to the mean that is kept, as not being noise."""
        squares = np.maximum(self.cache.variance(difference, near), 1e-30)
        return np.maximum(1 - _DOUBT * variance / squares, 0)

    def _estimate(self, points: Points, near: np.ndarray, means: np.ndarray) -> tuple:
        """Gather at points ``near`` seen ones, whose neighbours have the light ``means`` (P, 3).

        Returns the mask of points in the open, their light (P, 3), its variance, and the difference
        to the means that surprises (P,).
        """
        seeds = self._next_seed + np.arange(len(points))
        self._next_seed += len(points)
        sums = np.zeros((2, len(points), 3), np.float32)
        is_open = ~self.cache.around.covered(points)
        some = np.flatnonzero(is_open)
        chosen = points.take(some), near[some], seeds[some]
        sums[:, some], is_open[some] = self.cache.gather(*chosen, 0, _TRIAL_RAYS)
        light, variance = self._mean_and_variance(sums, _TRIAL_RAYS, near)
        limit = self._surprise * np.maximum(mean_colour(light), self._dark)
        difference = mean_colour(light - means)
        noise = self._trust(difference, variance, near) ** 2 * variance
        uncertain = (difference**2 > np.maximum(limit**2, variance)) | (noise > _NOISY * limit**2)
        some = np.flatnonzero(is_open & uncertain)
        if len(some):
            chosen = points.take(some), near[some], seeds[some]
            sums[:, some] += self.cache.gather(*chosen, _TRIAL_RAYS, _RAYS - _TRIAL_RAYS)[0]
            light[some], variance[some] = self._mean_and_variance(sums[:, some], _RAYS, near[some])
        return is_open, light, variance, limit

    def _mean_and_variance(
        self, sums: np.ndarray, rays: int, near: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the light (P, 3) of sums (2, P, 3) of halves, and its variance (P,)."""
        halves = 2 * sums / rays
        error = mean_colour(halves[0] - halves[1]) / 2
        return halves.mean(0), self.cache.variance(error, near)


def _rough(
    values: np.ndarray,
    covered: np.ndarray,
    side: int,
    ends: list[np.ndarray],
    dark: float,
    limit: float,
) -> tuple[np.ndarray, ...]:
    """Return two masks (T, 2, n) of points of grids of twice the cells.

    Points of the first are between two covered points.  Points of the second, the rough ones, are
    between two points of which one is covered, or which differ by more than ``limit``, a share of
    the light.
    """
    light = mean_colour(values)
    (x, y), (a, b) = ([array.take(k, 2) for k in ends] for array in (light, covered))
    rough = abs(x - y) > limit * np.maximum(np.maximum(x, y), dark)
    return a & b, rough | ((a != b) & _is_new(side))


def _midpoints(values: np.ndarray, covered: np.ndarray, ends: list[np.ndarray]) -> np.ndarray:
    """Return the values (T, 2, n, 3) of grids of twice the cells, linear between points that are
    not covered."""
    (a, b), (a_covered, b_covered) = (
        [array.take(k, 2) for k in ends] for array in (values, covered)
    )
    a, b = np.where(a_covered[..., None], b, a), np.where(b_covered[..., None], a, b)
    return (a + b) / 2


def _ends(side: int) -> list[np.ndarray]:
    """Return, for each point of the grid of twice the cells, the two points (n,) of the grid on
    both sides of it."""
    places = lattice(2 * side)
    odd = places % 2
    # Across a cell's diagonal where both are odd.
    step = np.stack([odd[:, 0], np.where(odd[:, 0] == 1, -odd[:, 1], odd[:, 1])], 1)
    ends = [(places + sign * step) // 2 for sign in (-1, 1)]
    return [grid_point(end[:, 0], end[:, 1], np.int64(side)).astype(np.int64) for end in ends]


def _smooth(values: np.ndarray, at: tuple, variance: np.ndarray, side: int) -> None:
    """Average values (T, 2, n, 3) at the points ``at``, of ``variance`` (P,), with their neighbours
    on the grid, or on its edge, where they differ by noise alone."""
    places = lattice(side)[at[2]]
    places = np.column_stack([places, side - places.sum(1)])[:, None]
    to = places + _STEPS
    inside = ((to >= 0) & ((places > 0) | (to == 0))).all(-1)
    number = grid_point(to[..., 0], to[..., 1], np.int64(side))
    neighbour = np.where(inside, number, at[2][:, None])
    difference = values[at[0][:, None], at[1][:, None], neighbour] - values[at][:, None]
    limit = (_CUTOFF * variance + 1e-30)[:, None]
    share = np.maximum(1 - mean_colour(difference) ** 2 / limit, 0)
    values[at] += (share[..., None] * difference).sum(1) / (1 + neighbour.shape[1])


def _is_new(side: int) -> np.ndarray:
    """Return the mask (n,) of points of a grid of twice the cells that the grid itself lacks."""
    odd = lattice(2 * side) % 2 == 1
    return odd[:, 0] | odd[:, 1]
