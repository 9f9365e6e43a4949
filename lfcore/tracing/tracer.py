"""The tracer: a tile's rays, chunk by chunk, into frames and sensor planes."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lfcore.optics import bundles as rays
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.progress import Progress
from lfcore.timing import Stopwatch
from lfcore.tracing.arrays import ArrayTracer
from lfcore.tracing.chunks import Chunk, FrameMemory, chunk_cuts, grid_corner, placements_of
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.job import PacketJob
from lfcore.tracing.packets import Groups
from lfcore.tracing.plan import Plan, probe
from lfcore.tracing.plane_buffers import tile_strips

if TYPE_CHECKING:
    from lfcore.storage.layout import Tile


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
        plan: Plan,
        slab: Slab,
        tile: Tile,
        planes: Sequence[SensorPlane],
        frames: bool,
    ):
        self.scene, self.slab, self.tile, self.frames = scene, slab, tile, frames
        self.layout = layout = tile.layout
        self.macro = layout.kind == "macropixels"
        self.elements = tile.elements() + grid_corner(tile, slab)
        self.shape = plan.shape(probe(slab, self.macro), "FRAMES")
        # Without frames their format must not make another program.
        defines = {
            "PLANES": 0 if not planes else 1 if self.macro else 2,
            "BITS": layout.format.bits if frames else 0,
            "STOPS": scene.stops,
            "PEAK": layout.peak or 0 if frames else 0,
        }
        self.job = PacketJob(scene, self.shape, "FRAMES", **defines)
        self.strips = tile_strips(scene, self.shape, slab, tile, planes)

    def run(self, tracing: TileTracing, progress: Progress | None) -> Iterator[Chunk]:
        placements = placements_of(self.tile, self.slab, frames=self.frames)
        frame_of = placements["frame"].copy()
        cuts = chunk_cuts(
            self.layout, self.elements, frame_of if self.frames else None, self.shape.group_side
        )
        ends = frame_of[cuts[1:] - 1] + 1 if self.frames else np.zeros(1, int)
        memory = FrameMemory(self.scene.device, self.layout, int(np.diff(ends, prepend=0).max()))
        watch = Stopwatch()
        for start, stop in itertools.pairwise(cuts):
            with watch.part("trace"):
                first = int(frame_of[start])
                count = int(frame_of[stop - 1]) + 1 - first if self.frames else 0
                placements["frame"][start:stop] -= first
                # The first chunk's memory is black already.
                if start and stop - start < count * self.layout.elements_per_frame:
                    memory.blank(count)
                self._launch(slice(start, stop), placements[start:stop], memory)
                self.scene.device.queue.finish()
            tracing.seconds = watch.seconds["trace"]
            if progress:
                progress(stop, len(self.elements))
            if self.frames:
                with memory.frames(count) as frames:
                    yield Chunk(frames, first)
        tracing.plane_sums = self.strips.sums.collect()

    def _launch(self, part: slice, placements: np.ndarray, memory: FrameMemory) -> None:
        make = rays.macropixels if self.macro else rays.views
        bundles = make(self.slab, self.elements[part])
        groups = Groups.of(self.shape, bundles, self.elements[part], self.strips.height)
        self.job.launch(
            bundles, groups, self.strips.workers, frame_numbers=memory.arguments,
            placements=self.scene.device.buffer(placements), frames=memory.buffer,
            **self.strips.arguments(),
        )  # fmt: skip


class Tracer(ArrayTracer):
    """Traces one scene on one device.

    Parameters
    ----------
    scene, bvh : a scene, and its hierarchy.
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
        progress: Progress | None = None,
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
        job = TileJob(self._on_device, self.plan, slab, tile, planes, frames)
        tracing.chunks = job.run(tracing, progress)
        return tracing

    def scratch_bytes(
        self, slab: Slab, tile: Tile, planes: Sequence[SensorPlane] = (), *, frames: bool = True
    ) -> int:
        """Device memory that workers hold while such a tile is traced."""
        return TileJob(self._on_device, self.plan, slab, tile, planes, frames).job.scratch.size
