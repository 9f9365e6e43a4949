"""Finer grids where baked light changes fast: contact shadows, and edges of what is lit."""

import numpy as np

from lfcore.baking.irradiance_cache import Baker
from lfcore.baking.points import grid_point, lattice
from lfcore.baking.rays import mean_colour
from lfcore.scene.baked import BakedLight

FINER = 8
"""Cells are halved until an edge has this many times the cells that the picture needs at first,
times ``BakeOptions.fineness``; an edge between lit and dark errs as the root of its cells."""
_SURPRISE, _CONTRAST = 0.06, 1.5
"""A point between neighbours may differ by such a share from their mean, or by the error that is
asked for; where it does not, cells are halved no more.  Neighbours that differ by so many times
more have a point between them."""
_FEW, _RAYS, _NOISE = 24, 128, 0.2
"""Rays of such a point; of one that surprises, or whose noise is above a share of the square of
its allowed difference; and this share."""
_DOUBTED, _CUT = 0.6, 15.0
"""The share of the noise by which differences are lessened: with all of it, details are lost; and
how many times their noise the square of what averaged neighbours differ by is at most."""
_MOST_SIDE = 1024
_VALUE_BYTES = 64


class Refinement:
    """The grids of all triangles, of which rough ones are halved.

    Parameters
    ----------
    baker : what gathers light, converged.
    wanted : (T,) cells along an edge, in the mean, that the picture needs to begin with.
    """

    def __init__(self, baker: Baker, wanted: np.ndarray):
        self.baker, self.grids, self._wanted = baker, baker.grids, wanted
        self._light = baker.smoothed().astype(np.float32)
        bright = self._light[: len(baker.open)][baker.open].mean(-1)
        self._floor = 0.25 * float(bright.mean()) if len(bright) else 0.0
        error = baker.options.error
        self._allowed = max(_SURPRISE, error)
        self._finer = FINER * baker.options.fineness
        self._room = baker.options.mib * 2**20 // 2 // _VALUE_BYTES
        self._next_seed = len(self._light)

    def light(self) -> BakedLight:
        """All grids, finished."""
        sides = self.grids.sides
        seen = self.baker.seen.reshape(-1, 2).any(1)
        hidden = np.flatnonzero(~seen)
        kept = [(1, hidden, self._constant(hidden))]
        for side in np.unique(sides).tolist():
            triangles = np.flatnonzero(seen & (sides == side))
            values, covered = self._values(triangles, side)
            self._room -= values.size // 3
            kept += self._halve(triangles, side, values, covered)
        return self._assembled(kept)

    def _constant(self, triangles: np.ndarray) -> np.ndarray:
        """(T, 2, 3, 3) values of 1-cell grids at corners, or those that stand in for them."""
        faces = 2 * triangles[:, None] + np.arange(2)
        weights = np.repeat(np.eye(3)[None], faces.size, axis=0).reshape(-1, 3)
        points = self.grids.nearest(np.repeat(faces.ravel(), 3), weights).reshape(-1, 3)
        # Some that the camera sees are too small for its rays to find.
        points = self.grids.beside(faces.ravel(), np.flatnonzero(self.baker.open), points)
        return self._light[points].reshape(len(triangles), 2, 3, 3)

    def _values(self, triangles: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
        """(T, 2, n, 3) values of grids of a side; (T, 2, n) whether others' took their place."""
        faces = 2 * triangles[:, None] + np.arange(2)
        first = self.grids.first[faces][..., None]
        at = np.where(first < 0, 0, first + np.arange(len(lattice(side))))
        points = np.where(first < 0, self.grids.instead[faces][..., None], self.grids.index[at])
        return self._light[points], self.grids.moved[at] & (first >= 0)

    def _halve(
        self, triangles: np.ndarray, side: int, values: np.ndarray, covered: np.ndarray
    ) -> list[tuple[int, np.ndarray, np.ndarray]]:
        kept, begun = [], side
        while 2 * side <= _MOST_SIDE:
            coarse = self._wanted[triangles] <= side / self._finer
            kept.append((side, triangles[coarse], values[coarse]))
            triangles, values, covered = triangles[~coarse], values[~coarse], covered[~coarse]
            ends, most = _ends(side), _CONTRAST * self._allowed
            hidden, rough = _rough(values, covered, side, ends, self._floor, most)
            if side == begun:
                large = self._wanted[triangles, None, None] > side / 2
                rough |= (large | hidden) & _is_new(side)
            faces = 2 * triangles[:, None] + np.arange(2)
            rough &= self.baker.seen[faces][..., None]
            at = np.nonzero(rough)
            (u, v), corners = lattice(2 * side)[at[2]].T / (2 * side), self.grids.scene.triangles
            p, q, r = corners[triangles[at[0]]].transpose(1, 2, 0)
            rough[at] = self.baker.around.in_view((p + u * (q - p) + v * (r - p)).T)
            todo = rough.any((1, 2))
            cost = int(todo.sum()) * 2 * hidden.shape[2]
            if not todo.any() or cost > self._room:
                break
            kept.append((side, triangles[~todo], values[~todo]))
            self._room -= cost
            values = _between(values[todo], covered[todo], ends)
            triangles, covered, side = triangles[todo], hidden[todo], 2 * side
            surprised = self._gather(faces[todo], side, values, covered, rough[todo])
            kept.append((side, triangles[~surprised], values[~surprised]))
            triangles, values, covered = triangles[surprised], values[surprised], covered[surprised]
            if not len(triangles):
                return kept
        return [*kept, (side, triangles, values)]

    def _gather(
        self,
        faces: np.ndarray,
        side: int,
        values: np.ndarray,
        covered: np.ndarray,
        rough: np.ndarray,
    ) -> np.ndarray:
        """Replace rough values by gathered ones; (T,) whether they differ from the mean."""
        at, places = np.nonzero(rough), lattice(side)
        on, where = faces[at[0], at[1]], places[at[2]]
        points, keys = self.grids.at(on, where[:, None], side)
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        weights = np.column_stack([side - where.sum(1), where])[first] / side
        points, near = points.of(first), self.grids.nearest(on[first], weights)
        before = values[at][first]
        seeds = self._next_seed + np.arange(len(first))
        self._next_seed += len(first)
        sums = np.zeros((2, len(first), 3), np.float32)
        is_open = ~self.baker.around.covered(points)
        some = np.flatnonzero(is_open)
        given = points.of(some), near[some], seeds[some]
        sums[:, some], is_open[some] = self.baker.gather(*given, 0, _FEW)
        covered[at] = ~is_open[inverse]
        found, noise = self._judged(sums, _FEW, near)
        most = self._allowed * np.maximum(mean_colour(found), self._floor)
        off = mean_colour(found - before)
        share = self._share(off, noise, near)
        unsure = (off**2 > np.maximum(most**2, noise)) | (share**2 * noise > _NOISE * most**2)
        unsure = np.flatnonzero(is_open & unsure)
        if len(unsure):
            some = near[unsure]
            more = points.of(unsure), some, seeds[unsure]
            sums[:, unsure] += self.baker.gather(*more, _FEW, _RAYS - _FEW)[0]
            found[unsure], noise[unsure] = self._judged(sums[:, unsure], _RAYS, some)
            off = mean_colour(found - before)
            share = self._share(off, noise, near)
        share = np.where(is_open, share, 0)
        values[at] = (before + share[:, None] * (found - before))[inverse]
        _smooth(values, at, (share**2 * noise)[inverse], side)
        large = is_open & (off**2 > most**2 + 2 * noise)
        surprised = np.zeros(len(values), bool)
        surprised[at[0][large[inverse]]] = True
        return surprised

    def _share(self, off: np.ndarray, noise: np.ndarray, near: np.ndarray) -> np.ndarray:
        """(P,) of differences to the mean, the share that is kept: not noise of points nearby."""
        every = np.maximum(self.baker.pooled(off, near), 1e-30)
        return np.maximum(1 - _DOUBTED * noise / every, 0)

    def _judged(self, sums: np.ndarray, rays: int, near: np.ndarray) -> tuple[np.ndarray, ...]:
        """(P, 3) light of sums (2, P, 3), and (P,) the expected squares of its errors."""
        halves = 2 * sums / rays
        return halves.mean(0), self.baker.pooled(mean_colour(halves[0] - halves[1]) / 2, near)

    def _assembled(self, kept: list[tuple[int, np.ndarray, np.ndarray]]) -> BakedLight:
        grids = np.zeros((len(self.grids.sides), 3), np.int32)
        chunks, length = [], 0
        for side, triangles, values in kept:
            count = values.shape[2]
            firsts = length + count * np.arange(2 * len(triangles)).reshape(-1, 2)
            grids[triangles] = np.column_stack([firsts, np.full(len(triangles), side)])
            chunks.append(values.reshape(-1, 3))
            length += 2 * count * len(triangles)
        return BakedLight(grids, np.concatenate(chunks, dtype=np.float32))


def _rough(
    values: np.ndarray,
    covered: np.ndarray,
    side: int,
    ends: list[np.ndarray],
    floor: float,
    most: float,
) -> tuple[np.ndarray, ...]:
    """Of points (T, 2, n) of grids of twice the cells: whether both neighbours are covered; and
    whether the point is rough: they differ by more than a share, or one of the two is covered."""
    light = mean_colour(values)
    (x, y), (a, b) = ([of.take(k, 2) for k in ends] for of in (light, covered))
    rough = abs(x - y) > most * np.maximum(np.maximum(x, y), floor)
    return a & b, rough | ((a != b) & _is_new(side))


def _between(values: np.ndarray, covered: np.ndarray, ends: list[np.ndarray]) -> np.ndarray:
    """(T, 2, n, 3) values of grids of twice the cells, linear between points (T, 2, n) that are not
    covered."""
    (a, b), (hidden, other) = ([of.take(k, 2) for k in ends] for of in (values, covered))
    a, b = np.where(hidden[..., None], b, a), np.where(other[..., None], a, b)
    return (a + b) / 2


def _ends(side: int) -> list[np.ndarray]:
    """The two neighbours (n,), of a side's grid, of each point of one of twice the cells."""
    places = lattice(2 * side)
    odd = places % 2
    # Across a cell's diagonal where both are odd.
    step = np.stack([odd[:, 0], np.where(odd[:, 0] == 1, -odd[:, 1], odd[:, 1])], 1)
    ends = [(places + sign * step) // 2 for sign in (-1, 1)]
    return [grid_point(end[:, 0], end[:, 1], np.int64(side)).astype(np.int64) for end in ends]


def _smooth(values: np.ndarray, at: tuple, noise: np.ndarray, side: int) -> None:
    """Average values (T, 2, n, 3) ``at`` points, of ``noise`` (P,), with those beside them on the
    grid, on an edge with those on it, as far as noise can be what they differ by."""
    places = lattice(side)[at[2]]
    places = np.column_stack([places, side - places.sum(1)])[:, None]
    to = places + np.array([[1, -1, 0], [-1, 1, 0], [1, 0, -1], [-1, 0, 1], [0, 1, -1], [0, -1, 1]])
    inside = ((to >= 0) & ((places > 0) | (to == 0))).all(-1)
    number = grid_point(to[..., 0], to[..., 1], np.int64(side))
    beside = np.where(inside, number, at[2][:, None])
    off = values[at[0][:, None], at[1][:, None], beside] - values[at][:, None]
    share = np.maximum(1 - mean_colour(off) ** 2 / (_CUT * noise + 1e-30)[:, None], 0)
    values[at] += (share[..., None] * off).sum(1) / (1 + beside.shape[1])


def _is_new(side: int) -> np.ndarray:
    """(n,) of points of grids of twice the cells, whether a side has none there."""
    odd = lattice(2 * side) % 2 == 1
    return odd[:, 0] | odd[:, 1]
