"""Points where irradiance is kept, and the rays that estimate it."""

import math

import numpy as np

from lfcore.baking.gather import Gatherer
from lfcore.baking.importance_guide import Guide
from lfcore.baking.lamps import Lamps
from lfcore.baking.points import Grids, Points, grid_point, lattice
from lfcore.baking.rays import BATCH, Surroundings, mean_colour
from lfcore.scene.baked import BakeOptions

_FEWEST, _MOST, _FIRST = 32, 1024, 2**20
"""Rays per point; and of all points at first, from which guides learn."""
_OF_HIDDEN = 16
_ROUNDS, _DARK = 4, 0.25
_HIT_BYTES = 18
_INSIDE = 0.9
"""The share of the way to a corner that a surface must leave free."""
_SMOOTHED, _STEPS, _CUT, _LIKE_NORMALS = 3.0, 4, 7.5, 0.95
"""How much more noise rays may leave at first than is asked for; steps of averaging neighbours,
where the square of what they differ by is not so many times their noise, take it."""


class Baker:
    """Points, the light that reaches them from surfaces nearby, and sums of their rays.

    Attributes
    ----------
    source : (P, 3) the light at points, without the scene's lights, that they send on last.
    direct : (P + D, 3) light of the scene's lights, at points and at points of ``fine`` grids.
    sums : (2, P, 3) sums of two halves of the rays; ``counts`` (P,) rays of each half.
    open : (S,) of points of seen faces, whether they are outside of things and not covered.
    """

    def __init__(self, grids: Grids, fine: Grids, around: Surroundings, options: BakeOptions):
        self.grids, self.fine, self.around, self.options = grids, fine, around, options
        self.sums = np.zeros((2, 0, 3), np.float32)
        self.counts, self.open = np.zeros(0, np.int64), np.zeros(0, bool)
        self.source = self.direct = np.zeros((0, 3), np.float32)
        self.error = 0.0
        self._hits: list[tuple] = []

    def find(self, seen: np.ndarray, spots: np.ndarray) -> None:
        """Gather at faces, seen at ``spots`` (F, 3), and at those that rays from there hit."""
        self.seen = np.zeros(2 * self.grids.scene.triangle_count, bool)
        self.seen[seen] = True
        fresh = self.grids.add(seen)
        most = self.options.fineness * min(_MOST // 4, _FIRST / max(fresh.stop, 1))
        count = max(_FEWEST, int(most) // 8 * 8)  # halves have whole rays to lamps
        hidden = self.around.covered(self.grids.points)
        hidden &= ~self.grids.move(seen, spots, hidden)
        self.in_view = self.around.in_view(self.grids.points.places)
        self.gatherer = Gatherer(Lamps(self.around, self.grids.points), self.seen)
        room = self.options.mib * 2**20 // 2 // (_HIT_BYTES * max(fresh.stop, 1))
        count = min(count, max(8, room // 8 * 8))
        self._seen_points, self._first = fresh.stop, count
        for turn in range(_ROUNDS):
            found = self._look(fresh, count)
            if not turn:
                self.open &= ~hidden
                self.open |= not self.open.any()
                self.grids.replace(~self.open)
            if not self.options.bounces or not len(found):
                break
            fresh, count = self.grids.add(found), min(count, _OF_HIDDEN)
            self._pull_in(found, fresh.start)
        self._extend()
        self.grids.stand_in()

    def _pull_in(self, faces: np.ndarray, first: int) -> None:
        """Move points from the ``first`` on that a surface cuts off from the middle of their small
        face to the middle: beyond that surface is other light."""
        faces = faces[self.grids.sides[faces // 2] == 1]
        index = self.grids.index[self.grids.first[faces, None] + np.arange(3)].ravel()
        corners = self.grids.scene.triangles[faces // 2]
        middle = np.repeat(corners.mean(1), 3, axis=0)
        towards = corners.reshape(-1, 3) - middle
        flat = np.repeat(self.around.flat_of(faces), 3, axis=0)
        starts = self.around.starts(
            Points(middle, flat, flat, self.grids.points.cells[index]), slice(None), towards
        )
        hit, _, far = self.around.cast(starts, towards)
        cut = (hit >= 0) & (far < _INSIDE) & (index >= first)
        self.grids.points.places[index[cut]] = middle[cut]

    def _extend(self) -> None:
        more = len(self.grids.points) - len(self.counts)
        self.counts = np.pad(self.counts, (0, more))
        self.sums = np.pad(self.sums, ((0, 0), (0, more), (0, 0)))

    def _look(self, fresh: slice, count: int) -> np.ndarray:
        """Send the first rays of fresh points and keep their hits; returns faces without grids."""
        self._extend()
        found, is_open = np.zeros(len(self.seen), bool), []
        for part in _batches(fresh, count):
            points, seeds = self.grids.points.of(part), np.arange(part.start, part.stop)
            sums, seeing, hits = self.gatherer.send(points, seeds, 0, count, -1)
            self.sums[:, part] += sums
            self.counts[part] += count // 2
            self._hits.append((part, count, hits))
            is_open.append(seeing)
            faces = hits[1].reshape(-1, count)[seeing]
            found[faces[faces >= 0]] = True
        if not len(self.open):
            self.open = np.concatenate([self.open, *is_open])
        return np.flatnonzero(found & (self.grids.first < 0))

    def mean(self) -> np.ndarray:
        """(P, 3) light at the points."""
        return self.sums.sum(0) / np.maximum(2 * self.counts, 1)[:, None]

    def bounce(self) -> None:
        """Let light go from surface to surface."""
        gridded = np.flatnonzero(self.grids.first >= 0)
        self.fine.add(gridded[(self.fine.sides > self.grids.sides)[gridded // 2]])
        self.direct = np.concatenate(
            [self.around.direct(grids.points) for grids in (self.grids, self.fine)]
        )
        self.gatherer.surfaces(self.grids, self.fine)
        del self.fine  # its light is all that is needed
        fixed, found = self.sums, [hits[0] for *_, hits in self._hits]
        self.source = np.zeros_like(self.mean())
        for _ in range(self.options.bounces):
            self.source, self.sums = self.mean(), fixed.copy()
            self.gatherer.light(self.source, self.direct)
            for number, (part, count, hits) in enumerate(self._hits):
                sums, found[number] = self.gatherer.reflect(part.stop - part.start, count, hits)
                self.sums[:, part] += sums
        looks = [(look[0], light) for look, light in zip(self._hits, found, strict=True)]
        points = self.grids.points.of(slice(0, self._seen_points))
        self.guide = Guide(points, self._first, looks)
        self.gatherer.guided(self.guide)
        self._hits = []

    def gather(
        self, points: Points, near: np.ndarray, seeds: np.ndarray, first: int, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """(2, P, 3) sums of halves of rays from ``first`` on, of points ``near`` seen ones (P,);
        and whether the points are open."""
        made, is_open = np.zeros((2, len(points), 3), np.float32), np.zeros(len(points), bool)
        for part in _batches(slice(0, len(points)), count):
            some, table = points.of(part), self.guide.of[near[part]]
            sent = self.gatherer.send(some, seeds[part], first, count, table)
            made[:, part], is_open[part], _ = sent
        return made, is_open

    def converge(self) -> None:
        """Send more rays from seen points, while the halves disagree."""
        seen = slice(0, self._seen_points)
        sent, blind = 2 * self.counts[seen], self.sums[:, seen].copy()
        while True:
            wanted = self._uncertain(sent)
            if not len(wanted):
                return
            for size in np.unique(sent[wanted]).tolist():
                some = wanted[sent[wanted] == size]
                points = self.grids.points.of(some)
                self.sums[:, some] += self.gather(points, some, some, size, size)[0]
                self.counts[some] += size // 2
                if size == 2 * self._first:
                    # The first rays had no guide, and add more noise than they take.
                    self.sums[:, some] -= blind[:, some]
                    self.counts[some] -= self._first // 2
                sent[some] += size

    def _light(self) -> tuple[np.ndarray, np.ndarray]:
        """(S,) light at seen points, and half of what their halves differ by: its error; 0 at
        those that are not open."""
        seen = slice(0, self._seen_points)
        half = mean_colour(self.sums[:, seen]) / np.maximum(self.counts[seen], 1) * self.open
        return half.mean(0), (half[0] - half[1]) / 2

    def pooled(self, error: np.ndarray, near: np.ndarray | slice = slice(None)) -> np.ndarray:
        """(P,) expected squares of errors (P,) of points ``near`` seen ones, as means over points
        that share a table of the guide: one alone says little."""
        return _mean_of_table(error**2, self.guide.of[near])

    def _level(self, light: np.ndarray) -> np.ndarray:
        """(S,) what errors are shares of: light nearby, where it is more than a part of the mean.
        That of a point alone would let points stop that were lucky."""
        near = _mean_of_table(light, self.guide.of)
        return np.maximum(near, _DARK * light[self.open].mean()) if len(light) else light

    def _uncertain(self, sent: np.ndarray) -> np.ndarray:
        light, error = self._light()
        least = _SMOOTHED * self.options.error * self._level(light)
        of = self.guide.of
        # One more ray may have found the brightest light.
        unseen = (self.guide.brightest / np.maximum(np.bincount(of, sent), 1))[of]
        uncertain = self.pooled(error) + unseen**2 > least**2
        return np.flatnonzero(self.open & self.in_view & (sent < _MOST) & uncertain)

    def smoothed(self) -> np.ndarray:
        """(P, 3) light, averaged with that of neighbours on the surface as far as noise can be
        what they differ by; sets ``error``, what is expected at seen points."""
        light, error = self._light()
        # The halves' difference is averaged in the same way: what stays of it is the error.
        every = self.mean()
        values = np.column_stack([every[: len(light)].astype(np.float64), error])
        a, b = self._edges()
        degree = np.bincount(a, minlength=len(light)) + np.bincount(b, minlength=len(light))
        most = 1 + np.maximum(degree[a], degree[b])
        noise = self.pooled(error)
        for _ in range(_STEPS):
            level = values[:, :3].mean(1)
            off = (level[a] - level[b]) ** 2
            # As much from a to b as from b to a: the sum of all light stays.
            share = np.maximum(1 - off / (_CUT * (noise[a] + noise[b]) + 1e-30), 0) / most
            keep = 1 - np.bincount(a, share, len(light)) - np.bincount(b, share, len(light))
            mixed = keep[:, None] * values
            for column in range(4):
                mixed[:, column] += np.bincount(a, share * values[b, column], len(light))
                mixed[:, column] += np.bincount(b, share * values[a, column], len(light))
            values, noise = mixed, self.pooled(mixed[:, 3])
        square = (noise / np.maximum(self._level(light), 1e-30) ** 2)[self.open & self.in_view]
        self.error = float(math.sqrt(square.mean())) if len(square) else 0.0
        every[: len(light)] = values[:, :3]
        return every

    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of neighbouring points of seen faces, each once, whose normals are alike."""
        pairs = []
        faces = np.flatnonzero(self.seen)
        for side in np.unique(self.grids.sides[faces // 2]).tolist():
            some = faces[self.grids.sides[faces // 2] == side]
            index = self.grids.index[
                self.grids.first[some][:, None] + np.arange(len(lattice(side)))
            ]
            for step in ((1, 0), (0, 1), (-1, 1)):
                to = lattice(side) + step
                inside = (to >= 0).all(1) & (to.sum(1) <= side)
                ends = grid_point(to[inside, 0], to[inside, 1], np.int64(side))
                pairs.append(np.stack([index[:, inside], index[:, ends]], -1).reshape(-1, 2))
        pair = np.concatenate(pairs) if pairs else np.zeros((0, 2), np.int64)
        pair.sort(axis=1)
        pair = np.unique(pair[:, 0] * len(self.counts) + pair[:, 1])
        a, b = np.divmod(pair, len(self.counts))
        normals = self.grids.points.normals
        alike = (normals[a] * normals[b]).sum(1) > _LIKE_NORMALS
        return a[alike], b[alike]


def _mean_of_table(values: np.ndarray, of: np.ndarray) -> np.ndarray:
    """(P,) mean of values (P,) over the points of the same table, ``of`` (P,)."""
    return (np.bincount(of, values) / np.maximum(np.bincount(of), 1))[of]


def _batches(points: slice, count: int) -> list[slice]:
    step = max(1, BATCH // count)
    return [slice(k, min(k + step, points.stop)) for k in range(points.start, points.stop, step)]
