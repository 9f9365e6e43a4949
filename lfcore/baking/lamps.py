"""Rays to lamps: surfaces that emit more than is around.

Rays to all sides seldom hit a small lamp.  Rays to points of the lamps find it.  A ray of either
kind counts its radiance times a weight, the balance heuristic of E. Veach, "Robust Monte Carlo
Methods for Light Transport Simulation", 1997: the density of rays to all sides in its direction
over the sum of both densities.  So all light counts once, whatever the lamps' shares are.

Where light is counted: emission and sky here, for every point that is baked.  Points, suns and
spots, among them those that stand for a pbrt file's emitters, are shaded by the kernels;
:meth:`Surroundings.direct` adds what they give to bounces, and their emitters are no lamps here.
"""

import math

import numpy as np

from lfcore.baking.points import Points, dot
from lfcore.baking.rays import Surroundings, directions, samples

_OFTEN, _SELDOM, _MAIN = 2, 4, 0.25
"""A ray to lamps for every so many rays to all sides: where lamps give this share of the light,
and elsewhere."""
_TESTS, _RAYS, _PLACES = 1 << 12, 4, 16
_BRIGHT = 2.0
"""Emission above so many times the mean light on points is a lamp's."""
_OTHER = np.uint64(0x6A09E667F3BCC909)


class Lamps:
    """What rays from points see, with rays to the lamps of their surroundings; ``points`` are
    examples."""

    def __init__(self, around: Surroundings, points: Points):
        self.around = around
        scene = around.scene
        corners = scene.triangles.astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        double = np.sqrt(dot(normals, normals))
        self._area = double / 2
        self._unit = (normals / np.maximum(double, 1e-300)[:, None]).astype(np.float32)
        self.density = np.zeros(2 * scene.triangle_count, np.float32)
        emitted = _emitted(around)
        level, of_glow = self._level(points)
        self._apart = _OFTEN if of_glow > _MAIN * level else _SELDOM
        self.share = math.pi / self._apart
        emitted[emitted <= _BRIGHT * level] = 0
        power = np.repeat(emitted * self._area, 2)
        self._faces = np.flatnonzero(power > 0)
        if len(self._faces):
            self._set(power[self._faces])
            self._set(power[self._faces] * self._use())

    def _level(self, points: Points) -> tuple[float, float]:
        """The mean light on points: of sky, emission and the scene's lights, and of emission."""
        some = points.of(slice(None, None, len(points) // _TESTS + 1))
        if not len(some) or not self.around.emits.any():
            return 0.0, 0.0
        towards = directions(some, *samples(np.arange(len(some)), 0, _RAYS))
        faces, weights, _ = self.around.hits(some, towards)
        light = self.around.glow(faces, weights, towards.reshape(-1, 3)).mean(1) / _RAYS
        direct = self.around.direct(some).mean(1)
        parts = light, np.where(faces < 0, 0, light), direct
        every, of_glow, lights = (float(np.cumsum(of, dtype=np.float64)[-1]) for of in parts)
        return (every + lights) / len(some), of_glow / len(some)

    def _set(self, share: np.ndarray) -> None:
        """Spread rays over the faces by their ``share``."""
        self._ends = np.cumsum(share)
        self.density[self._faces] = share / self._ends[-1] / self._area[self._faces // 2]
        self._ends /= self._ends[-1]

    def _use(self) -> np.ndarray:
        """(F,) the share of rays from each face that hit surfaces that are no lamps."""
        a, b = samples(np.zeros(1, np.uint64), 0, _TESTS)
        which, places = self._on_faces(a[0], b[0])
        faces = self._faces[which]
        up = self.around.flat_of(faces)
        points = Points(places.astype(np.float32), up, up, np.zeros(_TESTS))
        hit = self.around.hits(points, directions(points, *samples(np.arange(_TESTS), 0, 1)))[0]
        useful = (hit >= 0) & ~np.isin(hit // 2, self._faces // 2)
        tried = np.bincount(which, minlength=len(self._faces))
        share = np.bincount(which, useful, len(self._faces)) / np.maximum(tried, 1)
        return np.where(tried < _RAYS, 1.0, share)

    def _on_faces(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of lamps' faces and places (R, 3) on them, of pairs of samples (R,)."""
        which = np.minimum(np.searchsorted(self._ends, a, "right"), len(self._ends) - 1)
        before = np.where(which > 0, self._ends[which - 1], 0)
        within = np.clip((a - before) / (self._ends[which] - before), 0, 1)
        root = np.sqrt(within)
        weights = np.stack([1 - root, root * (1 - b), root * b], -1)
        corners = self.around.scene.triangles[self._faces[which] // 2]
        return which, sum(weights[:, k, None] * corners[:, k] for k in range(3))

    def aimed(self, points: Points, seeds: np.ndarray, first: int, count: int) -> np.ndarray:
        """(2, P, 3) sums of halves of the light of rays to lamps that counts, a ray for each
        ``_apart`` samples."""
        number, each = len(points), count // self._apart
        if not len(self._faces):
            return np.zeros((2, number, 3), np.float32)
        some = samples(seeds.astype(np.uint64) ^ _OTHER, first // self._apart, each)
        of = np.repeat(np.arange(number), each)
        which, places = self._on_faces(*(of_points.ravel() for of_points in some))
        towards = places - points.places[of]
        towards = (towards / np.sqrt(dot(towards, towards))[:, None]).astype(np.float32)
        sent = np.flatnonzero(_cosines(points, of, towards) > 0)
        of, towards = of[sent], towards[sent]
        starts = self.around.starts(points, of, towards)
        faces, weights, distance = self.around.cast(starts, towards)
        found = np.flatnonzero(faces == self._faces[which[sent]])
        hit, of, towards = faces[found], of[found], towards[found]
        seen = self.around.glow(hit, weights[found], towards)
        slant = np.maximum(abs(dot(self._unit[hit // 2], towards)), 1e-9)
        density = self.share * self.density[hit] * distance[found] ** 2 / slant
        cosine = _cosines(points, of, towards)
        seen *= (cosine / (cosine + density))[:, None]
        at = of + number * (2 * (sent[found] % each) >= each)
        sums = [np.bincount(at, column, 2 * number) for column in seen.T]
        return np.stack(sums, -1).reshape(2, number, 3).astype(np.float32)


def _cosines(points: Points, of: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """pi times the density of :func:`directions` of points ``of``."""
    return np.maximum(dot(points.normals[of], towards), 0)


def _emitted(around: Surroundings) -> np.ndarray:
    """(T,) the mean radiance that triangles emit."""
    mean = np.zeros(around.scene.triangle_count)
    which = np.flatnonzero(around.emits)
    a, b = (of[0] for of in samples(np.zeros(1, np.uint64), 0, _PLACES))
    root = np.sqrt(a)
    for weights in np.stack([1 - root, root * (1 - b), root * b], -1).astype(np.float32):
        every = np.tile(weights, (len(which), 1))
        mean[which] += around.glow(2 * which, every, every).mean(-1) / _PLACES
    return mean
