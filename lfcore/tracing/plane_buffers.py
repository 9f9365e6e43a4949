"""Sensor planes on the device while kernels add to them."""

from __future__ import annotations

import numpy as np

from lfcore.opencl.device import Device, cl
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.plane_tables import PlaneTables, lens_tables, view_tables
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab


def plane_tables(slab: Slab, planes: list[SensorPlane], tile) -> PlaneTables:
    """Tables for the kernels that add rays block by block."""
    if tile.layout.kind == "views":
        return view_tables(slab, planes)
    right, bottom = tile.column + tile.columns, tile.row + tile.rows
    return lens_tables(slab, planes, tile.column, tile.row, right, bottom)


class PlaneBuffers:
    """Tables and accumulators of ``planes`` for the rays of one tile of a light field.

    Every worker adds to sums of its own, 64-bit integers, so that no two ever meet and the
    result does not depend on who added what.
    """

    def __init__(
        self, device: Device, slab: Slab, planes: list[SensorPlane], tile, tables=plane_tables
    ):
        self.device, self.slab, self.planes = device, slab, planes
        self.tables = t = tables(slab, planes, tile)
        shape = (device.threads, len(planes), t.height, t.width, 4)
        self._host = np.zeros(shape if planes else (0,), np.uint64)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
        content = self._host if self._host.nbytes else bytes(64)
        self._sums = cl.Buffer(device.context, flags, hostbuf=content)
        self._tables = [device.buffer(a) for a in t.arrays]

    def arguments(self) -> list:
        """The kernels' last arguments, from ``n_planes`` on."""
        t, slab = self.tables, self.slab
        region = [t.left, t.top, t.width, t.height, slab.pixels, t.blocks, slab.views, 0]
        return [np.int32(len(self.planes)), np.array(region, np.int32), *self._tables, self._sums]

    def collect(self) -> PlaneSums:
        """Read back what was added so far."""
        t = self.tables
        sums = np.empty((len(self.planes), 3, t.height, t.width), np.uint64)
        if self.planes:
            cl.enqueue_copy(self.device.queue, self._host, self._sums)
            total = self._host.sum(axis=0, dtype=np.uint64)
            sums[t.order] = np.moveaxis(total[..., :3], -1, 1)
        return PlaneSums(self.slab, self.planes, sums, t.left, t.top)
