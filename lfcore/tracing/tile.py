"""One tile on the device: its chunks of frames, its launches, and the memory that frames go to."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lfcore.opencl.device import PAGE, Device, cl
from lfcore.opencl.host_memory import page_aligned
from lfcore.optics import bundles as rays
from lfcore.optics.plane_sums import PlaneSums, one_of_sums
from lfcore.optics.plane_tables import lens_tables, view_tables
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.timing import Stopwatch
from lfcore.tracing.chunks import chunk_cuts
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.job import PacketJob
from lfcore.tracing.layouts import FRAME_ARGUMENTS, SLOT, record
from lfcore.tracing.packets import Groups, PacketShape
from lfcore.tracing.plane_buffers import PlaneBuffers, StripBuffers

if TYPE_CHECKING:
    from lfcore.storage.layout import FrameLayout, Tile


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
    """The job of one tile, whose sink is frames and planes, and its buffers."""

    def __init__(
        self,
        scene: DeviceScene,
        shape: PacketShape,
        slab: Slab,
        tile: Tile,
        planes: Sequence[SensorPlane],
        frames: bool,
    ):
        self.scene, self.shape, self.slab, self.tile = scene, shape, slab, tile
        self.frames, self.layout = frames, tile.layout
        self.macro = tile.layout.kind == "macropixels"
        self.elements = tile.elements() + grid_corner(tile, slab)
        device, layout = scene.device, tile.layout
        # Without frames their format is not asked for: it must not make another program.
        defines = {
            "PLANES": 0 if not planes else 1 if self.macro else 2,
            "BITS": layout.format.bits if frames else 0,
            "STOPS": scene.stops,
            "PEAK": layout.peak or 0 if frames else 0,
        }
        self.job = PacketJob(scene, shape, "FRAMES", **defines)
        if self.macro:
            corners = tile_corners(tile, slab)
            tables = lens_tables(slab, planes, corners, shape.group, shape.cells)
        else:
            tables = view_tables(slab, planes)
        self.sums = PlaneBuffers(device, slab, list(planes), tables, one_of_sums(scene.stops))
        summed = len(self.elements) if self.macro else 0
        self.strips = StripBuffers(self.sums, shape, slab.views, summed, scene.stops)

    def run(
        self, tracing: TileTracing, progress: Callable[[int, int], None] | None
    ) -> Iterator[Chunk]:
        slots = slots_of(self.tile, self.slab, frames=self.frames)
        frame_of = slots["frame"].copy()
        cuts = chunk_cuts(
            self.layout, self.elements, frame_of if self.frames else None, self.shape.group
        )
        ends = frame_of[cuts[1:] - 1] + 1 if self.frames else np.zeros(1, int)
        hosts = _FrameHost(self.scene.device, self.layout, int(np.diff(ends, prepend=0).max()))
        watch = Stopwatch()
        for start, stop in itertools.pairwise(cuts):
            with watch.part("trace"):
                first = int(frame_of[start])
                count = int(frame_of[stop - 1]) + 1 - first if self.frames else 0
                slots["frame"][start:stop] -= first
                # The first chunk's memory is black already.
                if start and stop - start < count * self.layout.elements_per_frame:
                    hosts.blank(count)
                self._launch(slice(start, stop), slots[start:stop], hosts.buffer)
                self.scene.device.queue.finish()
            tracing.seconds = watch.seconds["trace"]
            if progress:
                progress(stop, len(self.elements))
            if self.frames:
                with hosts.frames(count) as frames:
                    yield Chunk(frames, first)
        tracing.plane_sums = self.sums.collect()

    def _launch(self, part: slice, slots: np.ndarray, frames: cl.Buffer) -> None:
        layout = self.layout
        make = rays.macropixels if self.macro else rays.views
        bundles = make(self.slab, self.elements[part])
        groups = Groups.of(self.shape, bundles, self.elements[part], self.strips.height)
        numbers = record(
            FRAME_ARGUMENTS, width=layout.frame_width, height=layout.frame_height,
            chroma=layout.format.subsampling, rgb=layout.format.rgb,
        )  # fmt: skip
        self.job.launch(
            bundles,
            groups,
            self.strips.workers,
            frame_numbers=numbers,
            slots=self.scene.device.buffer(slots),
            frames=frames,
            **self.strips.arguments(),
        )


def grid_corner(tile: Tile, slab: Slab) -> np.ndarray:
    """(2,) int32: what a tile's columns and rows count from, on the slab's square grids.

    Tiles of views count from the first lens sample, and tiles of pixels from the first that is
    there.
    """
    corner = slab.held.pixels[:2] if tile.layout.kind == "macropixels" else (0, 0)
    return np.array(corner, np.int32)


def tile_corners(tile: Tile, slab: Slab) -> tuple[int, int, int, int]:
    """The elements [u0, u1) x [v0, v1) of a tile on the slab's square grid: u0, v0, u1, v1."""
    left, top = (grid_corner(tile, slab) + [tile.column, tile.row]).tolist()
    return left, top, left + tile.columns, top + tile.rows


def slots_of(tile: Tile, slab: Slab, *, frames: bool = True) -> np.ndarray:
    """(E,) SLOT of a tile's elements, frame after frame; without ``frames`` their places on the
    slab's square grid alone."""
    elements = tile.elements()
    slots = np.zeros(len(elements), SLOT)
    if frames:
        slots["frame"], slots["x"], slots["y"] = tile.placement(elements).T
    slots["column"], slots["row"] = (elements + grid_corner(tile, slab)).T
    return slots


class _FrameHost:
    """Page-aligned host memory that the device writes frames into, without a copy on a CPU."""

    def __init__(self, device: Device, layout: FrameLayout, frames: int):
        self.device, self.layout = device, layout
        size = max(frames * layout.frame_bytes, PAGE)
        self.memory = page_aligned((-(-size // 64) * 64,), np.uint8)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self.buffer = cl.Buffer(device.context, flags, hostbuf=self.memory)
        if frames:
            self.blank(frames)

    def blank(self, count: int) -> None:
        """Make padding and empty slots of the first frames black, whatever memory held."""
        layout = self.layout
        with self.frames(count, write=True) as view:
            planes = layout.format.views(view, layout.frame_width, layout.frame_height)
            for plane, code in zip(planes, layout.format.black, strict=True):
                plane[...] = code

    def frames(self, count: int, *, write: bool = False) -> AbstractContextManager[np.ndarray]:
        """(count, frame_bytes) uint8 within a ``with`` block, in which no kernel may run."""
        shape = count, self.layout.frame_bytes
        return self.device.mapped(self.buffer, shape, np.uint8, write=write)
