"""Slicing: sensor planes from traced light (Algorithm 1) or from decoded frames (Algorithm 4).

Source: the thesis, section 6.1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lfcore.opencl.device import Device, build_program, cl, open_device
from lfcore.opencl.interface import Interface
from lfcore.optics.plane_sums import FIXED_ONE, SPARE_STOPS, PlaneSums, one_of_sums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus import strip_tables
from lfcore.refocus.plane_buffers import PlaneBuffers
from lfcore.refocus.plane_tables import PLANE, PLANE_ARGUMENTS, PlaneTables, view_tables
from lfcore.storage import frame_memory
from lfcore.storage.layout import Tile

RECORDS = strip_tables.RECORDS | {"SensorPlane": PLANE, "SensorPlaneArguments": PLANE_ARGUMENTS}
INTERFACE = frame_memory.INTERFACE | Interface(
    ("refocus/kernels",), {"FIXED_ONE": float(FIXED_ONE), "SPARE_STOPS": SPARE_STOPS}, RECORDS
)
"""What kernels that form planes share with the host."""


class PlaneFormer:
    """Forms sensor planes of the rays of one tile, from decoded frames or from traced light.

    Parameters
    ----------
    stops : of traced light, the stops above white of the brightest ray; None for frames.
    """

    def __init__(
        self,
        slab: Slab,
        tile: Tile,
        planes: Sequence[SensorPlane],
        device: Device | None = None,
        *,
        stops: int | None = None,
    ):
        for plane in planes:
            plane.check(slab)
        self.tile, self.device, self._traced = tile, device or open_device(), stops is not None
        layout, views = tile.layout, tile.layout.kind == "views"
        defines: dict[str, int] = layout.defines | {"TRACED": 0}
        if stops is not None:
            defines = {"TRACED": 1, "STOPS": stops}
        if not views:
            # Samples are bytes: 16 lanes are faster than 8, even if they take two registers.
            lanes = 16 if self.device.lanes > 1 else 1
            defines |= {"STRIP": strip_tables.STRIP, "LANES": lanes}
        file = "refocus/kernels/" + ("slicing_views.cl" if views else "slicing.cl")
        program = build_program(self.device, [file], defines, INTERFACE)
        self._kernel = cl.Kernel(program, "form_planes")
        planes, wide = list(planes), layout.peak is not None if stops is None else stops > 0
        tables: PlaneTables
        if views:
            tables, self._words = view_tables(slab, planes), 3 * 256
        else:
            corners = frame_memory.tile_corners(tile, slab)
            tables = strip_tables.strip_tables(slab, planes, *corners)
            self._words = strip_tables.table_words(slab.views) * (2 if wide else 1)
        one = layout.one if stops is None else one_of_sums(stops)
        self._sums = PlaneBuffers(self.device, slab, planes, tables, one)
        self._scratch = self.device.empty(4 * self._words * self._sums.workers)
        self._placements = frame_memory.placements_of(tile, slab)
        if views and stops is None:
            left, top = layout.corner(slab)
            self._placements["x"] += left
            self._placements["y"] += top
        self._inner = () if views else (np.int32(slab.views),)

    def add(self, frames: np.ndarray, first: int) -> None:
        """Add consecutive frames (F, frame_bytes) uint8 of the tile, from number ``first`` on.

        Returns when the device no longer reads them.
        """
        layout = self.tile.layout
        start, stop = np.searchsorted(self._placements["frame"], [first, first + len(frames)])
        if start == stop:
            return
        placements = self._placements[start:stop].copy()
        placements["frame"] -= first
        self._run(frames, (layout.frame_width, layout.frame_height), placements)

    def add_light(self, light: np.ndarray, first: int) -> None:
        """Add consecutive elements of the tile, the first being number ``first``.

        ``light`` is (E, rows, columns, 3) float32, linear.  Of macropixels it may be the middle of
        the lens, without as many whole chunks of lens samples on each side.
        """
        rows, columns = light.shape[1:3]
        size = columns, rows
        if self.tile.layout.kind == "macropixels":
            size = (self.tile.layout.views - rows) // 2, rows
        self._run(light, size, self._placements[first : first + len(light)])

    def _run(self, rays: np.ndarray, size: tuple[int, int], placements: np.ndarray) -> None:
        device = self.device
        self._kernel(
            device.queue, (self._sums.workers,), (1,), device.shown(np.ascontiguousarray(rays)),
            np.array(size, np.int32),
            device.buffer(placements), np.int32(len(placements)), *self._inner,
            device.buffer(np.zeros(1, np.int32)), self._scratch, np.int32(self._words),
            *self._sums.arguments(),
        )  # fmt: skip
        device.queue.finish()

    def plane_sums(self) -> PlaneSums:
        """The sums of all added frames."""
        return self._sums.collect()
