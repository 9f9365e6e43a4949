"""Slicing: sensor planes from traced light (Algorithm 1) or from decoded frames (Algorithm 4).

Source: the thesis, section 6.1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lfcore.opencl.device import Device, open_device
from lfcore.opencl.interface import BLOCK, Interface
from lfcore.opencl.kernel import Kernel
from lfcore.optics.plane_sums import FIXED_ONE, SPARE_STOPS, PlaneSums, one_of_sums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus import fixed_light, strip_tables
from lfcore.refocus.plane_buffers import PlaneBuffers
from lfcore.refocus.plane_tables import PLANE, PLANE_ARGUMENTS, VIEW_KERNEL, view_tables
from lfcore.storage import frame_memory
from lfcore.storage.layout import PQ_ONE, Tile

INTERFACE = (
    fixed_light.INTERFACE
    | strip_tables.INTERFACE
    | Interface(
        records={"SensorPlane": PLANE, "SensorPlaneArguments": PLANE_ARGUMENTS},
        kernels={"form_view_planes": VIEW_KERNEL},
    )
)
"""What kernels that form planes share with the host."""
FILES = {
    "views": ("refocus/kernels/slicing_views.cl", "form_view_planes"),
    "macropixels": ("refocus/kernels/slicing_macropixels.cl", "form_strip_planes"),
}
"""The file and the kernel of each layout."""
BLOCK_WORDS = 3 * BLOCK**2
"""The 32-bit words of a block's colours."""


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
        defines = layout.defines if stops is None else {}
        defines["TRACED"] = int(self._traced)
        wide = layout.peak is not None if stops is None else stops > 0
        if not views:
            # Samples are bytes: 16 lanes are faster than 8, even if they take two registers.
            defines["LANES"] = 16 if self.device.lanes > 1 else 1
            defines["WIDE_SUMS"] = int(wide)
        file, name = FILES[layout.kind]
        self._kernel = Kernel(self.device, [file], name, defines, INTERFACE)
        planes = list(planes)
        if views:
            tables, self._words = view_tables(slab, planes), BLOCK_WORDS
        else:
            ends = frame_memory.tile_ends(tile, slab)
            tables = strip_tables.strip_tables(slab, planes, ends)
            self._words = strip_tables.table_words(slab.views) * (2 if wide else 1)
        one = layout.one if stops is None else one_of_sums(stops)
        decoded = FIXED_ONE if layout.peak is None else PQ_ONE
        self._light = {
            "brightest": 2.0 ** (stops or 0), "coarse": (stops or 0) > SPARE_STOPS,
            "one": decoded if stops is None else one,
        }  # fmt: skip
        self._sums = PlaneBuffers(self.device, slab, planes, tables, one)
        self._scratch = self.device.empty(4 * self._words * self._sums.workers)
        self._placements = frame_memory.placements_of(tile, slab)
        if views and stops is None:
            left, top = layout.corner(slab)
            self._placements["x"] += left
            self._placements["y"] += top

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

        ``light`` is (E, rows, columns, 3) float32, linear.  Macropixels may lack equal numbers of
        whole chunks of lens samples on each side of the lens.
        """
        rows, columns = light.shape[1:3]
        self._run(light, (columns, rows), self._placements[first : first + len(light)])

    def _run(self, rays: np.ndarray, size: tuple[int, int], placements: np.ndarray) -> None:
        device, form = self.device, self.tile.layout.format
        width, height = size
        arguments = self._sums.arguments(
            elements=len(placements), rays_width=width, rays_height=height,
            halved=form.subsampling > 1, is_rgb=form.rgb, scratch_words=self._words,
            **self._light,
        )  # fmt: skip
        self._kernel(
            self._sums.workers, rays=device.shared(np.ascontiguousarray(rays)),
            placements=device.buffer(placements), next=device.writable(np.zeros(1, np.int32)),
            scratch=self._scratch, **arguments,
        )  # fmt: skip
        device.queue.finish()

    def plane_sums(self) -> PlaneSums:
        """The sums of all added frames."""
        return self._sums.collect()
