"""The tracer: the hit of every ray of a slab, its colour, its tiles' planes and frames."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lfcore.opencl.device import cl
from lfcore.optics import bundles as rays
from lfcore.optics.plane_sums import PlaneSums, one_of_sums
from lfcore.optics.plane_tables import lens_tables, view_tables
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.timing import Stopwatch
from lfcore.tracing.arrays import ArrayTracer
from lfcore.tracing.chunks import FrameMemory, chunk_cuts, grid_corner, slots_of, tile_corners
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.job import PacketJob
from lfcore.tracing.layouts import FRAME_ARGUMENTS, record
from lfcore.tracing.packets import Groups, PacketShape
from lfcore.tracing.plan import probe
from lfcore.tracing.plane_buffers import PlaneBuffers, StripBuffers

if TYPE_CHECKING:
    from lfcore.storage.layout import Tile


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
        hosts = FrameMemory(self.scene.device, self.layout, int(np.diff(ends, prepend=0).max()))
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


class Tracer(ArrayTracer):
    """Traces one scene on one device.

    Rays into arrays of the host are in :class:`ArrayTracer`, tiles of frames and planes here.

    Parameters
    ----------
    scene, bvh : what is looked at, and its hierarchy.
    device : an open device; default :func:`lfcore.opencl.device.open_device`.
    needs : features to compile in; default those that the scene uses.
    mipmaps : whether textures are filtered over a pixel's footprint, or read at full size.
    outer : elements along each axis that blocks span, 1, 2 or 4; default what is best.
    single_rays : whether rays are followed one by one; default where that is best.

    Raises
    ------
    SceneError
        for a scene within SMALLEST_SCENE of the lens.
    """

    def trace_tile(
        self,
        slab: Slab,
        tile: Tile,
        planes: Sequence[SensorPlane] = (),
        *,
        frames: bool = True,
        progress: Callable[[int, int], None] | None = None,
    ) -> TileTracing:
        """Trace one tile of a slab (Algorithms 1 and 3).

        Parameters
        ----------
        slab : the rays.
        tile : which elements, in which frames.
        planes : sensor planes to form on the fly; their partial sums are in ``plane_sums``.
        frames : whether encoder-ready frames are wanted; without, chunks are empty.
        progress : called with (elements done, elements of the tile).
        """
        for plane in planes:
            plane.check(slab)
        tracing = TileTracing(iter(()), rays=tile.rays)
        tracing.chunks = self._tile_job(slab, tile, planes, frames).run(tracing, progress)
        return tracing

    def scratch_bytes(
        self, slab: Slab, tile: Tile, planes: Sequence[SensorPlane] = (), *, frames: bool = True
    ) -> int:
        """Device memory that workers hold while such a tile is traced."""
        return self._tile_job(slab, tile, planes, frames).job.scratch.size

    def _tile_job(
        self, slab: Slab, tile: Tile, planes: Sequence[SensorPlane], frames: bool
    ) -> TileJob:
        shape = self.plan.shape(probe(slab, tile.layout.kind == "macropixels"), "FRAMES")
        return TileJob(self._on_device, shape, slab, tile, planes, frames)
