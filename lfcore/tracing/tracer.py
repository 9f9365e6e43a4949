"""The tracer: what every ray of a slab meets, its colour, and the planes and frames it makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lfcore.errors import SceneError
from lfcore.opencl.device import Device, build_program, cl, open_device
from lfcore.optics import bundles as rays
from lfcore.optics.bundles import Bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.radiance import RadianceJob, page_aligned
from lfcore.tracing.surfaces import pack_surfaces
from lfcore.tracing.tile import TileJob, TileTracing
from lfcore.tracing.work import BeamShape, Groups, best_outer, leaves_a_ray, probed_elements

HITS_CHUNK_RAYS = 1 << 24
SCATTERED_LEAVES = 2.5
"""Leaves in the way of a block, a ray, above which single rays are faster: measured."""
SMALLEST_SCENE = 1e-12
"""Metres.  Products of three coordinates below it underflow float32: rays would miss silently."""


class Tracer:
    """Traces one scene on one device.

    Parameters
    ----------
    scene, bvh : what is looked at, and its hierarchy.
    device : an open device; default :func:`lfcore.opencl.device.open_device`.
    needs : features to compile in; default those that the scene uses.
    mipmaps : whether textures are filtered over a pixel's footprint, or read at full size.

    Raises
    ------
    SceneError
        for a scene within SMALLEST_SCENE of the lens.
    """

    def __init__(
        self,
        scene: Scene,
        bvh: Bvh,
        device: Device | None = None,
        needs: Needs | None = None,
        *,
        mipmaps: bool = True,
    ):
        if 0 < np.abs(scene.triangles).max(initial=0) < SMALLEST_SCENE:
            raise SceneError(
                f"all coordinates are below {SMALLEST_SCENE:g} m, too small for float32",
                remedy="Give the scene in larger units",
            )
        self.scene, self.device = scene, device or open_device()
        self.needs = needs or Needs.of(scene)
        self._surfaces = pack_surfaces(scene, self.needs, mipmaps=mipmaps)
        self._fp64 = int(bool(self.device.device.double_fp_config))
        # Most children a walk can leave on its stack: all but one of each level's, and the root;
        # for a multiple of four levels, so that scenes alike in needs share built programs.
        self._stack = 15 * (bvh.statistics().depth // 4 * 4 + 4) + 16
        buffer = self.device.buffer
        self._bvh = [buffer(a) for a in (bvh.boxes, bvh.children, bvh.leaves, bvh.leaf_ids)]
        s = self._surfaces
        arrays = (s.corners, s.attributes, s.material_ids, s.materials, s.lights, s.images)
        self._scene = [buffer(a) for a in (*arrays, s.texels)]
        self._leaf_boxes = bvh.leaf_boxes
        # The wrapper of a kernel does not keep its program alive.
        self._programs: dict[tuple, tuple[cl.Program, cl.Kernel]] = {}
        self._scratch_words: dict[int, int] = {}
        self._outer: dict[tuple, int] = {}
        self._scattered: dict[tuple, bool] = {}

    # -- visibility ---------------------------------------------------------------------------

    def slab_hits(self, slab: Slab, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Closest triangle and depth of every ray through ``pixels``.

        Parameters
        ----------
        slab : the rays.
        pixels : (P, 2) integer, columns u and rows v.

        Returns
        -------
        triangle : (P, N, N) int32, indexed [pixel, j, i]; -1 for a miss.
        depth : (P, N, N) float32, metres along the axis; infinity for a miss.
        """
        pixels = np.asarray(pixels).reshape(-1, 2)
        # Neighbours share a beam by their place on the grid, so each place may come but once.
        places, which = np.unique(pixels, axis=0, return_inverse=True)
        shape = self.beam_shape(rays.probe(slab), "hits")
        triangle, depth = self._hits(rays.macropixels(slab, places), places, shape)
        return triangle[which.ravel()], depth[which.ravel()]

    def bundle_hits(
        self, bundles: Bundles, coordinates: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """As :meth:`slab_hits` for any bundles: (E, rows, columns) triangle and depth.

        ``coordinates`` (E, 2) place the elements on their outer grid, so that neighbours can be
        traced together, and are distinct; without them every element is a beam of its own.  Of
        bundles on a lattice they are the places there.
        """
        shape = self.beam_shape(bundles, "hits", grouped=coordinates is not None)
        return self._hits(bundles, coordinates, shape)

    def _hits(self, bundles: Bundles, coordinates, shape: BeamShape):
        count, per_element = len(bundles.elements), bundles.columns * bundles.rows
        triangle = np.empty((count, bundles.rows, bundles.columns), np.int32)
        depth = np.empty(triangle.shape, np.float32)
        step = max(1, HITS_CHUNK_RAYS // per_element)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            places = None if coordinates is None else np.asarray(coordinates)[part]
            self._hits_chunk(bundles.part(part), places, shape, triangle[part], depth[part])
        return triangle, depth

    def _hits_chunk(self, bundles, coordinates, shape, triangle, depth) -> None:
        device, groups = self.device, Groups.of(shape, bundles, coordinates)
        kernel = self._beam_kernel("hits.cl", "slab_hits", shape, {"WRITE": 1})
        words = 2 * shape.blocks * 256 + 7 * 64
        depths, triangles = device.empty(depth.nbytes), device.empty(triangle.nbytes)
        kernel(
            device.queue,
            (self._workers(len(groups.members)),),
            (1,),
            *self._bvh,
            *self._ray_arguments(bundles, groups, shape),
            self._counter(),
            device.empty(4 * words * device.threads),
            depths,
            triangles,
        )
        cl.enqueue_copy(device.queue, depth, depths)
        cl.enqueue_copy(device.queue, triangle, triangles)

    def bundle_radiance(
        self,
        bundles: Bundles,
        coordinates: np.ndarray | None = None,
        out: np.ndarray | None = None,
    ) -> np.ndarray:
        """Linear RGB radiance of every ray, not clamped: (E, rows, columns, 3) float32.

        ``coordinates`` as for :meth:`bundle_hits`; ``out``, contiguous, is written and returned.
        """
        shape = len(bundles.elements), bundles.rows, bundles.columns, 3
        radiance = page_aligned(shape) if out is None else out
        RadianceJob(self, [bundles], coordinates, 1).run(radiance)
        return radiance

    def tiled_radiance(
        self,
        sets: Sequence[Bundles],
        coordinates: np.ndarray | None,
        across: int,
        out: np.ndarray | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> np.ndarray:
        """Sum of the radiance of all ``sets``, their elements tiles of one image.

        Parameters
        ----------
        sets : bundles of as many elements and equal inner grids.
        coordinates : as for :meth:`bundle_hits`.
        across : tiles in a row, a divisor of the number of elements; element e is tile
            (e // across, e % across).
        out : written and returned, contiguous.
        progress : called with (part done, parts).

        Returns
        -------
        (E / across rows, across columns, 3) float32, linear RGB, not clamped.
        """
        first = sets[0]
        if out is None:
            down = len(first.elements) // across
            out = page_aligned((down * first.rows, across * first.columns, 3))
        RadianceJob(self, sets, coordinates, across).run(out, progress)
        return out

    def closest_hit(
        self, origins: np.ndarray, directions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What arbitrary rays meet first.

        Parameters
        ----------
        origins, directions : (R, 3) float32; directions need not be of unit length.

        Returns
        -------
        triangle : (R,) int32, -1 for a miss; of several at one distance the lowest.  Rays that
            are not finite, or have no direction, miss.
        distance : (R,) float32, the parameter: the hit is ``origin + distance * direction``;
            infinity for a miss.
        barycentric : (R, 3) float32, weights of the corners p, q, r; NaN for a miss.
        """
        origins = np.ascontiguousarray(origins, np.float32).reshape(-1, 3)
        directions = np.ascontiguousarray(directions, np.float32).reshape(-1, 3)
        if origins.shape != directions.shape:
            raise ValueError(f"{len(origins)} origins for {len(directions)} directions")
        device, count = self.device, len(origins)
        triangle, distance = np.empty(count, np.int32), np.empty(count, np.float32)
        barycentric = np.empty((count, 3), np.float32)
        if not count:
            return triangle, distance, barycentric
        values = {"STACK": self._stack, "FP64": self._fp64}
        kernel = self._kernel("rays.cl", "closest_hits", values)
        outputs = [triangle, distance, barycentric]
        buffers = [device.empty(a.nbytes) for a in outputs]
        rays_in = [device.buffer(origins), device.buffer(directions)]
        workers = (self._workers(count),)
        number, counter = np.int32(count), self._counter()
        kernel(device.queue, workers, (1,), *self._bvh, *rays_in, number, counter, *buffers)
        for array, buffer in zip(outputs, buffers, strict=True):
            cl.enqueue_copy(device.queue, array, buffer)
        return triangle, distance, barycentric

    # -- whole tiles --------------------------------------------------------------------------

    def trace_tile(
        self,
        slab: Slab,
        tile,
        planes: Sequence[SensorPlane] = (),
        *,
        frames: bool = True,
        progress: Callable[[int, int], None] | None = None,
    ) -> TileTracing:
        """Trace one tile of a slab (Algorithms 1 and 3).

        Parameters
        ----------
        slab : the rays.
        tile : a :class:`lfcore.storage.layout.Tile`: which elements, in which frames.
        planes : sensor planes to form on the fly; their partial sums are in ``plane_sums``.
        frames : whether encoder-ready frames are wanted; without, chunks are empty.
        progress : called with (elements done, elements of the tile).
        """
        for plane in planes:
            plane.check(slab)
        job = TileJob(self, slab, tile, list(planes), frames)
        tracing = TileTracing(iter(()), rays=tile.rays)
        tracing.chunks = job.run(tracing, progress)
        return tracing

    # -- plumbing -----------------------------------------------------------------------------

    def beam_shape(self, bundles: Bundles, work: str, *, grouped: bool = True) -> BeamShape:
        """How these rays are cut into beams.

        ``work``: "hits" or "colours", for which neighbouring elements may share blocks, or
        "radiance"; ``grouped``: whether the elements' places are known, so that they can share
        beams.
        """
        outer = self.outer(bundles, work) if grouped and work != "radiance" else 1
        scattered = self.scattered(bundles, outer)
        inner = max(bundles.columns, bundles.rows)
        shape = BeamShape.for_inner(inner, 1 if scattered else outer, scattered)
        return shape if grouped else replace(shape, group=1)

    def outer(self, bundles: Bundles, work: str) -> int:
        """Elements along each axis that a block spans."""
        if bundles.lattice is None:
            return 1
        key = work, bundles.columns, bundles.rows, bundles.lattice, bundles.step.tobytes()
        if key not in self._outer:
            self._outer[key] = best_outer(self.closest_hit, bundles, work)
        return self._outer[key]

    def scattered(self, bundles: Bundles, outer: int = 1) -> bool:
        """Whether blocks of these rays have so much in their way that single rays are faster.

        Never for elements of one ray: such rays come from anywhere, and none must change how
        its neighbours are traced.
        """
        if bundles.columns * bundles.rows == 1:
            return False
        grid = outer, bundles.columns, bundles.rows, bundles.lattice, bundles.step.tobytes()
        key = *grid, probed_elements(bundles).tobytes()
        if key not in self._scattered:
            leaves = leaves_a_ray(self._leaf_boxes, bundles, outer)
            self._scattered[key] = leaves > SCATTERED_LEAVES
        return self._scattered[key]

    def _ray_arguments(self, bundles: Bundles, groups: Groups, shape: BeamShape) -> list:
        """What the kernels take as their rays, from ``elements`` to ``rows``."""
        lattice = bundles.lattice if shape.outer > 1 else None
        outer = (lattice.origin, lattice.direction) if lattice else (0, 0)
        return [
            self.device.buffer(np.ascontiguousarray(groups.middles)),
            self.device.buffer(groups.members),
            np.int32(len(groups.members) * shape.squares(bundles.columns, bundles.rows)),
            bundles.step,
            np.array(outer, np.float32),
            np.int32(bundles.columns),
            np.int32(bundles.rows),
        ]

    def _scratch(self, kernel: cl.Kernel) -> cl.Buffer:
        """Memory of all workers, of the size that the program says one needs."""
        device, key = self.device, kernel.int_ptr
        if key not in self._scratch_words:
            words, answer = np.zeros(1, np.int32), device.empty(4)
            cl.Kernel(kernel.program, "scratch_words")(device.queue, (1,), None, answer)
            cl.enqueue_copy(device.queue, words, answer)
            self._scratch_words[key] = int(words[0])
        return device.empty(4 * self._scratch_words[key] * device.threads)

    def scratch_bytes(self, slab: Slab, tile, planes=(), *, frames: bool = True) -> int:
        """Device memory that workers hold while such a tile is traced."""
        return TileJob(self, slab, tile, list(planes), frames).scratch.size

    def _workers(self, beams: int) -> int:
        return max(1, min(self.device.threads, beams * 64))

    def _counter(self) -> cl.Buffer:
        return self.device.buffer(np.zeros(1, np.int32))

    def _beam_kernel(self, file: str, name: str, shape: BeamShape, defines: dict) -> cl.Kernel:
        values = {**shape.defines, "STACK": self._stack, "FP64": self._fp64, **defines}
        return self._kernel(file, name, values)

    def _kernel(self, file: str, name: str, values: dict) -> cl.Kernel:
        key = (file, name, *sorted(values.items()))
        if key not in self._programs:
            program = build_program(self.device, [f"tracing/kernels/{file}"], values)
            self._programs[key] = program, cl.Kernel(program, name)
        return self._programs[key][1]
