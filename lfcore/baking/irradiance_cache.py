"""The irradiance cache: points on surfaces, the rays that estimate their light, and bounces.

Source: G. Ward, F. Rubinstein and R. Clear, "A Ray Tracing Solution for Diffuse Interreflection",
SIGGRAPH 1988, for irradiance as the stored quantity.
"""

import numpy as np

from lfcore.baking.bounces import MOST_BOUNCES, Bounces
from lfcore.baking.emitters import Emitters
from lfcore.baking.gather import KEPT_HIT, Gatherer
from lfcore.baking.importance_guide import ImportanceGuide
from lfcore.baking.mesh_colours import Grids, Points
from lfcore.baking.surroundings import Surroundings, mean_colour
from lfcore.scene.baked import DARK, BakeOptions

_BATCH = 1 << 19
"""Rays per launch: their arrays stay in tens of MB."""
_MOST_RAYS = 1024
"""The largest number of rays per point."""
_FIRST_RAYS = 2**20
"""The first rays of all points together, from which the guide learns."""
_LEAST_FIRST_RAYS = 32
"""The least number of first rays per point."""
_RAYS_OF_HIDDEN = 16
"""Rays of a point that the camera does not see: its error averages out over many hits."""
_ROUNDS = 4
"""Rounds of rays.  Each round starts at points on the faces that the last round hit; faces that
are hit later use substitutes."""
_INSIDE = 0.9
"""The share of the way from the centre of a face to its corner that must be free."""
_TRIAL_BOUNCES = 2
"""Bounces beyond those that are required, from which the light that is cut off is estimated."""
_BEFORE_SMOOTHING = 3.0
"""The noise that rays may leave, as a multiple of the required error: averaging over neighbours
divides noise by about as much."""


class IrradianceCache:
    """Points, sums of their rays, and the light that surfaces reflect.

    The first points are the seen ones, S of them: points of faces that the camera sees.

    Parameters
    ----------
    grids : the grids of irradiance.
    direct_grids : finer grids for light of the scene's lights alone, whose edges are sharp.

    Attributes
    ----------
    seen : (2 T,) the mask of faces that the camera sees.
    sums : (2, P, 3) sums of two halves of the rays.
    counts : (P,) rays per half.
    is_open : (S,) the mask of seen points outside of objects and not covered.
    in_view : (S,) the mask of seen points in the camera's field.
    guide : the importance guide, after :meth:`bounce`.
    cut : the light of bounces that is missing, a share of all, after :meth:`bounce`.
    """

    def __init__(
        self, grids: Grids, direct_grids: Grids, around: Surroundings, options: BakeOptions
    ):
        self.grids, self.direct_grids = grids, direct_grids
        self.around, self.options = around, options
        self.sums = np.zeros((2, 0, 3), np.float32)
        self.counts, self.is_open = np.zeros(0, np.int64), np.zeros(0, bool)
        self._hits: list[tuple] = []

    def find_points(self, faces: np.ndarray, weights: np.ndarray) -> None:
        """Make points on the seen faces, and on faces that their rays hit.  The camera sees a face
        at barycentric ``weights`` (F, 3) in the mean."""
        self.seen = np.zeros(2 * self.grids.scene.triangle_count, bool)
        self.seen[faces] = True
        new = self.grids.add(faces)
        limit = self.options.fineness * min(_MOST_RAYS // 4, _FIRST_RAYS / max(new.stop, 1))
        count = max(_LEAST_FIRST_RAYS, int(limit) // 8 * 8)  # each half has whole emitter samples
        hidden = self.around.covered(self.grids.points)
        hidden &= ~self.grids.move(faces, weights, hidden)
        self.in_view = self.around.in_view(self.grids.points.places)
        self.gatherer = Gatherer(Emitters(self.around, self.grids.points), self.seen)
        room = self.options.mib * 2**20 // 2 // (KEPT_HIT.itemsize * max(new.stop, 1))
        count = min(count, max(8, room // 8 * 8))
        self._seen_points, self._first_rays = new.stop, count
        bounces = self.options.bounces
        rounds = _ROUNDS if bounces == "all" else min(_ROUNDS, bounces + 1)
        for turn in range(rounds):
            hit_faces = self._send_first_rays(new, count)
            if not turn:
                self.is_open &= ~hidden
                self.is_open |= not self.is_open.any()
                self.grids.substitute_points(~self.is_open)
            if turn + 1 == rounds or not len(hit_faces):
                break
            new, count = self.grids.add(hit_faces), min(count, _RAYS_OF_HIDDEN)
            self._pull_in(hit_faces, new.start)
        self._extend()
        self.grids.find_substitutes(self.around.unit)

    def _pull_in(self, faces: np.ndarray, first: int) -> None:
        """Move points from number ``first`` on to the centre of their face, if that has one cell
        and a surface cuts them off from the centre: beyond that surface is other light."""
        faces = faces[self.grids.sides[faces // 2] == 1]
        index = self.grids.index[self.grids.first[faces, None] + np.arange(3)].ravel()
        corners = self.grids.scene.triangles[faces // 2]
        centres = np.repeat(corners.mean(1), 3, axis=0)
        towards = corners.reshape(-1, 3) - centres
        flat = np.repeat(self.around.flat_of(faces), 3, axis=0)
        points = Points(centres, flat, flat, self.grids.points.cells[index])
        starts = self.around.starts(points, slice(None), towards)
        hit, _, distance = self.around.cast(starts, towards)
        cut_off = (hit >= 0) & (distance < _INSIDE) & (index >= first)
        self.grids.points.places[index[cut_off]] = centres[cut_off]

    def _extend(self) -> None:
        """Extend sums and counts to all points."""
        more = len(self.grids.points) - len(self.counts)
        self.counts = np.pad(self.counts, (0, more))
        self.sums = np.pad(self.sums, ((0, 0), (0, more), (0, 0)))

    def _send_first_rays(self, new: slice, count: int) -> np.ndarray:
        """Send rays from new points and keep their hits; returns hit faces that have no grid."""
        self._extend()
        hit, is_open = np.zeros(len(self.seen), bool), []
        for part in _batches(new, count):
            points, seeds = self.grids.points.take(part), np.arange(part.start, part.stop)
            sums, sees, hits = self.gatherer.send(points, seeds, 0, count, -1)
            self.sums[:, part] += sums
            self.counts[part] += count // 2
            self._hits.append((part, count, hits))
            is_open.append(sees)
            faces = hits["face"].reshape(-1, count)[sees]
            hit[faces[faces >= 0]] = True
        if not len(self.is_open):
            self.is_open = np.concatenate([self.is_open, *is_open])
        return np.flatnonzero(hit & (self.grids.first < 0))

    def mean(self) -> np.ndarray:
        """Return the irradiance over pi (P, 3) at points."""
        return self.sums.sum(0) / np.maximum(2 * self.counts, 1)[:, None]

    def bounce(self) -> None:
        """Let light go from surface to surface, and make the guide."""
        gridded = np.flatnonzero(self.grids.first >= 0)
        is_finer = (self.direct_grids.sides > self.grids.sides)[gridded // 2]
        self.direct_grids.add(gridded[is_finer])
        direct = np.concatenate(
            [self.around.of_lights(grids.points) for grids in (self.grids, self.direct_grids)]
        )
        self.gatherer.set_grids(self.grids, self.direct_grids)
        del self.direct_grids  # frees memory: only its light is needed from here on
        self.cut = self._bounce(direct)
        parts = [part for part, *_ in self._hits]
        points = self.grids.points.take(slice(0, self._seen_points))
        first_rays = list(zip(parts, self._ray_light, strict=True))
        self.guide = ImportanceGuide(points, self._first_rays, first_rays)
        self.gatherer.set_guide(self.guide)
        self._hits = []

    def _bounce(self, direct: np.ndarray) -> float:
        """Add the light of bounces to ``sums``; returns the light that is missing, a share."""
        emitted, wanted, error = self.sums, self.options.bounces, self.options.error
        self._ray_light = [hits["emission"].view(np.float16) for *_, hits in self._hits]
        bounces = Bounces(self.mean(), self.is_open & self.in_view)

        def reflect(irradiance: np.ndarray) -> None:
            self.sums = emitted.copy()
            self.gatherer.set_light(irradiance, direct)
            for number, (part, count, hits) in enumerate(self._hits):
                points = part.stop - part.start
                sums, self._ray_light[number] = self.gatherer.reflect(points, count, hits)
                self.sums[:, part] += sums

        if wanted == "all":
            for _ in range(MOST_BOUNCES):
                reflect(bounces.irradiance)
                bounces.add(self.mean())
                if bounces.is_converged(error):
                    break
            reflect(bounces.limit)
            return bounces.missing_from(bounces.limit)
        for _ in range(wanted):
            last = bounces.irradiance
            reflect(last)
            bounces.add(self.mean())
        reached = bounces.irradiance
        for _ in range(_TRIAL_BOUNCES):
            reflect(bounces.irradiance)
            bounces.add(self.mean())
        if wanted:
            reflect(last)
        else:
            self.sums = emitted
            self.gatherer.set_light(np.zeros_like(reached), np.zeros_like(direct))
        return bounces.missing_from(reached)

    def gather(
        self, points: Points, near: np.ndarray, seeds: np.ndarray, first: int, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Send guided rays from points (P,) ``near`` seen ones (P,), from number ``first`` on.

        Returns sums (2, P, 3) of both halves, and the mask (P,) of points in the open.
        """
        sums, is_open = np.zeros((2, len(points), 3), np.float32), np.zeros(len(points), bool)
        for part in _batches(slice(0, len(points)), count):
            tables = self.guide.table[near[part]]
            sent = self.gatherer.send(points.take(part), seeds[part], first, count, tables)
            sums[:, part], is_open[part], _ = sent
        return sums, is_open

    def converge(self) -> None:
        """Send more rays from seen points, while their halves disagree."""
        seen = slice(0, self._seen_points)
        sent, unguided = 2 * self.counts[seen], self.sums[:, seen].copy()
        while True:
            uncertain = self._uncertain(sent)
            if not len(uncertain):
                return
            for size in np.unique(sent[uncertain]).tolist():
                which = uncertain[sent[uncertain] == size]
                points = self.grids.points.take(which)
                self.sums[:, which] += self.gather(points, which, which, size, size)[0]
                self.counts[which] += size // 2
                if size == 2 * self._first_rays:
                    # The first rays had no guide: they add more noise than they remove.
                    self.sums[:, which] -= unguided[:, which]
                    self.counts[which] -= self._first_rays // 2
                sent[which] += size

    def estimate(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the light (S,) at seen points, and half the difference of its halves, an estimate
        of its error; both are 0 at points that are not open."""
        seen = slice(0, self._seen_points)
        halves = mean_colour(self.sums[:, seen]) / np.maximum(self.counts[seen], 1) * self.is_open
        return halves.mean(0), (halves[0] - halves[1]) / 2

    def variance(self, error: np.ndarray, near: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the variance (P,) of errors (P,) of points ``near`` seen ones: the mean over
        points that share a table of the guide, since a single point says little."""
        return _mean_by_table(error**2, self.guide.table[near])

    def reference_level(self, light: np.ndarray) -> np.ndarray:
        """Return the light (S,) of which errors are shares: the mean nearby, or a part of the mean
        of all.  With a point's own light, points that were too dark by chance would stop early."""
        if not len(light):
            return light
        nearby = _mean_by_table(light, self.guide.table)
        return np.maximum(nearby, DARK * light[self.is_open].mean())

    def _uncertain(self, sent: np.ndarray) -> np.ndarray:
        """Return the seen points that need more than the rays ``sent`` (S,)."""
        light, error = self.estimate()
        limit = _BEFORE_SMOOTHING * self.options.error * self.reference_level(light)
        table = self.guide.table
        # One more ray might hit the brightest light.
        unseen = (self.guide.brightest / np.maximum(np.bincount(table, sent), 1))[table]
        uncertain = self.variance(error) + unseen**2 > limit**2
        return np.flatnonzero(self.is_open & self.in_view & (sent < _MOST_RAYS) & uncertain)


def _mean_by_table(values: np.ndarray, table: np.ndarray) -> np.ndarray:
    """Return the mean (P,) of values (P,) over all points with the same table (P,)."""
    return (np.bincount(table, values) / np.maximum(np.bincount(table), 1))[table]


def _batches(points: slice, count: int) -> list[slice]:
    """Split a range of points into parts that send about _BATCH rays."""
    step = max(1, _BATCH // count)
    return [slice(k, min(k + step, points.stop)) for k in range(points.start, points.stop, step)]
