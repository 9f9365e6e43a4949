"""Gathering on the device: rays from points, and the light that they bring.

Kernels do this beside the tracer's: with arrays of the host it took two thirds of a bake's time.
"""

from typing import Any

import numpy as np

from lfcore.baking.emitters import Emitters
from lfcore.baking.importance_guide import SIDE, ImportanceGuide
from lfcore.baking.mesh_colours import Grids, Points, lattice, lattice_weights
from lfcore.baking.sampling import R2, TURNS, circle, shifts
from lfcore.baking.surroundings import ALONG_SURFACE
from lfcore.opencl.device import build_program, cl, page_aligned
from lfcore.opencl.interface import FLOAT, INT, SHARED, UINT, Interface

POINT = np.dtype([("place", FLOAT, 3), ("normal", FLOAT, 3), ("flat", FLOAT, 3), ("lift", FLOAT),
                  ("shift", UINT, 2), ("table", INT)])  # fmt: skip
"""A point: a start of rays is ``lift`` metres off the triangle; ``shift`` of its sequence."""
FACE = np.dtype([("first", INT), ("side", INT), ("density", FLOAT), ("emits", np.uint16),
                 ("is_seen", np.uint16)])  # fmt: skip
"""A face: where its grid begins and cells along an edge; emitter samples per area."""
MATT = np.dtype([("diffuse", FLOAT, 3), ("emission", FLOAT, 3), ("base", FLOAT), ("texture", INT),
                 ("emission_texture", INT)])  # fmt: skip
"""A material, as far as it reflects and emits in all directions; -1 without a texture."""
TEXTURE = np.dtype([("first", INT), ("width", INT), ("height", INT)])
"""A texture: its first texel, and its size in texels."""
INTERFACE = SHARED | Interface(
    records={"Point": POINT, "Face": FACE, "Matt": MATT, "Texture": TEXTURE}
)
"""What the kernels share with the host."""
FILE = "baking/kernels/gather.cl"


class Gatherer:
    """Sends rays from points; ``seen`` (2 T,) is the mask of faces that points in the open see."""

    def __init__(self, emitters: Emitters, seen: np.ndarray):
        self.emitters, self.around = emitters, emitters.around
        self.device = self.around.tracer.device
        self._faces = np.zeros(len(seen), FACE)
        self._faces["is_seen"], self._faces["density"] = seen, emitters.density
        self._faces["emits"] = np.repeat(self.around.emits, 2)
        values = {"GUIDE_SIDE": SIDE, "TURNS": TURNS, "ALONG_SURFACE": f"{ALONG_SURFACE:g}f",
                  "R2_A": f"{R2[0]}u", "R2_B": f"{R2[1]}u",
                  "TINTED": len(self.around.scene.colours) > 0}  # fmt: skip
        program = build_program(self.device, [FILE], values, INTERFACE)
        names = "aim", "shade", "reflect"
        self._aim, self._shade, self._reflect = (cl.Kernel(program, name) for name in names)
        self._circle = self.device.buffer(np.ascontiguousarray(circle().T))
        self._surfaces = self._copy_surfaces()
        self._light: list = [self._copy(self._faces), None, None]
        self._tables = [self._copy(np.zeros(1))] * 3

    def _copy_surfaces(self) -> list:
        """Return the arguments of the kernel that describe surfaces and sky."""
        around, scene = self.around, self.around.scene
        small, has_uvs = around.small, len(scene.uvs) > 0
        firsts = np.cumsum([0, *(t.size // 3 for t in small)]).tolist()
        textures = [(first, *t.shape[1::-1]) for first, t in zip(firsts, small, strict=False)]
        parts = around.diffuse, around.emission, around.base, scene.every_material
        materials = [
            (*values, m.texture, m.emission_texture) if has_uvs else (*values, -1, -1)
            for *values, m in zip(*parts, strict=True)
        ]
        arrays: list = [
            around.unit, np.array(materials, MATT), np.int32(scene.material_ids), scene.uvs,
            scene.colours, np.array(textures, TEXTURE),
            np.concatenate([t.ravel() for t in small] or [np.zeros(1)]),
            np.zeros(1) if around.sky is None else around.sky,
        ]  # fmt: skip
        sky_side = np.int32(0 if around.sky is None else len(around.sky))
        return [*map(self._copy, arrays), sky_side, np.float32(self.emitters.share)]

    def _copy(self, array: np.ndarray) -> cl.Buffer:
        """Return a copy on the device; float64 becomes float32."""
        is_wide = array.dtype == np.float64
        return self.device.buffer(np.ascontiguousarray(array, np.float32 if is_wide else None))

    def set_grids(self, grids: Grids, direct_grids: Grids) -> None:
        """Set where the light of faces is: at points of ``direct_grids``, which are numbered after
        those of ``grids``, where a face has such a grid."""
        count, length = len(grids.points), len(grids.index)
        self._near = np.arange(count + len(direct_grids.points))
        refined = np.flatnonzero(direct_grids.first >= 0)
        for side in np.unique(direct_grids.sides[refined // 2]).tolist():
            faces, number = refined[direct_grids.sides[refined // 2] == side], len(lattice(side))
            weights = np.tile(lattice_weights(side), (len(faces), 1))
            at = direct_grids.first[faces, None] + np.arange(number)
            index = direct_grids.index[at].ravel()
            self._near[count + index] = grids.nearest(np.repeat(faces, number), weights)
        alone = length + len(direct_grids.index) + np.arange(len(grids.first))
        coarse = np.where(grids.first >= 0, grids.first, alone)
        side = np.where(grids.first >= 0, np.repeat(grids.sides, 2), 0)
        has_direct = direct_grids.first >= 0
        self._faces["first"] = np.where(has_direct, length + direct_grids.first, coarse)
        self._faces["side"] = np.where(has_direct, np.repeat(direct_grids.sides, 2), side)
        index = np.concatenate([grids.index, count + direct_grids.index, grids.substitute])
        self._light[:2] = [self._copy(self._faces), self._copy(index.astype(np.int32))]

    def set_light(self, irradiance: np.ndarray, direct: np.ndarray) -> None:
        """Set the light that surfaces reflect: ``irradiance`` (P, 3) at points of the grids, and
        ``direct`` (P + D, 3), of the scene's lights, also at points of the direct grids."""
        self._light[2] = None  # frees memory first
        total = irradiance.astype(np.float32)[self._near]
        self._light[2] = self._copy(np.add(total, direct, out=total))

    def set_guide(self, guide: ImportanceGuide) -> None:
        """Guide rays from now on."""
        self._tables = [self._copy(array) for array in guide.limits]

    def send(
        self, points: Points, seeds: np.ndarray, first: int, count: int, tables: np.ndarray | int
    ) -> tuple[np.ndarray, np.ndarray, tuple]:
        """Send ``count`` rays per point, from number ``first`` of its sequence on.

        Parameters
        ----------
        seeds : (P,) the seeds of the points' sequences.
        tables : (P,) the points' tables of the guide; -1 for unguided rays.

        Returns
        -------
        sums : (2, P, 3) the light of both halves of the rays.
        is_open : (P,) whether a ray left the scene or hit a seen face; false inside objects.
        hits : per ray: emitted light, face that it hits (-1 none), barycentric weights there, and
            reflectance; for :meth:`reflect`.
        """
        number, rays = len(points), len(points) * count
        records = np.zeros(number, POINT)
        records["place"], records["normal"] = points.places, points.normals
        records["flat"], records["lift"] = points.flat, self.around.lifts(points)
        records["shift"], records["table"] = shifts(seeds), tables
        on_device = self._copy(records)
        ray_arrays = [page_aligned(shape) for shape in ((rays, 3), (rays, 3), (rays,))]
        guide = np.uint32(first), *self._tables, self._circle
        _, *sent = self._launch(self._aim, number, count, on_device, *guide, ray_arrays)
        traced = self.around.tracer.closest_hit(*ray_arrays[:2])
        self.around.rays += rays
        sums, is_open = page_aligned((2, number, 3)), page_aligned((number,), np.uint8)
        kinds = (np.float16,), (np.int32,), (np.float16, 3), (np.float16, 3)
        hits = tuple(page_aligned((rays, *size), kind) for kind, *size in kinds)
        surfaces = *map(self.device.shown, traced), *self._surfaces, *self._light
        self._launch(
            self._shade, number, count, on_device, *sent, *surfaces, [sums, is_open, *hits]
        )
        sums = sums + self.emitters.gather(points, seeds, first, count)
        return sums, is_open.astype(bool), hits

    def reflect(self, number: int, count: int, hits: tuple) -> list[np.ndarray]:
        """Return the light that surfaces reflect along the rays of ``number`` points whose ``hits``
        :meth:`send` found: sums (2, P, 3) of both halves; and all light per ray (R,)."""
        results = [page_aligned((2, number, 3)), page_aligned((number * count,))]
        shown = map(self.device.shown, hits)
        self._launch(self._reflect, number, count, *shown, *self._light, results)
        return results

    def _launch(self, kernel: cl.Kernel, number: int, count: int, *rest: Any) -> list[cl.Buffer]:
        """Run a kernel, which fills the arrays in its last argument; returns their buffers."""
        *arguments, results = rest
        targets = [self.device.target_buffer(array) for array in results]
        workers, numbers = min(self.device.threads, number), np.array([number, count], np.int32)
        kernel(self.device.queue, (workers,), (1,), *numbers, *arguments, *targets)
        for target, array in zip(targets, results, strict=True):
            self.device.collect(target, array)
        return targets
