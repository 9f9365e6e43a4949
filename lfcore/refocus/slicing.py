"""Sensor planes from a stored light field (Algorithm 4, thesis section 6.1)."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from lfcore.opencl.device import Device, open_device, page_aligned
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.planes import SensorPlane
from lfcore.refocus.plane_former import PlaneFormer
from lfcore.storage.lightfield import LightFieldFile
from lfcore.timing import Stopwatch

CHUNK_BYTES = 64 << 20
"""The decoded frames that are added at a time: enough for the device, and still in the cache."""


def form_planes(
    field: LightFieldFile,
    planes: Sequence[SensorPlane],
    *,
    threads: int | None = None,
    device: Device | str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Retrieval:
    """Form planes of a stored light field (Algorithm 4), several segments at a time.

    Each of ``threads`` decodes a segment and forms its planes.
    """
    slab = field.require_grid()
    for plane in planes:
        plane.check(slab)
    opened = device if isinstance(device, Device) else open_device(device)
    total_frames, lock, done = sum(part.frames for part in field.segments), threading.Lock(), 0
    threads = max(1, min(threads or opened.threads, len(field.segments)))
    local, watch = threading.local(), Stopwatch(clock=opened.clock)

    def count(frames: int) -> None:
        nonlocal done
        with lock:
            done += frames
            if progress:
                progress(done, total_frames)

    def form(index: int) -> Retrieval:
        if not hasattr(local, "device"):
            local.device = open_device(opened.name, threads=1)
        return _form_segment(field, index, planes, local.device, count)

    with watch.part("whole"):
        with ThreadPoolExecutor(threads) as pool:
            parts = list(pool.map(form, [part.index for part in field.segments]))
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
    """Planes of a file, with seconds by the device's clock, and wall seconds of decoding and of
    forming, summed over threads."""

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
