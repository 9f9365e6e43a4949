"""One tile on the device: its chunks of frames, its launches, and the memory that frames go to."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lfcore.opencl.device import Device, cl
from lfcore.optics import bundles as rays
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.tracing.plane_buffers import PlaneBuffers, StripBuffers
from lfcore.tracing.work import BeamShape, group_elements

if TYPE_CHECKING:
    from lfcore.tracing.tracer import Tracer

CHUNK_BYTES = 64 << 20
CHUNK_RAYS = 1 << 26
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


class TileJob:
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
        scattered = tracer.scattered(rays.probe(slab, self.macro))
        self.kernel = tracer._beam_kernel("slab.cl", "trace_slab", self.shape, scattered, defines)
        self.scratch = tracer._scratch(self.kernel)
        self.sums = PlaneBuffers(device, slab, planes, tile)
        summed = len(self.elements) if self.macro else 0
        self.strips = StripBuffers(self.sums, self.shape, layout.inner, summed)

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
            step = max(1, CHUNK_RAYS // self.layout.inner**2)
            return np.array([*range(0, total, step), total])
        step = self._frames_per_chunk()
        starts = np.searchsorted(frame_of, np.arange(0, self.tile.frame_count, step))
        return np.append(starts, total)

    def _launch(self, part: slice, places: np.ndarray, frames: cl.Buffer) -> None:
        tracer, device, layout = self.tracer, self.tracer.device, self.layout
        make = rays.macropixels if self.macro else rays.views
        bundles = make(self.slab, self.elements[part])
        beams = group_elements(self.elements[part], self.shape.group, self.strips.tall)
        self.kernel(
            device.queue,
            (tracer._workers(len(beams)),),
            (1,),
            *tracer._bvh,
            *tracer._scene,
            tracer._surfaces.ambient,
            tracer._surfaces.background,
            *tracer._ray_arguments(bundles, bundles.elements, beams, self.shape),
            np.float32(bundles.pixel_pitch),
            tracer._counter(),
            self.scratch,
            device.buffer(np.ascontiguousarray(places)),
            frames,
            np.int32(layout.frame_width),
            np.int32(layout.frame_height),
            *self.strips.arguments(),
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
