"""Bake light: what surfaces get from the sky and, in bounces, from one another.

Rays gather light at points of the surfaces that the camera sees, and at those that these rays hit,
of which few are needed: each is averaged over many rays.  Bounces iterate over the stored hits.
More rays follow where two halves of them disagree, and more points where neighbours do.

Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010, for the storage;
G. Ward, F. Rubinstein and R. Clear, "A Ray Tracing Solution for Diffuse Interreflection", SIGGRAPH
1988, for irradiance as what is kept.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from lfcore.errors import SceneError
from lfcore.opencl.device import Device
from lfcore.progress import Progress
from lfcore.rendering.bake_points import Grids, Points, grid_point, lattice
from lfcore.rendering.bake_rays import BATCH, Surroundings, directions
from lfcore.rendering.bake_refinement import Refinement
from lfcore.scene.baked import NO_SKY, BakedLight, BakeOptions
from lfcore.scene.model import Scene
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.tracer import Tracer

CELLS = 64
"""Cells of grids over the width of the picture, to begin with."""
_FEWEST, _MOST = 32, 1024
"""Rays per point."""
_OF_HIDDEN = 16
_ROUNDS = 4
_LARGEST_SIDE = 256
_HIT_BYTES = 16
_SMOOTHED, _STEPS, _LIKE_NORMALS = 3.0, 8, 0.95
"""How much more noise rays may leave than is asked for; steps of averaging neighbours take it."""


def bake_light(
    scene: Scene,
    bvh: Bvh,
    device: Device,
    options: BakeOptions,
    *,
    progress: Progress | None = None,
) -> BakedLight:
    """The light of a scene's sky and bounces on all its surfaces.

    ``progress`` is called with (steps done, of all).  Raises :class:`SceneError` for a material
    that reflects more light than it gets.
    """
    _check_albedo(scene)
    bare = replace(scene, bake=None, light=None, sky=NO_SKY)
    around = Surroundings(scene, Tracer(bare, bvh, device))
    seen, distance = _seen_faces(scene, around)
    grids = Grids(scene, _sides(scene, distance))
    baker = Baker(grids, around, options)
    report = progress or (lambda done, of: None)
    for done, step in enumerate((lambda: baker.find(seen), baker.bounce, baker.converge)):
        step()
        report(done + 1, 4)
    refinement = Refinement(baker, seen)
    light = refinement.light()
    report(4, 4)
    return replace(light, error=baker.error, rays=around.rays)


def _check_albedo(scene: Scene) -> None:
    most = scene.colours.max(initial=0) if len(scene.colours) else 1.0
    for number in np.unique(scene.material_ids).tolist():
        material = scene.materials[number]
        if max(material.diffuse) * most > 1:
            raise SceneError(
                f"reflects {max(material.diffuse) * most:g} of its light", file=scene.name,
                key=f"material {material.name}: diffuse", remedy="Give at most 1",
            )  # fmt: skip


def _seen_faces(scene: Scene, around: Surroundings) -> tuple[np.ndarray, np.ndarray]:
    """Faces that the camera sees, within twice its field, and each triangle's least distance."""
    camera, count = scene.camera, 512
    axis = ((np.arange(count) + 0.5) / count - 0.5) * 2 * camera.field_width
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis))
    distance = np.full(scene.triangle_count, np.inf)
    faces = []
    lens = camera.lens_radius_m * np.array(
        [[0, 0], [0.7, 0.7], [-0.7, 0.7], [0.7, -0.7], [-0.7, -0.7]]
    )
    for number, at in enumerate(lens):
        some = slice(None) if not number else slice(number - 1, None, 4)
        towards = np.stack([x[some], y[some], np.ones_like(x[some])], -1).astype(np.float32)
        # Every lens point sees what is in focus in the same direction.
        origin = np.zeros_like(towards)
        origin[:, :2] = at
        if math.isfinite(camera.focus_m):
            towards[:, :2] -= np.float32(at / camera.focus_m)
        hit, _, far = around.cast(origin, towards)
        on = hit >= 0
        faces.append(np.unique(hit[on]))
        np.minimum.at(distance, hit[on] // 2, far[on])
    return np.unique(np.concatenate(faces)), distance


def _sides(scene: Scene, distance: np.ndarray) -> np.ndarray:
    """(T,) cells along an edge: a power of 2, as many as the picture needs to begin with."""
    corners = scene.triangles.astype(np.float64)
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    edge = np.sqrt(((corners - np.roll(corners, 1, axis=1)) ** 2).sum(-1)).max(1)
    seen = np.isfinite(distance)
    cell = np.where(seen, scene.camera.field_width * np.where(seen, distance, 0) / CELLS, np.inf)
    cell = np.clip(cell, size / 1024, size / 24)
    wanted = np.log2(np.maximum(edge / cell, 1))
    return np.minimum(1 << np.ceil(wanted - 0.25).astype(np.int64), _LARGEST_SIDE)


class Baker:
    """Points, the light that reaches them from surfaces nearby, and sums of their rays.

    Attributes
    ----------
    source : (P, 3) what the light at points, times their colour, sends on in the last bounce.
    sums : (2, P, 3) sums of two halves of the rays; ``counts`` (P,) rays of each half.
    """

    def __init__(self, grids: Grids, around: Surroundings, options: BakeOptions):
        self.grids, self.around, self.options = grids, around, options
        self.sums = np.zeros((2, 0, 3), np.float32)
        self.counts = np.zeros(0, np.int64)
        self.source, self.error = np.zeros((0, 3), np.float32), 0.0
        self._hits: list[tuple[slice, int, np.ndarray, np.ndarray, np.ndarray]] = []

    def find(self, seen: np.ndarray) -> None:
        """Gather at seen faces, and at those that rays from there hit."""
        self.seen = np.zeros(2 * self.grids.scene.triangle_count, bool)
        self.seen[seen] = True
        fresh, count = self.grids.add(seen), _FEWEST
        points = max(fresh.stop, 1)
        room = self.options.mib * 2**20 // 2 // (_HIT_BYTES * points)
        count = min(count, max(8, room // 2 * 2))
        self._seen_points = fresh.stop
        for _ in range(_ROUNDS):
            found = self._look(fresh, count)
            if not self.options.bounces or not len(found):
                break
            fresh, count = self.grids.add(found), min(count, _OF_HIDDEN)
        self._extend()
        self.grids.stand_in()

    def _extend(self) -> None:
        more = len(self.grids.points) - len(self.counts)
        self.counts = np.pad(self.counts, (0, more))
        self.sums = np.pad(self.sums, ((0, 0), (0, more), (0, 0)))

    def _look(self, fresh: slice, count: int) -> np.ndarray:
        """Send the first rays of fresh points and keep their hits; returns faces without grids."""
        self._extend()
        found = []
        for part in _batches(fresh, count):
            towards = directions(
                self.grids.points.of(part), np.arange(part.start, part.stop), 0, count
            )
            faces, weights = self.around.hits(self.grids.points.of(part), towards)
            glow = self.around.glow(faces, weights, towards.reshape(-1, 3))
            self._add(part, glow, count)
            if self.options.bounces:
                colour = self.around.albedo(faces, weights).astype(np.float16)
                hits = faces.astype(np.int32), weights.astype(np.float16), colour
                self._hits.append((part, count, *hits))
                found.append(np.unique(faces[faces >= 0]))
        every = np.unique(np.concatenate(found)) if found else np.zeros(0, np.int64)
        return every[self.grids.first[every] < 0]

    def _add(self, part: slice | np.ndarray, light: np.ndarray, count: int) -> None:
        self.sums[:, part] += _halves(light, count)
        self.counts[part] += count // 2

    def mean(self) -> np.ndarray:
        """(P, 3) light at the points."""
        return self.sums.sum(0) / np.maximum(2 * self.counts, 1)[:, None]

    def bounce(self) -> None:
        """Let light go from surface to surface."""
        direct = self.around.direct(self.grids.points)
        glow, self.source = self.sums.copy(), direct
        hits = [
            (part, count, self.grids.nearest(np.maximum(faces, 0), weights), colour)
            for part, count, faces, weights, colour in self._hits
        ]
        self._hits = []
        for _ in range(self.options.bounces):
            self.source = direct + self.mean()
            self.sums = glow.copy()
            for part, count, points, colour in hits:
                self.sums[:, part] += _halves(self.source[points] * colour, count)
        if not self.options.bounces:
            self.source = np.zeros_like(direct)

    def gather(self, points: Points, seeds: np.ndarray, first: int, count: int) -> np.ndarray:
        """(2, P, 3) sums of halves of rays from ``first`` on."""
        made = np.zeros((2, len(points), 3), np.float32)
        for part in _batches(slice(0, len(points)), count):
            some = points.of(part)
            towards = directions(some, seeds[part], first, count)
            faces, weights = self.around.hits(some, towards)
            light = self.around.glow(faces, weights, towards.reshape(-1, 3))
            if self.options.bounces:
                on = np.flatnonzero(faces >= 0)
                colour = self.around.albedo(faces[on], weights[on])
                light[on] += self.source[self.grids.nearest(faces[on], weights[on])] * colour
            made[:, part] = _halves(light, count)
        return made

    def converge(self) -> None:
        """Send more rays from seen points, while the halves disagree."""
        while True:
            wanted = self._uncertain()
            if not len(wanted):
                return
            count = 2 * self.counts[wanted]
            for size in np.unique(count).tolist():
                some = wanted[count == size]
                self.sums[:, some] += self.gather(self.grids.points.of(some), some, size, size)
                self.counts[some] += size // 2

    def _squares(self) -> tuple[np.ndarray, np.ndarray]:
        """(P,) expected squared error over a square of the light, each pooled over faces that
        points share, since two halves alone say little; and the light."""
        half = self.sums.mean(-1) / np.maximum(self.counts, 1)
        light = half.mean(0)
        square = (half[0] - half[1]) ** 2 / 4
        total, weight = np.zeros(len(light)), np.zeros(len(light))
        for side in np.unique(self.grids.sides[np.flatnonzero(self.seen) // 2]).tolist():
            faces = np.flatnonzero(self.seen)
            faces = faces[self.grids.sides[faces // 2] == side]
            number = len(lattice(side))
            index = self.grids.index[self.grids.first[faces][:, None] + np.arange(number)]
            pooled = np.repeat(square[index].mean(1), number)
            total += np.bincount(index.ravel(), pooled, len(light))
            weight += np.bincount(index.ravel(), minlength=len(light))
        return total / np.maximum(weight, 1), light

    def _uncertain(self) -> np.ndarray:
        square, light = self._squares()
        seen = np.arange(len(light)) < self._seen_points
        mean = light[seen].mean() if seen.any() else 0.0
        least = _SMOOTHED * self.options.error * np.maximum(light, 0.25 * mean)
        return np.flatnonzero(seen & (square > least**2) & (2 * self.counts < _MOST))

    def smoothed(self) -> np.ndarray:
        """(P, 3) light, averaged with that of neighbours on the surface as far as noise can be
        what they differ by; sets ``error``, expected at seen points over their mean."""
        square, light = self._squares()
        values, weight = self.mean().astype(np.float64), np.ones(len(light))
        a, b = self._edges()
        noise = square.copy()
        for _ in range(_STEPS):
            level = values.mean(1)
            off = (level[a] - level[b]) ** 2
            share = np.maximum(1 - off / (9 * (noise[a] + noise[b]) + 1e-30), 0) / 6
            sums = np.bincount(a, share, len(light)) + np.bincount(b, share, len(light))
            keep = np.maximum(1 - sums, 0.25)
            total = keep + sums
            mixed = keep[:, None] * values
            for channel in range(3):
                mixed[:, channel] += np.bincount(a, share * values[b, channel], len(light))
                mixed[:, channel] += np.bincount(b, share * values[a, channel], len(light))
            values = mixed / total[:, None]
            of_others = np.bincount(a, share**2 * weight[b], len(light))
            of_others += np.bincount(b, share**2 * weight[a], len(light))
            weight = (keep**2 * weight + of_others) / total**2
            noise = square * weight
        seen = slice(0, self._seen_points)
        mean = light[seen].mean() if self._seen_points else 0.0
        self.error = float(math.sqrt(noise[seen].mean()) / mean) if mean > 0 else 0.0
        return values.astype(np.float32)

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


def _halves(light: np.ndarray, count: int) -> np.ndarray:
    """(2, P, 3) sums of the first and the second half of each point's rays: both spread evenly."""
    return light.reshape(-1, 2, count // 2, 3).sum(2).swapaxes(0, 1)


def _batches(points: slice, count: int) -> list[slice]:
    step = max(1, BATCH // count)
    return [slice(k, min(k + step, points.stop)) for k in range(points.start, points.stop, step)]
