"""The tracer: the hit of every ray of a slab, its colour, and the planes and frames it makes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from lfcore.optics.bundles import probe
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.tracing.arrays import ArrayTracer
from lfcore.tracing.tile import TileJob, TileTracing

if TYPE_CHECKING:
    from lfcore.storage.layout import Tile


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
