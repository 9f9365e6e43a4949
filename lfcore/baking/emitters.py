"""Emitter sampling: rays to surfaces that emit more than their surroundings.

Cosine-weighted rays seldom hit a small emitter; rays to points on emitters find it.  Both kinds are
combined by the balance heuristic of E. Veach, "Robust Monte Carlo Methods for Light Transport
Simulation", 1997: the radiance of a ray is weighted by the density of cosine-weighted rays in its
direction over the sum of both densities.  The estimate is unbiased for any densities.

This package counts emission and sky, for every point.  Points, suns and spots, among them those of
a pbrt file's emitters, are shaded by the tracer's kernels; :meth:`Surroundings.of_lights` adds
their light to bounces, and their triangles are no emitters here.
"""

import math

import numpy as np

from lfcore.baking.mesh_colours import Points
from lfcore.baking.sampling import directions, samples
from lfcore.baking.surroundings import Surroundings
from lfcore.scene.arrays import dot

_MAIN_SHARE = 0.25
"""Emitters are the main light if they give this share of it."""
_OFTEN = 2
"""Cosine-weighted rays per ray to emitters, where emitters are the main light."""
_SELDOM = 4
"""Cosine-weighted rays per ray to emitters, elsewhere."""
_TESTS = 1 << 12
"""The number of points, or of samples on emitters, from which averages are estimated."""
_TEST_RAYS = 4
"""Rays per tested point; also the least number of samples of a face for an average."""
_PLACES = 16
"""Places on a triangle over which its emission is averaged."""
_BRIGHT = 2.0
"""A triangle is an emitter if it emits this many times the mean light on points."""
_SEED = np.uint64(0x6A09E667F3BCC909)
"""Makes the samples on emitters independent of those of the hemisphere: digits of 2^0.5."""


class Emitters:
    """Emitters of the surroundings; ``points`` are examples of points that see them.

    Attributes
    ----------
    density : (2 T,) float32, of faces: samples on emitters per area, 1/m^2.
    share : pi times the number of rays to emitters per cosine-weighted ray.
    """

    def __init__(self, around: Surroundings, points: Points):
        self.around, scene = around, around.scene
        self.density = np.zeros(2 * scene.triangle_count, np.float32)
        self._faces = np.zeros(0, np.int64)
        level, of_emitters = self._mean_light(points)
        self._interval = _OFTEN if of_emitters > _MAIN_SHARE * level else _SELDOM
        self.share = math.pi / self._interval
        if not around.emits.any():
            return
        corners = scene.triangles.astype(np.float64)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        double = np.sqrt(dot(normals, normals))
        self._area = double / 2
        self._unit = (normals / np.maximum(double, 1e-300)[:, None]).astype(np.float32)
        emission = _mean_emission(around)
        emission[emission <= _BRIGHT * level] = 0
        power = np.repeat(emission * self._area, 2)
        self._faces = np.flatnonzero(power > 0)
        if len(self._faces):
            self._set_densities(power[self._faces])
            useful = power[self._faces] * self._useful_share()
            if useful.any():  # else emitters light nothing but emitters
                self._set_densities(useful)

    def _mean_light(self, points: Points) -> tuple[float, float]:
        """Return the mean light on points, of sky, emission and the scene's lights, and that of
        emission alone."""
        tested = points.take(slice(None, None, len(points) // _TESTS + 1))
        if not len(tested) or not self.around.emits.any():
            return 0.0, 0.0
        towards = directions(tested, *samples(np.arange(len(tested)), 0, _TEST_RAYS))
        faces, weights, _ = self.around.hits(tested, towards)
        light = self.around.emitted(faces, weights, towards.reshape(-1, 3)).mean(1) / _TEST_RAYS
        of_lights = self.around.of_lights(tested).mean(1)
        parts = light, np.where(faces < 0, 0, light), of_lights
        total, of_emitters, lights = (
            float(np.cumsum(part, dtype=np.float64)[-1]) for part in parts
        )
        return (total + lights) / len(tested), of_emitters / len(tested)

    def _set_densities(self, power: np.ndarray) -> None:
        """Distribute samples over the faces in proportion to ``power`` (F,)."""
        self._ends = np.cumsum(power)
        self.density[self._faces] = power / self._ends[-1] / self._area[self._faces // 2]
        self._ends /= self._ends[-1]

    def _useful_share(self) -> np.ndarray:
        """Return the share (F,) of rays from each face that hit surfaces that do not emit."""
        a, b = samples(np.zeros(1, np.uint64), 0, _TESTS)
        which, places = self._on_faces(a[0], b[0])
        faces = self._faces[which]
        up = self.around.flat_of(faces)
        points = Points(places.astype(np.float32), up, up, np.zeros(_TESTS))
        towards = directions(points, *samples(np.arange(_TESTS), 0, 1))
        hit = self.around.hits(points, towards).faces
        useful = (hit >= 0) & ~np.isin(hit // 2, self._faces // 2)
        tests = np.bincount(which, minlength=len(self._faces))
        share = np.bincount(which, useful, len(self._faces)) / np.maximum(tests, 1)
        return np.where(tests < _TEST_RAYS, 1.0, share)

    def _on_faces(self, a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return, for pairs of samples (R,), numbers of emitters' faces and places (R, 3) there."""
        which = np.minimum(np.searchsorted(self._ends, a, "right"), len(self._ends) - 1)
        before = np.where(which > 0, self._ends[which - 1], 0)
        within = np.clip((a - before) / (self._ends[which] - before), 0, 1)
        weights = _uniform_on_triangle(within, b)
        corners = self.around.scene.triangles[self._faces[which] // 2]
        return which, sum(weights[:, k, None] * corners[:, k] for k in range(3))

    def gather(self, points: Points, seeds: np.ndarray, first: int, count: int) -> np.ndarray:
        """Return the weighted light (2, P, 3) of rays to emitters: sums of both halves of the rays
        that go with ``count`` cosine-weighted rays from number ``first`` on."""
        number, each = len(points), count // self._interval
        if not len(self._faces):
            return np.zeros((2, number, 3), np.float32)
        pairs = samples(seeds.astype(np.uint64) ^ _SEED, first // self._interval, each)
        owners = np.repeat(np.arange(number), each)
        which, places = self._on_faces(*(coordinate.ravel() for coordinate in pairs))
        towards = places - points.places[owners]
        towards = (towards / np.sqrt(dot(towards, towards))[:, None]).astype(np.float32)
        sent = np.flatnonzero(_cosines(points, owners, towards) > 0)
        owners, towards = owners[sent], towards[sent]
        starts = self.around.starts(points, owners, towards)
        faces, weights, distance = self.around.cast(starts, towards)
        reached = np.flatnonzero(faces == self._faces[which[sent]])
        hit, owners, towards = faces[reached], owners[reached], towards[reached]
        light = self.around.emitted(hit, weights[reached], towards)
        slant = np.maximum(abs(dot(self._unit[hit // 2], towards)), 1e-9)
        density = self.share * self.density[hit] * distance[reached] ** 2 / slant
        cosine = _cosines(points, owners, towards)
        light *= (cosine / (cosine + density))[:, None]
        at = owners + number * (2 * (sent[reached] % each) >= each)
        sums = [np.bincount(at, column, 2 * number) for column in light.T]
        return np.stack(sums, -1).reshape(2, number, 3).astype(np.float32)


def _cosines(points: Points, owners: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """Return pi times the density of cosine-weighted rays from points ``owners`` (R,)."""
    return np.maximum(dot(points.normals[owners], towards), 0)


def _uniform_on_triangle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return barycentric weights (R, 3), uniform over a triangle, of samples (R,)."""
    root = np.sqrt(a)
    return np.stack([1 - root, root * (1 - b), root * b], -1)


def _mean_emission(around: Surroundings) -> np.ndarray:
    """Return the mean radiance (T,) that triangles emit."""
    mean = np.zeros(around.scene.triangle_count)
    which = np.flatnonzero(around.emits)
    a, b = (coordinate[0] for coordinate in samples(np.zeros(1, np.uint64), 0, _PLACES))
    for weights in _uniform_on_triangle(a, b).astype(np.float32):
        repeated = np.tile(weights, (len(which), 1))
        light = around.emitted(2 * which, repeated, -around.unit[which].astype(np.float32))
        mean[which] += light.mean(-1) / _PLACES
    return mean
