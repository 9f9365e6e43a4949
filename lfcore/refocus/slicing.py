"""Slicing-based refocusing: sensor planes from stored frames (Algorithm 4, thesis section 6.1)."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from lfcore.opencl.device import Device, build_program, cl, open_device, page_aligned
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.plane_tables import view_tables
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.strip_tables import RECORDS, STRIP, strip_tables, table_words
from lfcore.storage.layout import Tile
from lfcore.storage.lightfield import LightFieldFile
from lfcore.timing import Stopwatch
from lfcore.tracing.chunks import placements_of, tile_corners
from lfcore.tracing.header import header
from lfcore.tracing.plane_buffers import PlaneBuffers

CHUNK_BYTES = 64 << 20
"""Decoded frames that are added at a time: enough to keep the device busy, and still in cache."""


class PlaneFormer:
    """Forms sensor planes of a light field from the frames of one tile."""

    def __init__(
        self, slab: Slab, tile: Tile, planes: Sequence[SensorPlane], device: Device | None = None
    ):
        for plane in planes:
            plane.check(slab)
        self.tile, self.device = tile, device or open_device()
        layout, views = tile.layout, tile.layout.kind == "views"
        defines = layout.defines
        if not views:
            # Its rows are of samples, a byte each: sixteen cost less than the eight floats of a
            # register even where they take two.
            defines |= {"STRIP": STRIP, "LANES": 16 if self.device.lanes > 1 else 1}
        file = "refocus/kernels/" + ("slicing_views.cl" if views else "slicing.cl")
        program = build_program(self.device, [file], defines, header(**RECORDS))
        self._kernel = cl.Kernel(program, "form_planes")
        planes = list(planes)
        if views:
            tables, self._words = view_tables(slab, planes), 3 * 256
        else:
            tables = strip_tables(slab, planes, *tile_corners(tile, slab))
            self._words = table_words(slab.views) * (1 if layout.peak is None else 2)
        self._sums = PlaneBuffers(self.device, slab, planes, tables, layout.one)
        self._scratch = self.device.empty(4 * self._words * self._sums.workers)
        self._placements = placements_of(tile, slab)
        if views:
            left, top = layout.corner(slab)
            self._placements["x"] += left
            self._placements["y"] += top
        self._inner = () if views else (np.int32(slab.views),)

    def add(self, frames: np.ndarray, first: int) -> None:
        """Add consecutive frames of the tile: (F, frame_bytes) uint8, the first being number
        ``first``; returns when the device has done with them."""
        layout, device = self.tile.layout, self.device
        start, stop = np.searchsorted(self._placements["frame"], [first, first + len(frames)])
        if start == stop:
            return
        placements = self._placements[start:stop].copy()
        placements["frame"] -= first
        self._kernel(
            device.queue,
            (self._sums.workers,),
            (1,),
            device.shown(np.ascontiguousarray(frames)),
            np.int32(layout.frame_width),
            np.int32(layout.frame_height),
            device.buffer(placements),
            np.int32(len(placements)),
            *self._inner,
            device.buffer(np.zeros(1, np.int32)),
            self._scratch,
            np.int32(self._words),
            *self._sums.arguments(),
        )
        device.queue.finish()

    def plane_sums(self) -> PlaneSums:
        """What was added so far."""
        return self._sums.collect()


def form_planes(
    field: LightFieldFile,
    planes: Sequence[SensorPlane],
    *,
    threads: int | None = None,
    device: Device | str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Retrieval:
    """Form ``planes`` from a stored light field (Algorithm 4), whole segments side by side.

    ``threads`` are the segments decoded at a time, each by one thread that also forms its planes.
    """
    slab = field.require_grid()
    for plane in planes:
        plane.check(slab)
    name = device.name if isinstance(device, Device) else device
    if isinstance(device, Device):
        threads = threads or device.threads
    total_frames, lock, done = sum(part.frames for part in field.segments), threading.Lock(), 0
    threads = max(1, min(threads or open_device(name).threads, len(field.segments)))
    local, watch = threading.local(), Stopwatch()

    def count(frames: int) -> None:
        nonlocal done
        with lock:
            done += frames
            if progress:
                progress(done, total_frames)

    def one(index: int) -> Retrieval:
        if not hasattr(local, "device"):
            local.device = open_device(name, threads=1)
        return _form_segment(field, index, planes, local.device, count)

    with watch.part("whole"):
        with ThreadPoolExecutor(threads) as pool:
            parts = list(pool.map(one, [part.index for part in field.segments]))
        sums = total(slab, list(planes), (part.sums for part in parts))
    return Retrieval(
        sums,
        seconds=watch.seconds["whole"],
        decode_seconds=sum(part.decode_seconds for part in parts),
        plane_seconds=sum(part.plane_seconds for part in parts),
        threads=threads,
    )


@dataclass(frozen=True)
class Retrieval:
    """Planes formed from a file: wall ``seconds``, and seconds of all threads by part."""

    sums: PlaneSums
    seconds: float
    decode_seconds: float
    plane_seconds: float
    threads: int = 1


def _form_segment(
    field: LightFieldFile,
    index: int,
    planes: Sequence[SensorPlane],
    device: Device,
    count: Callable[[int], None],
) -> Retrieval:
    part = field.metadata.segments[index]
    former = PlaneFormer(field.require_slab(), part.tile, planes, device)
    chunk = max(1, CHUNK_BYTES // field.layout.frame_bytes)
    watch, first = Stopwatch(), 0
    room = page_aligned((min(chunk, part.frames), field.layout.frame_bytes), np.uint8)
    decoded = field.video.frames(index, chunk=chunk, rooms=itertools.repeat(room))
    for frames in watch.each("decode", decoded):
        with watch.part("form"):
            former.add(frames, first)
        first += len(frames)
        count(len(frames))
    decode, form = watch.seconds["decode"], watch.seconds["form"]
    return Retrieval(former.plane_sums(), decode + form, decode, form)
