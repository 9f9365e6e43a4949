"""The tracer: what every ray of a slab meets, its colour, and the planes and frames it makes."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lfcore.errors import DeviceError
from lfcore.opencl.device import Device, build_program, cl, open_device
from lfcore.optics import bundles as rays
from lfcore.optics.bundles import Bundles
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.plane_buffers import PlaneBuffers
from lfcore.tracing.surfaces import pack_surfaces
from lfcore.tracing.work import BeamShape, group_elements

CHUNK_BYTES = 64 << 20
HITS_CHUNK_RAYS = 1 << 24
PAGE = 4096


@dataclass(frozen=True)
class Chunk:
    """Consecutive frames of a tile.

    ``frames`` is (F, frame_bytes) uint8, valid until the next chunk is asked for; ``first`` is
    the number of its first frame within the tile.
    """

    frames: np.ndarray
    first: int


@dataclass
class TileTracing:
    """One tile being traced; iterate over its :class:`Chunk`s, then read ``plane_sums``.

    ``seconds`` counts wall time of tracing, shading, planes and frame conversion, device queue
    finished, without program build and without what the consumer does between chunks.
    """

    chunks: Iterator[Chunk]
    plane_sums: PlaneSums | None = None
    seconds: float = 0.0
    rays: int = 0

    def __iter__(self) -> Iterator[Chunk]:
        return self.chunks


class Tracer:
    """Traces one scene on one device.

    Parameters
    ----------
    scene, bvh : what is looked at, and its hierarchy.
    device : an open device; default :func:`lfcore.opencl.device.open_device`.
    needs : features to compile in; default those that the scene uses.
    mipmaps : whether textures are filtered over a pixel's footprint, or read at full size.
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
        self.scene, self.device = scene, device or open_device()
        self.needs = needs or Needs.of(scene)
        self._surfaces = pack_surfaces(scene, self.needs, mipmaps=mipmaps)
        # Most children a walk can leave on its stack: all but one of each level's, and the root.
        self._stack = 15 * (bvh.statistics().depth + 1) + 16
        buffer = self.device.buffer
        self._bvh = [buffer(a) for a in (bvh.boxes, bvh.children, bvh.leaves, bvh.leaf_ids)]
        s = self._surfaces
        arrays = (s.corners, s.attributes, s.material_ids, s.materials, s.lights, s.images)
        self._scene = [buffer(a) for a in (*arrays, s.texels)]
        # The wrapper of a kernel does not keep its program alive.
        self._programs: dict[tuple, tuple[cl.Program, cl.Kernel]] = {}

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
        triangle, depth = self.bundle_hits(rays.macropixels(slab, places), places)
        return triangle[which.ravel()], depth[which.ravel()]

    def bundle_hits(
        self, bundles: Bundles, coordinates: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """As :meth:`slab_hits` for any bundles: (E, rows, columns) triangle and depth.

        ``coordinates`` (E, 2) place the elements on their outer grid, so that neighbours can be
        traced together, and are distinct; without them every element is a beam of its own.
        """
        count, per_element = len(bundles.elements), bundles.columns * bundles.rows
        triangle = np.empty((count, bundles.rows, bundles.columns), np.int32)
        depth = np.empty(triangle.shape, np.float32)
        step = max(1, HITS_CHUNK_RAYS // per_element)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            self._hits_chunk(bundles, coordinates, part, triangle[part], depth[part])
        return triangle, depth

    def _hits_chunk(self, bundles, coordinates, part, triangle, depth) -> None:
        device = self.device
        shape, beams = self._beams(bundles, coordinates, part)
        kernel = self._beam_kernel("hits.cl", "slab_hits", shape, {"WRITE": 1})
        words = 2 * shape.blocks * 256 + 7 * 64
        depths, triangles = device.empty(depth.nbytes), device.empty(triangle.nbytes)
        elements = np.ascontiguousarray(bundles.elements[part])
        kernel(
            device.queue,
            (self._workers(len(beams)),),
            (1,),
            *self._bvh,
            device.buffer(elements),
            device.buffer(beams),
            np.int32(len(beams) * shape.squares(bundles.columns, bundles.rows)),
            bundles.step,
            np.int32(bundles.columns),
            np.int32(bundles.rows),
            self._counter(),
            device.empty(4 * words * device.threads),
            depths,
            triangles,
        )
        cl.enqueue_copy(device.queue, depth, depths)
        cl.enqueue_copy(device.queue, triangle, triangles)

    def bundle_radiance(
        self, bundles: Bundles, coordinates: np.ndarray | None = None
    ) -> np.ndarray:
        """Linear RGB radiance of every ray, not clamped: (E, rows, columns, 3) float32.

        ``coordinates`` as for :meth:`bundle_hits`.
        """
        count, per_element = len(bundles.elements), bundles.columns * bundles.rows
        radiance = np.empty((count, bundles.rows, bundles.columns, 3), np.float32)
        step = max(1, HITS_CHUNK_RAYS // per_element)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            self._radiance_chunk(bundles, coordinates, part, radiance[part])
        return radiance

    def _radiance_chunk(self, bundles, coordinates, part, radiance) -> None:
        device, s = self.device, self._surfaces
        shape, beams = self._beams(bundles, coordinates, part)
        kernel = self._beam_kernel("radiance.cl", "trace_radiance", shape, s.defines)
        target = device.empty(radiance.nbytes)
        kernel(
            device.queue,
            (self._workers(len(beams)),),
            (1,),
            *self._bvh,
            *self._scene,
            s.ambient,
            s.background,
            device.buffer(np.ascontiguousarray(bundles.elements[part])),
            device.buffer(beams),
            np.int32(len(beams) * shape.squares(bundles.columns, bundles.rows)),
            bundles.step,
            np.int32(bundles.columns),
            np.int32(bundles.rows),
            np.float32(bundles.pixel_pitch),
            self._counter(),
            self._scratch(kernel),
            target,
        )
        cl.enqueue_copy(device.queue, radiance, target)

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
        values = {"STACK": self._stack, "FP64": int(bool(device.device.double_fp_config))}
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
        layout = tile.layout
        if frames and (layout.format.bits != 8 or layout.format.rgb):
            raise DeviceError(f"frames of {layout.pixel_format} are not made by the kernels")
        for plane in planes:
            plane.check(slab)
        job = _TileJob(self, slab, tile, list(planes), frames)
        tracing = TileTracing(iter(()), rays=tile.rays)
        tracing.chunks = job.run(tracing, progress)
        return tracing

    # -- plumbing -----------------------------------------------------------------------------

    def _beams(self, bundles: Bundles, coordinates, part: slice) -> tuple[BeamShape, np.ndarray]:
        shape = BeamShape.for_inner(max(bundles.columns, bundles.rows))
        if coordinates is None:
            shape = BeamShape(shape.side, 1, shape.half)
            coordinates = np.zeros((len(bundles.elements), 2), np.int64)
        return shape, group_elements(np.asarray(coordinates)[part], shape.group)

    def _scratch(self, kernel: cl.Kernel) -> cl.Buffer:
        """Memory of all workers, of the size that the program says one needs."""
        device, words = self.device, np.zeros(1, np.int32)
        answer = device.empty(4)
        cl.Kernel(kernel.program, "scratch_words")(device.queue, (1,), None, answer)
        cl.enqueue_copy(device.queue, words, answer)
        return device.empty(4 * int(words[0]) * device.threads)

    def scratch_bytes(self, slab: Slab, tile, planes=(), *, frames: bool = True) -> int:
        """Device memory that workers hold while such a tile is traced."""
        return _TileJob(self, slab, tile, list(planes), frames).scratch.size

    def _workers(self, beams: int) -> int:
        return max(1, min(self.device.threads, beams * 64))

    def _counter(self) -> cl.Buffer:
        return self.device.buffer(np.zeros(1, np.int32))

    def _beam_kernel(self, file: str, name: str, shape: BeamShape, defines: dict) -> cl.Kernel:
        values = {
            "SIDE": shape.side,
            "ELEMENTS": shape.elements,
            "HALF": f"{shape.half}f",
            "STACK": self._stack,
            **defines,
        }
        return self._kernel(file, name, values)

    def _kernel(self, file: str, name: str, values: dict) -> cl.Kernel:
        key = (file, name, *sorted(values.items()))
        if key not in self._programs:
            program = build_program(self.device, [f"tracing/kernels/{file}"], values)
            self._programs[key] = program, cl.Kernel(program, name)
        return self._programs[key][1]


class _TileJob:
    """Buffers and launches of one tile."""

    def __init__(self, tracer: Tracer, slab: Slab, tile, planes: list[SensorPlane], frames: bool):
        self.tracer, self.slab, self.tile, self.planes = tracer, slab, tile, planes
        self.frames, self.layout = frames, tile.layout
        self.macro = tile.layout.kind == "macropixels"
        self.elements = tile.elements()
        device, layout = tracer.device, tile.layout
        self.shape = BeamShape.for_inner(layout.inner)
        defines = {
            **tracer._surfaces.defines,
            "PLANES": int(bool(planes)),
            "FRAMES": int(frames),
            "CHROMA": layout.format.subsampling,
            "VIEWS": int(not self.macro),
        }
        self.kernel = tracer._beam_kernel("slab.cl", "trace_slab", self.shape, defines)
        self.scratch = tracer._scratch(self.kernel)
        self.sums = PlaneBuffers(device, slab, planes, tile)

    def run(self, tracing: TileTracing, progress) -> Iterator[Chunk]:
        places = np.zeros((len(self.elements), 4), np.int32)
        places[:, :3] = self.tile.placement(self.elements)
        places[:, 3] = self.elements[:, 0] | self.elements[:, 1] << 16
        cuts = self._cuts(places[:, 0])
        hosts = _FrameHost(self.tracer.device, self.layout, self._frames_per_chunk())
        for start, stop in itertools.pairwise(cuts):
            begun = time.perf_counter()
            first = int(places[start, 0])
            count = int(places[stop - 1, 0]) + 1 - first if self.frames else 0
            places[start:stop, 0] -= first
            self._launch(slice(start, stop), places[start:stop], hosts.buffer)
            frames = hosts.read(count) if self.frames else np.empty((0, 0), np.uint8)
            self.tracer.device.queue.finish()
            tracing.seconds += time.perf_counter() - begun
            if progress:
                progress(stop, len(self.elements))
            if self.frames:
                yield Chunk(frames, first)
        tracing.plane_sums = self.sums.collect()

    def _frames_per_chunk(self) -> int:
        if not self.frames:
            return 0
        return min(max(1, CHUNK_BYTES // self.layout.frame_bytes), self.tile.frame_count)

    def _cuts(self, frame_of: np.ndarray) -> np.ndarray:
        """Element indices at which chunks of whole frames begin and end."""
        total = len(frame_of)
        if not self.frames:
            step = max(1, HITS_CHUNK_RAYS * 4 // self.layout.inner**2)
            return np.array([*range(0, total, step), total])
        step = self._frames_per_chunk()
        starts = np.searchsorted(frame_of, np.arange(0, self.tile.frame_count, step))
        return np.append(starts, total)

    def _launch(self, part: slice, places: np.ndarray, frames: cl.Buffer) -> None:
        tracer, device, layout = self.tracer, self.tracer.device, self.layout
        make = rays.macropixels if self.macro else rays.views
        bundles = make(self.slab, self.elements[part])
        beams = group_elements(self.elements[part], self.shape.group)
        self.kernel(
            device.queue,
            (tracer._workers(len(beams)),),
            (1,),
            *tracer._bvh,
            *tracer._scene,
            tracer._surfaces.ambient,
            tracer._surfaces.background,
            device.buffer(bundles.elements),
            device.buffer(np.ascontiguousarray(places)),
            device.buffer(beams),
            np.int32(len(beams) * self.shape.squares(bundles.columns, bundles.rows)),
            bundles.step,
            np.int32(bundles.columns),
            np.int32(bundles.rows),
            np.float32(bundles.pixel_pitch),
            tracer._counter(),
            self.scratch,
            frames,
            np.int32(layout.frame_width),
            np.int32(layout.frame_height),
            *self.sums.arguments(),
        )


class _FrameHost:
    """Page-aligned host memory that the device writes frames into, without a copy on a CPU."""

    def __init__(self, device: Device, layout, frames: int):
        self.device, self.size = device, layout.frame_bytes
        size = max(frames * self.size, PAGE)
        raw = np.empty(size + 2 * PAGE, np.uint8)
        offset = -raw.ctypes.data % PAGE
        self.memory = raw[offset : offset + -(-size // 64) * 64]
        if frames:
            self._blank(layout, frames)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self.buffer = cl.Buffer(device.context, flags, hostbuf=self.memory)

    def _blank(self, layout, frames: int) -> None:
        """Padding and empty slots of a frame are black, not what memory held."""
        view = self.memory[: frames * self.size].reshape(frames, self.size)
        luma = layout.frame_width * layout.frame_height
        view[:, :luma], view[:, luma:] = 16, 128

    def read(self, count: int) -> np.ndarray:
        """(count, frame_bytes) uint8 of what was written; waits for the queue."""
        shape = (count, self.size)
        view, _ = cl.enqueue_map_buffer(
            self.device.queue, self.buffer, cl.map_flags.READ, 0, shape, np.uint8
        )
        return view
