"""Radiance of bundles as floats, written by the device straight to where the caller wants it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lfcore.opencl.device import Device, cl
from lfcore.optics.bundles import Bundles
from lfcore.tracing.work import Groups

if TYPE_CHECKING:
    from lfcore.tracing.tracer import Tracer

CHUNK_RAYS = 1 << 24
"""Rays whose radiance a device with memory of its own holds at a time."""
LAUNCH_RAYS = 1 << 22
"""Rays of one launch: progress is told between launches."""
STREAM_BYTES = 32 << 20
"""Results larger than this go past the caches, which would not hold them until they are read."""
PAGE = 4096
ADD, STREAM = 1, 2  # of the kernel's mode


def page_aligned(shape: Sequence[int]) -> np.ndarray:
    """An uninitialised float32 array that begins a page: drivers use such memory as it is."""
    count = int(np.prod(shape, dtype=np.int64))
    raw = np.empty(4 * count + PAGE, np.uint8)
    offset = -raw.ctypes.data % PAGE
    return raw[offset : offset + 4 * count].view(np.float32).reshape(shape)


class RadianceJob:
    """Launches that make one image out of sets of bundles, ``across`` elements to a row of tiles.

    Parameters
    ----------
    sets : bundles of as many elements and equal inner grids, whose radiance is added up.
    coordinates : of the elements, as for :meth:`Tracer.bundle_hits`.
    across : element e is tile (e // across, e % across).
    """

    def __init__(self, tracer: Tracer, sets: Sequence[Bundles], coordinates, across: int):
        self.tracer, self.sets, self.across = tracer, list(sets), across
        self.coordinates = coordinates
        grouped = coordinates is not None
        self.shape = tracer.beam_shape(self.sets[0], "radiance", grouped=grouped)
        defines = tracer._surfaces.defines
        self.kernel = tracer._beam_kernel("radiance.cl", "trace_radiance", self.shape, defines)
        self.scratch = tracer._scratch(self.kernel)

    def run(self, image: np.ndarray, progress: Callable[[int, int], None] | None = None) -> None:
        """Write ``image``, (E / across rows, across columns, 3) float32 contiguous."""
        if not image.flags.c_contiguous or image.dtype != np.float32:
            raise ValueError("radiance needs contiguous memory of float32")
        first, device = self.sets[0], self.tracer.device
        count = len(first.elements)
        row_of_tiles = self.across * first.rows * first.columns
        # A CPU writes the host's own memory; nothing is copied, so nothing need be cut.
        rows = max(1, count if device.is_cpu else CHUNK_RAYS // max(1, row_of_tiles))
        step, flat = rows * self.across, image.reshape(-1)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            size = 3 * first.rows * first.columns
            piece = flat[part.start * size : part.stop * size]
            tell = progress if step >= count else None
            self._chunk(part, piece, tell)
            if progress and tell is None:
                progress(part.stop, count)

    def _chunk(self, part: slice, piece: np.ndarray, progress) -> None:
        """Trace elements of whole rows of tiles into their contiguous piece of the image."""
        device = self.tracer.device
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        target = (
            cl.Buffer(device.context, flags, hostbuf=piece)
            if device.is_cpu
            else device.empty(piece.nbytes)
        )
        first, shape = self.sets[0], self.shape
        places = None if self.coordinates is None else self.coordinates[part]
        beams = Groups.of(shape, first.part(part), places).members
        each = shape.blocks * 256 * shape.squares(first.columns, first.rows)
        step = max(1, LAUNCH_RAYS // each)
        stream = STREAM if piece.nbytes > STREAM_BYTES else 0
        for start in range(0, len(beams), step):
            for number, bundles in enumerate(self.sets):
                mode = stream | (ADD if number else 0)
                groups = Groups(beams[start : start + step], bundles.elements[part])
                self._launch(bundles, groups, target, mode)
            if progress:
                device.queue.finish()
                progress(min(start + step, len(beams)), len(beams))
        _collect(device, target, piece)

    def _launch(self, bundles: Bundles, groups: Groups, target: cl.Buffer, mode: int) -> None:
        tracer, surfaces = self.tracer, self.tracer._surfaces
        self.kernel(
            tracer.device.queue,
            (tracer._workers(len(groups.members)),),
            (1,),
            *tracer._bvh,
            *tracer._scene,
            surfaces.ambient,
            surfaces.background,
            *tracer._ray_arguments(bundles, groups, self.shape),
            np.float32(bundles.pixel_pitch),
            tracer._counter(),
            self.scratch,
            np.int32(self.across),
            np.int32(mode),
            target,
        )


def _collect(device: Device, target: cl.Buffer, host: np.ndarray) -> None:
    """Make what the device wrote visible in ``host``; waits for the queue."""
    if not device.is_cpu:
        cl.enqueue_copy(device.queue, host, target)
        return
    view, _ = cl.enqueue_map_buffer(
        device.queue, target, cl.map_flags.READ, 0, host.shape, host.dtype
    )
    view.base.release(device.queue)
    device.queue.finish()
