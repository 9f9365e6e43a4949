"""Frames that a device writes: the positions of elements, the memory, and the encoding kernel."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from lfcore.opencl.device import PAGE, Device, cl, page_aligned
from lfcore.opencl.interface import (
    BLOCK,
    FLOAT,
    INT,
    SHARED,
    Interface,
    given,
    read,
    record,
    write,
)
from lfcore.opencl.kernel import Kernel
from lfcore.optics.slab import Ends, Slab
from lfcore.storage.layout import FrameLayout, Tile

if TYPE_CHECKING:
    from lfcore.storage.depth_stream import DepthCodes

PLACEMENT = np.dtype([("frame", INT), ("x", INT), ("y", INT), ("column", INT), ("row", INT)])
"""The position of an element in frames, and its column and row on the outer grid."""
FRAME_FORMAT = np.dtype([
    ("width", INT),
    ("height", INT),
    ("subsampling", INT),  # of chroma: 1 (4:4:4) or 2 (4:2:0, means of 2 x 2)
    ("rgb", INT),
    ("peak", FLOAT),  # light of the brightest code of PQ; 0 for sRGB
])  # fmt: skip
ENCODED_RAYS = np.dtype([
    ("columns", INT),  # of the rays of an element
    ("rows", INT),
    ("first_row", INT),  # of these rows in the whole elements
    ("far", FLOAT),  # the inverse depth of code 0, 1/m
    ("steps", FLOAT),  # codes per dioptre
    ("last_code", FLOAT),
])  # fmt: skip
# light (E, rows, columns, 3) is linear, depth (E, rows, columns) in metres; placements (E,);
# scratch has COLOURS for each work-item.
_ENCODE_ROWS = (
    given(rays="EncodedRays", format="FrameFormat", code_format="FrameFormat")
    | read(light="float", depth="float", placements="Placement", code_placements="Placement")
    | write(frames="sample", codes="CODE", scratch="float")
)
INTERFACE = SHARED | Interface(
    ("storage/kernels",),
    records={
        "Placement": PLACEMENT, "FrameFormat": FRAME_FORMAT, "EncodedRays": ENCODED_RAYS,
    },
    kernels={"encode_rows": _ENCODE_ROWS},
)  # fmt: skip
"""What kernels that read or write frames share with the host."""


def grid_corner(tile: Tile, slab: Slab) -> np.ndarray:
    """Return the element (2,) int32 of the slab's square grid that a tile counts from.

    Tiles of views count from the first lens sample, tiles of pixels from the first stored pixel.
    """
    corner = slab.held.pixels[:2] if tile.layout.kind == "macropixels" else (0, 0)
    return np.array(corner, np.int32)


def tile_ends(tile: Tile, slab: Slab) -> Ends:
    """Return u0, v0, u1, v1 of a tile's elements [u0, u1) x [v0, v1) on the slab's square grid."""
    left, top = (grid_corner(tile, slab) + [tile.column, tile.row]).tolist()
    return left, top, left + tile.columns, top + tile.rows


def placements_of(tile: Tile, slab: Slab) -> np.ndarray:
    """Return (E,) PLACEMENT of a tile's elements, frame after frame."""
    elements = tile.elements()
    placed = np.zeros(len(elements), PLACEMENT)
    placed["frame"], placed["x"], placed["y"] = tile.placement(elements).T
    placed["column"], placed["row"] = (elements + grid_corner(tile, slab)).T
    return placed


class FrameMemory:
    """Page-aligned host memory for frames that the device writes; a CPU writes without a copy."""

    def __init__(self, device: Device, layout: FrameLayout, frames: int):
        self.device, self.layout = device, layout
        size = max(frames * layout.frame_bytes, PAGE)
        self.memory = page_aligned((-(-size // 64) * 64,), np.uint8)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self.buffer = cl.Buffer(device.context, flags, hostbuf=self.memory)
        if frames:
            self.blank(frames)

    def blank(self, count: int) -> None:
        """Make the first ``count`` frames black, with their padding and empty slots."""
        layout = self.layout
        with self.frames(count, write=True) as codes:
            channels = layout.format.views(codes[:1], layout.frame_width, layout.frame_height)
            for channel, code in zip(channels, layout.format.black, strict=True):
                channel[...] = code
            codes[1:] = codes[0]

    def frames(self, count: int, *, write: bool = False) -> AbstractContextManager[np.ndarray]:
        """Return (count, frame_bytes) uint8 for a ``with`` block, in which no kernel may run."""
        shape = count, self.layout.frame_bytes
        return self.device.mapped(self.buffer, shape, np.uint8, write=write)

    def held(self, count: int) -> np.ndarray:
        """Return (count, frame_bytes) uint8, valid until kernels write again."""
        with self.frames(count):  # mapping it once is enough
            return self.memory[: count * self.layout.frame_bytes].reshape(count, -1)

    @property
    def format(self) -> np.ndarray:
        """The size and format of frames, FRAME_FORMAT."""
        layout = self.layout
        return record(
            FRAME_FORMAT, width=layout.frame_width, height=layout.frame_height,
            subsampling=layout.format.subsampling, rgb=layout.format.rgb,
            peak=layout.peak or 0,
        )  # fmt: skip


class FrameWriter:
    """Encodes traced rays into frames on the device: their light and, with ``codes``, their depth.

    Attributes
    ----------
    colours, depths : FrameMemory
        The frames; black where there is no element.  ``depths`` is None without ``codes``.
    count : int
        The number of frames written last.
    """

    def __init__(self, device: Device, tile: Tile, frames: int, codes: DepthCodes | None = None):
        layout, self._device, self._codes = tile.layout, device, codes
        self._tiles = [tile]
        defines: dict[str, object] = {"BITS": layout.format.bits}
        defines["CODE"] = "uchar"
        if codes:
            grey = replace(layout, pixel_format=codes.pixel_format, peak=None)
            self._tiles.append(replace(tile, layout=grey))
            defines["CODE"] = "uchar" if codes.format.bits == 8 else "ushort"
        memory = [FrameMemory(device, part.layout, frames) for part in self._tiles]
        self.colours, self.depths = memory[0], memory[1] if codes else None
        self._memory, self.count = memory, 0
        file = "storage/kernels/encode.cl"
        self._kernel = Kernel(device, [file], "encode_rows", defines, INTERFACE)

    def write(
        self,
        elements: np.ndarray,
        light: np.ndarray,
        depth: np.ndarray | None = None,
        *,
        first_row: int = 0,
    ) -> None:
        """Write rows of ``elements`` (E, 2); their first frame becomes the memory's first.

        ``light`` (E, rows, columns, 3) is linear, ``depth`` (E, rows, columns) in metres; float32.
        """
        device, codes, (count, rows, columns) = self._device, self._codes, light.shape[:3]
        strips, targets = -(-rows // BLOCK), list[tuple]()
        for tile, memory in zip(self._tiles, self._memory, strict=True):
            placed = np.zeros(count, PLACEMENT)
            placed["frame"], placed["x"], placed["y"] = tile.placement(elements).T
            placed["frame"] -= placed["frame"].min()
            targets.append((memory.format, device.buffer(placed), memory.buffer))
        (format_, placements, frames), (code_format, code_placements, code_frames) = (
            targets[0], targets[1] if codes else (np.zeros((), FRAME_FORMAT), None, None),
        )  # fmt: skip
        far, steps = (codes.far, codes.last / (codes.near - codes.far)) if codes else (0, 0)
        numbers = record(
            ENCODED_RAYS,
            columns=columns,
            rows=rows,
            first_row=first_row,
            far=far,
            steps=steps,
            last_code=codes.last if codes else 0,
        )
        self._kernel(
            strips, count, rays=numbers, light=device.shared(np.ascontiguousarray(light)),
            depth=None if depth is None else device.shared(np.ascontiguousarray(depth)),
            format=format_, placements=placements, frames=frames,
            code_format=code_format, code_placements=code_placements, codes=code_frames,
            scratch=device.empty(12 * BLOCK**2 * strips * count),
        )  # fmt: skip
        device.queue.finish()
        self.count = int(placed["frame"].max()) + 1

    def read(self) -> tuple[np.ndarray, ...]:
        """Return the frames of colours and of depths that were written last: (F, frame_bytes) uint8
        each, valid until the next :meth:`write`."""
        return tuple(memory.held(self.count) for memory in self._memory)
