"""Sensor planes on the device while kernels add to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore.errors import DeviceError
from lfcore.opencl.device import Device
from lfcore.optics.plane_sums import FIXED_ONE, SPARE_STOPS, PlaneSums, offsets, one_of_sums
from lfcore.optics.plane_tables import (
    PLANE_ARGUMENTS,
    PlaneTables,
    lens_tables,
    packet_targets,
    view_tables,
)
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.tracing.chunks import tile_corners
from lfcore.tracing.layouts import BLOCK, PACKET_COLUMNS, PLANES, record
from lfcore.tracing.packets import PacketShape

if TYPE_CHECKING:
    from lfcore.storage.layout import Tile
    from lfcore.tracing.device_scene import DeviceScene

MEMORY_SHARE = 4
"""Sums of one kind take at most one part in this many of a device's memory."""


def workers_that_fit(device: Device, each: int) -> int:
    """How many of a device's workers its memory holds buffers of ``each`` bytes for."""
    limits = device.device
    room = min(limits.max_mem_alloc_size, limits.global_mem_size // MEMORY_SHARE)
    if each > room:
        raise DeviceError(
            f"sums of planes take {each / 2**30:.1f} GiB, and {device.name} has room for "
            f"{room / 2**30:.1f}",
            remedy="Ask for fewer planes at a time, or for fewer pixels",
        )
    return min(device.threads, room // max(each, 1))


class PlaneBuffers:
    """Tables and accumulators of ``planes`` for the rays of one tile of a light field.

    Every worker adds to sums of its own, 64-bit integers, so that no two ever meet and the
    result does not depend on who added what.

    Attributes
    ----------
    one : radiance 1 in sums.
    workers : how many may add; fewer than the device's threads where its memory holds no more sums.

    Raises
    ------
    DeviceError : the sums of one worker are too large for the device.
    """

    def __init__(
        self,
        device: Device,
        slab: Slab,
        planes: list[SensorPlane],
        tables: PlaneTables,
        one: float = FIXED_ONE,
    ):
        self.device, self.slab, self.planes, self.one = device, slab, planes, one
        self.tables = t = tables
        self.workers = workers_that_fit(device, len(planes) * t.height * t.width * 4 * 8)
        self._shape = (self.workers, len(planes), t.height, t.width, 4)
        self._sums = device.zeros(8 * math.prod(self._shape))
        self._tables = [device.buffer(a) for a in t.arrays]

    def arguments(self, ring: int = 1) -> list:
        """PLANE_ARGUMENTS, tables and sums: the last arguments of the kernels that form planes."""
        t, slab = self.tables, self.slab
        column, row, columns, rows = slab.held.pixels
        numbers = record(
            PLANE_ARGUMENTS, left=t.left, top=t.top, width=t.width, height=t.height,
            size=slab.pixels, column=column, row=row, columns=columns, rows=rows,
            blocks=t.blocks, views=slab.views, planes=len(self.planes),
            ring=ring,
        )  # fmt: skip
        return [numbers, *self._tables, self._sums]

    def collect(self) -> PlaneSums:
        """Read back what was added so far."""
        t = self.tables
        sums = np.empty((len(self.planes), 3, t.height, t.width), np.uint64)
        if sums.size:
            with self.device.mapped(self._sums, self._shape, np.uint64) as workers:
                for number, plane in enumerate(t.order):
                    of_plane = np.moveaxis(workers[:, number, ..., :3], -1, 1)
                    np.add.reduce(of_plane, axis=0, out=sums[plane])
        return PlaneSums(self.slab, self.planes, sums, t.left, t.top, self.one)


STRIP_PACKETS = 8
"""Packets in a strip, measured: there is little left to save.  Sums of 32 bits would hold 63,
and half as many per stop above white."""
ITEMS_A_WORKER = 8
"""Strips that each worker gets at least, lest some wait for others."""


class StripBuffers:
    """Sums of strips, packets of pixels one below the other, before they go to the planes' pixels.

    Attributes
    ----------
    height : packets in a strip; 1 where there is nothing to sum, or for few ``elements``.
    ring : rows of a plane that are kept, a power of two.
    workers : how many may sum, at most as many as ``sums`` has room for.
    sums : of the planes' pixels.
    """

    def __init__(
        self, sums: PlaneBuffers, shape: PacketShape, views: int, elements: int, stops: int = 0
    ):
        self.sums = sums
        device, planes = sums.device, len(sums.planes)
        per_group = shape.packets_per_group(views, views)
        packets = elements // shape.elements * per_group if planes else 0
        self.height = min(max(1, packets // (sums.workers * ITEMS_A_WORKER)), STRIP_PACKETS)
        self.height = min(self.height, 1 << max(SPARE_STOPS - stops, 0))
        span = shape.cells_per_side * BLOCK
        reached = strip_rows(sums.slab, sums.planes, self.height * shape.group_side, span)
        self.ring = 1 << (min(reached, sums.slab.pixels) - 1).bit_length()
        row = planes, self.ring, 3, PACKET_COLUMNS
        self.workers = min(sums.workers, workers_that_fit(device, 4 * math.prod(row)))
        windows = np.empty((self.workers, planes, 2), np.int32)
        windows[:] = np.iinfo(np.int32).max, 0
        rows = np.zeros((self.workers, *row), np.uint32)
        self._buffers = [device.changed(a) for a in (windows, rows)]

    def arguments(self) -> dict[str, Any]:
        """The arguments PLANES of the sink FRAMES."""
        values = *self.sums.arguments(self.ring), *self._buffers
        return dict(zip(PLANES, values, strict=True))


def tile_strips(
    scene: DeviceScene, shape: PacketShape, slab: Slab, tile: Tile, planes: Sequence[SensorPlane]
) -> StripBuffers:
    """Sums of ``planes`` over the rays of a tile."""
    macro = tile.layout.kind == "macropixels"
    if macro:
        corners, side = tile_corners(tile, slab), shape.cells_per_side
        tables = lens_tables(slab, planes, corners, shape.group_side, side)
    else:
        tables = view_tables(slab, planes)
    sums = PlaneBuffers(scene.device, slab, list(planes), tables, one_of_sums(scene.stops))
    summed = tile.element_count if macro else 0
    return StripBuffers(sums, shape, slab.views, summed, scene.stops)


def strip_rows(slab: Slab, planes: list[SensorPlane], pixels: int, span: int) -> int:
    """Most rows of one of ``planes``, from first to last, that the rays of a strip fall on.

    A strip is ``pixels`` rows of pixels times ``span`` rows of lens samples, the first of each a
    multiple of their number; what is beside the picture or the lens counts as the kernels' tables
    have it.
    """
    most = 1
    for plane in planes:
        reached = packet_targets(offsets(slab, plane), pixels, span)
        most = max(most, int(np.ptp(reached, axis=(2, 3)).max()) + 1)
    return most
