"""Sensor planes on the device while kernels add to them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lfcore.errors import DeviceError
from lfcore.opencl.device import Device
from lfcore.opencl.interface import record
from lfcore.optics.plane_sums import FIXED_ONE, PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.plane_tables import PLANE_ARGUMENTS, PlaneTables

MEMORY_SHARE = 4
"""The sums of one kind take at most 1 / MEMORY_SHARE of a device's memory."""


def workers_that_fit(device: Device, each: int) -> int:
    """The number of workers for which the device's memory holds buffers of ``each`` bytes."""
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

    Each worker has its own sums of 64-bit integers, so the result does not depend on the division
    of work.

    Attributes
    ----------
    one : radiance 1 in sums.
    workers : the number of workers, limited by the device's threads and by its memory.

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
        self.tables = tables
        *_, width, height = tables.region
        self.workers = workers_that_fit(device, len(planes) * height * width * 4 * 8)
        self._shape = (self.workers, len(planes), height, width, 4)
        self._sums = device.zeros(8 * math.prod(self._shape))
        self._tables = {name: device.buffer(array) for name, array in tables.arrays.items()}

    def arguments(self, **rays: float) -> dict[str, Any]:
        """Arguments of the kernels that form planes; ``rays`` are PLANE_ARGUMENTS of the rays."""
        slab, (left, top, width, height) = self.slab, self.tables.region
        column, row, columns, rows = slab.held.pixels
        numbers = record(
            PLANE_ARGUMENTS, left=left, top=top, width=width, height=height, size=slab.pixels,
            column=column, row=row, columns=columns, rows=rows, strips=self.tables.strips,
            views=slab.views, planes=len(self.planes), **rays,
        )  # fmt: skip
        return {"numbers": numbers, "sums": self._sums, **self._tables}

    def collect(self) -> PlaneSums:
        """Read back what was added so far."""
        left, top, width, height = self.tables.region
        sums = np.empty((len(self.planes), 3, height, width), np.uint64)
        if sums.size:
            with self.device.mapped(self._sums, self._shape, np.uint64) as workers:
                for number, plane in enumerate(self.tables.order):
                    of_plane = np.moveaxis(workers[:, number, ..., :3], -1, 1)
                    np.add.reduce(of_plane, axis=0, out=sums[plane])
        return PlaneSums(self.slab, self.planes, sums, left, top, self.one)
