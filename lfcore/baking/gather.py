"""Rays that gather light at points, and what they bring, on the device: kernels beside the
tracer's: arrays of the host took two thirds of a bake's time."""

from typing import Any

import numpy as np

from lfcore.baking.importance_guide import SIDE, Guide
from lfcore.baking.lamps import Lamps
from lfcore.baking.points import Grids, Points, lattice
from lfcore.baking.rays import ALONG, R2, TURNS, circle, shifts
from lfcore.opencl.device import build_program, cl, page_aligned
from lfcore.tracing.header import header
from lfcore.tracing.layouts import FLOAT, INT, UINT

POINT = np.dtype([("place", FLOAT, 3), ("normal", FLOAT, 3), ("flat", FLOAT, 3), ("lift", FLOAT),
                  ("shift", UINT, 2), ("table", INT)])  # fmt: skip
FACE = np.dtype([("first", INT), ("side", INT), ("density", FLOAT), ("emits", np.uint16),
                 ("is_seen", np.uint16)])  # fmt: skip
MATT = np.dtype([("diffuse", FLOAT, 3), ("emission", FLOAT, 3), ("base", FLOAT), ("texture", INT),
                 ("glow_texture", INT)])  # fmt: skip
FILE = "baking/kernels/gather.cl"
TEXTURE = np.dtype([("first", INT), ("width", INT), ("height", INT)])


class Gatherer:
    """Sends rays from points; ``seen`` (2 T,): faces that open points see."""

    def __init__(self, lamps: Lamps, seen: np.ndarray):
        self.lamps, self.around = lamps, lamps.around
        scene, self.device = self.around.scene, self.around.tracer.device
        self._faces = np.zeros(len(seen), FACE)
        self._faces["is_seen"], self._faces["density"] = seen, lamps.density
        self._faces["emits"] = np.repeat(self.around.emits, 2)
        records = {"Point": POINT, "Face": FACE, "Matt": MATT, "Texture": TEXTURE}
        values = {"GUIDE_SIDE": SIDE, "TURNS": TURNS, "ALONG": f"{ALONG:g}f",
                  "R2_A": f"{R2[0]}u", "R2_B": f"{R2[1]}u",
                  "TINTED": len(scene.colours) > 0}  # fmt: skip
        source = build_program(self.device, [FILE], values, header(**records))
        names = "aim", "shade", "reflect"
        self._aim, self._shade, self._reflect = (cl.Kernel(source, name) for name in names)
        self._circle = self.device.buffer(np.ascontiguousarray(circle().T))
        sky, small, has_uvs = self.around.sky, self.around.small, len(scene.uvs) > 0
        firsts = np.cumsum([0, *(t.size // 3 for t in small)]).tolist()
        textures = [(first, *t.shape[1::-1]) for first, t in zip(firsts, small, strict=False)]
        parts = self.around.diffuse, self.around.emission, self.around.base, scene.materials
        materials = [(*of, m.texture, m.emission_texture) if has_uvs else (*of, -1, -1)
                     for *of, m in zip(*parts, strict=True)]  # fmt: skip
        arrays: list = [
            self.around.unit, np.array(materials, MATT), np.int32(scene.material_ids), scene.uvs,
            scene.colours, np.array(textures, TEXTURE),
            np.concatenate([t.ravel() for t in small] or [np.zeros(1)]),
            np.zeros(1) if sky is None else sky,
        ]  # fmt: skip
        numbers = np.int32(0 if sky is None else len(sky)), np.float32(lamps.share)
        self._surfaces = [*map(self._copy, arrays), *numbers]
        self._light: list = [self._copy(self._faces), None, None]
        self._tables = [self._copy(np.zeros(1))] * 3

    def _copy(self, array: np.ndarray) -> cl.Buffer:
        """On the device, of float32 where it is of float64."""
        is_wide = array.dtype == np.float64
        return self.device.buffer(np.ascontiguousarray(array, np.float32 if is_wide else None))

    def surfaces(self, grids: Grids, fine: Grids) -> None:
        """Find where faces' grids have their light: points of ``fine`` grids behind the others."""
        count, length = len(grids.points), len(grids.index)
        self._near = np.arange(count + len(fine.points))
        refined = np.flatnonzero(fine.first >= 0)
        for side in np.unique(fine.sides[refined // 2]).tolist():
            faces, at = refined[fine.sides[refined // 2] == side], lattice(side)
            weights = np.tile(np.column_stack([side - at.sum(1), at]) / side, (len(faces), 1))
            index = fine.index[fine.first[faces, None] + np.arange(len(at))].ravel()
            self._near[count + index] = grids.nearest(np.repeat(faces, len(at)), weights)
        alone = length + len(fine.index) + np.arange(len(grids.first))
        coarse = np.where(grids.first >= 0, grids.first, alone)
        side = np.where(grids.first >= 0, np.repeat(grids.sides, 2), 0)
        self._faces["first"] = np.where(fine.first >= 0, length + fine.first, coarse)
        self._faces["side"] = np.where(fine.first >= 0, np.repeat(fine.sides, 2), side)
        index = np.concatenate([grids.index, count + fine.index, grids.instead])
        self._light[:2] = [self._copy(self._faces), self._copy(index.astype(np.int32))]

    def light(self, source: np.ndarray, direct: np.ndarray) -> None:
        """Let points send on the light ``source`` of points of coarse grids, and ``direct``."""
        self._light[2] = None  # makes room
        sent = source.astype(np.float32)[self._near]
        self._light[2] = self._copy(np.add(sent, direct, out=sent))

    def reflect(self, number: int, count: int, hits: tuple) -> list[np.ndarray]:
        """(2, P, 3) sums of halves of what surfaces send to ``count`` rays each, of which
        :meth:`send` found the ``hits``; and (R,) all light of each ray."""
        made = [page_aligned((2, number, 3)), page_aligned((number * count,))]
        shown = map(self.device.shown, hits)
        self._launch(self._reflect, number, count, *shown, *self._light, made)
        return made

    def _launch(self, kernel: cl.Kernel, number: int, count: int, *rest: Any) -> list[cl.Buffer]:
        """Fill the arrays that are the last of the kernel's arguments; returns them there."""
        *arguments, made = rest
        targets = [self.device.target_buffer(array) for array in made]
        workers, numbers = min(self.device.threads, number), np.array([number, count], np.int32)
        kernel(self.device.queue, (workers,), (1,), *numbers, *arguments, *targets)
        for target, array in zip(targets, made, strict=True):
            self.device.collect(target, array)
        return targets

    def guided(self, guide: Guide) -> None:
        self._tables = [self._copy(array) for array in guide.limits]

    def send(
        self, points: Points, seeds: np.ndarray, first: int, count: int, tables: np.ndarray | int
    ) -> tuple[np.ndarray, np.ndarray, tuple]:
        """Send rays from number ``first`` on, as the guide's ``tables`` (P,) want them; -1: none.

        Returns (2, P, 3) sums of halves of them; (P,) whether one of them hit the sky or seen
        faces: points inside of things have none; and of each ray, its own light, the face that it
        hits, -1 none, weights there, and the shares that it reflects.
        """
        number, rays = len(points), len(points) * count
        records = np.zeros(number, POINT)
        records["place"], records["normal"] = points.places, points.normals
        records["flat"], records["lift"] = points.flat, self.around.lifts(points)
        records["shift"], records["table"] = shifts(seeds), tables
        of = self._copy(records)
        made = [page_aligned(shape) for shape in ((rays, 3), (rays, 3), (rays,))]
        guide = np.uint32(first), *self._tables, self._circle
        _, *sent = self._launch(self._aim, number, count, of, *guide, made)
        found = self.around.tracer.closest_hit(*made[:2])
        self.around.rays += rays
        sums, is_open = page_aligned((2, number, 3)), page_aligned((number,), np.uint8)
        kinds = (np.float16,), (np.int32,), (np.float16, 3), (np.float16, 3)
        hits = tuple(page_aligned((rays, *size), kind) for kind, *size in kinds)
        surfaces = *map(self.device.shown, found), *self._surfaces, *self._light
        self._launch(self._shade, number, count, of, *sent, *surfaces, [sums, is_open, *hits])
        return sums + self.lamps.aimed(points, seeds, first, count), is_open.astype(bool), hits
