"""Tiles of a slab: traced chunk by chunk into arrays, which become sensor planes (Algorithm 1) and
encoder-ready frames (Algorithm 3)."""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lfcore.opencl.device import page_aligned
from lfcore.optics import bundles as rays
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.progress import Progress
from lfcore.refocus.plane_former import PlaneFormer
from lfcore.refocus.strip_tables import CHUNK
from lfcore.storage.frame_memory import FrameWriter, grid_corner
from lfcore.storage.layout import Tile
from lfcore.timing import Stopwatch
from lfcore.tracing.packets import ranks
from lfcore.tracing.plan import probe
from lfcore.tracing.tracer import Tracer

CHUNK_RAYS = 1 << 21
"""The rays per chunk: their light, 12 bytes per ray, stays in a cache of 32 MiB."""
MOST_GROWTH = 8
"""The largest chunk, in CHUNK_RAYS, that keeps groups of elements with a common packet whole: a
divided group is traced twice."""


@dataclass(frozen=True)
class Chunk:
    """Consecutive frames of a tile.

    ``frames`` is (F, frame_bytes) uint8, valid until the next chunk is taken; ``first`` is the
    number of the first frame within the tile.
    """

    frames: np.ndarray
    first: int


@dataclass
class TileTracing:
    """One tile being traced; iterate over its :class:`Chunk`s, then read ``plane_sums``.

    ``seconds`` counts tracing, planes and frames by the device's clock, with its queue finished,
    without the program's build and without the consumer's work between chunks.
    """

    chunks: Iterator[Chunk]
    plane_sums: PlaneSums | None = None
    seconds: float = 0.0
    rays: int = 0

    def __iter__(self) -> Iterator[Chunk]:
        return self.chunks

    def finished(self) -> TileTracing:
        """Run the tracing to its end and return it: a tile without frames has no chunks."""
        deque(self, maxlen=0)
        return self


def trace_tile(
    tracer: Tracer,
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
    tile : the elements, and their frames.
    planes : sensor planes to form; their partial sums are in ``plane_sums``.
    frames : whether to make encoder-ready frames.
    progress : called with (elements done, elements of the tile).
    """
    for plane in planes:
        plane.check(slab)
    tracing = TileTracing(iter(()), rays=tile.rays)
    tracing.chunks = _trace(tracing, tracer, slab, tile, planes, frames, progress)
    return tracing


def _trace(
    tracing: TileTracing,
    tracer: Tracer,
    slab: Slab,
    tile: Tile,
    planes: Sequence[SensorPlane],
    frames: bool,
    progress: Progress | None,
) -> Iterator[Chunk]:
    device, layout = tracer.device, tile.layout
    macro = layout.kind == "macropixels"
    elements = tile.elements()
    places = elements + grid_corner(tile, slab)
    frame_of = tile.placement(elements)[:, 0]
    job = tracer.job("IMAGE", probe(slab, macro), grouped=macro)
    columns, rows = layout.inner
    if macro and not frames and planes:
        columns = rows = slab.views - 2 * closed_margin(slab, planes)
    cuts = chunk_cuts(
        places, frame_of if frames else None, math.prod(layout.inner), job.shape.outer
    )
    room = page_aligned((int(np.diff(cuts).max()), rows, columns, 3))
    former = PlaneFormer(slab, tile, planes, device, stops=tracer.needs.stops) if planes else None
    writer = None
    if frames:
        writer = FrameWriter(device, tile, max(np.ptp(frame_of[a:b]) + 1 for a, b in _parts(cuts)))
    watch = Stopwatch(clock=device.clock)
    for start, stop in _parts(cuts):
        with watch.part("trace"):
            part, light = places[start:stop], room[: stop - start]
            bundles = rays.macropixels(slab, part) if macro else rays.views(slab, part)
            bundles = replace(bundles, columns=columns, rows=rows)
            tracer.fill_radiance(job, bundles, part if macro else None, light)
            if former:
                former.add_light(light, start)
            if writer:
                count = int(frame_of[stop - 1] - frame_of[start]) + 1
                # The first chunk's memory is black already.
                if start and stop - start < count * layout.elements_per_frame:
                    writer.colours.blank(count)
                writer.write(elements[start:stop], light)
        tracing.seconds = watch.seconds["trace"]
        if progress:
            progress(int(stop), len(elements))
        if writer:
            yield Chunk(writer.read()[0], int(frame_of[start]))
    tracing.plane_sums = former.plane_sums() if former else PlaneSums.zeros(slab, [])


def _parts(cuts: np.ndarray) -> list[tuple[int, int]]:
    return list(itertools.pairwise(cuts.tolist()))


def closed_margin(slab: Slab, planes: Sequence[SensorPlane]) -> int:
    """The columns and rows of lens samples along each edge that all apertures stop.

    A multiple of the chunks of columns, so that the rest is traced to the same bits.
    """
    opened = np.logical_or.reduce([plane.mask(slab) for plane in planes])
    if not opened.any():
        return 0
    places = np.argwhere(opened)
    margin = min(int(places.min()), slab.views - 1 - int(places.max()))
    return margin // CHUNK * CHUNK


def chunk_cuts(
    places: np.ndarray, frame_of: np.ndarray | None, rays_each: int, outer: int
) -> np.ndarray:
    """The ends of chunks of about CHUNK_RAYS, among elements at ``places`` (E, 2).

    Chunks have whole frames if ``frame_of`` (E,) has the elements' frames.  Groups of
    ``outer``² elements, which share blocks, stay whole unless chunks would exceed
    MOST_GROWTH.
    """
    total = len(places)
    ends = np.arange(total + 1)
    if frame_of is not None:
        ends = np.append(np.flatnonzero(np.diff(frame_of, prepend=-1)), total)
    whole = ends[_parts_no_group(places, outer)[ends]]
    if np.diff(whole).max(initial=0) * rays_each <= MOST_GROWTH * CHUNK_RAYS:
        ends = whole
    cuts, most = [0], max(1, CHUNK_RAYS // rays_each)
    while cuts[-1] < total:
        last = int(np.searchsorted(ends, cuts[-1] + most, "right")) - 1
        after = int(np.searchsorted(ends, cuts[-1], "right"))
        cuts.append(int(ends[max(last, after)]))
    return np.array(cuts)


def _parts_no_group(places: np.ndarray, outer: int) -> np.ndarray:
    """(E + 1,) bool: whether a cut before element e leaves every group whole."""
    groups = places // outer
    keys, group = ranks(groups[:, 1].astype(np.int64) << 32 | groups[:, 0])
    last = np.zeros(len(keys), np.int64)
    np.maximum.at(last, group, np.arange(len(group)))
    open_until = np.maximum.accumulate(last[group])
    return np.append(True, open_until == np.arange(len(group)))
