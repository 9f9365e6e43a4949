"""A tile's elements: their placement on the grid and in frames, how they are cut into chunks, which
are traced and handed on one after the other, and a chunk's memory."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore.opencl.device import PAGE, Device, cl, page_aligned
from lfcore.optics.slab import Slab
from lfcore.tracing.layouts import FRAME_ARGUMENTS, PLACEMENT, record
from lfcore.tracing.packets import ranks

if TYPE_CHECKING:
    from lfcore.storage.layout import FrameLayout, Tile

CHUNK_BYTES = 64 << 20
"""Of frames: those of a chunk and those that its encoder keeps, whatever their size."""
ENCODER_FRAMES, LEAST_FRAMES = 56, 16
"""What x264 keeps at the default settings, in frames handed over; the fewest for a chunk beside
it, since each costs a call of the device."""
GROUPED_SHARE = 2
"""Times CHUNK_BYTES that a chunk may take so as to part no group: of 32 x 32 views of 512 pixels a
row of groups takes 100 MiB, and to trace parted groups twice took twice as long."""
CHUNK_RAYS = 1 << 26


def grid_corner(tile: Tile, slab: Slab) -> np.ndarray:
    """(2,) int32: what a tile's columns and rows count from, on the slab's square grids.

    Tiles of views count from the first lens sample, and tiles of pixels from the first that is
    there.
    """
    corner = slab.held.pixels[:2] if tile.layout.kind == "macropixels" else (0, 0)
    return np.array(corner, np.int32)


def tile_corners(tile: Tile, slab: Slab) -> tuple[int, int, int, int]:
    """The elements [u0, u1) x [v0, v1) of a tile on the slab's square grid: u0, v0, u1, v1."""
    left, top = (grid_corner(tile, slab) + [tile.column, tile.row]).tolist()
    return left, top, left + tile.columns, top + tile.rows


def placements_of(tile: Tile, slab: Slab, *, frames: bool = True) -> np.ndarray:
    """(E,) PLACEMENT of a tile's elements, frame after frame; without ``frames`` only columns and
    rows on the slab's square grid."""
    elements = tile.elements()
    placed = np.zeros(len(elements), PLACEMENT)
    if frames:
        placed["frame"], placed["x"], placed["y"] = tile.placement(elements).T
    placed["column"], placed["row"] = (elements + grid_corner(tile, slab)).T
    return placed


def chunk_cuts(
    layout: Any, elements: np.ndarray, frame_of: np.ndarray | None, group_side: int
) -> np.ndarray:
    """Where chunks of whole frames begin and end among ``elements`` (E, 2) of a tile.

    ``frame_of`` (E,) has the elements' frames, if any are wanted.  Groups of ``group_side``², which
    share a packet, are not parted where a chunk has room for all of their elements.
    """
    total = len(elements)
    starts = np.arange(total + 1)
    step = max(1, CHUNK_RAYS // math.prod(layout.inner))
    if frame_of is not None:
        starts = np.append(np.flatnonzero(np.diff(frame_of, prepend=-1)), total)
        step = CHUNK_BYTES // layout.frame_bytes
        if group_side == 1:  # else it would part groups, whose rays are then traced twice
            step = max(step - ENCODER_FRAMES, min(step, LEAST_FRAMES))
        step = max(1, step)
    if step >= len(starts) - 1:
        return np.array([0, total])
    whole = starts[_parts_no_group(elements, group_side)[starts]]
    if frame_of is not None:
        grouped = int(np.diff(np.searchsorted(starts, whole)).max())
        if grouped * layout.frame_bytes <= GROUPED_SHARE * CHUNK_BYTES:
            step = max(step, grouped)
    cuts, at = [0], 0
    while cuts[-1] < total:
        furthest = starts[min(at + step, len(starts) - 1)]
        best = whole[np.searchsorted(whole, furthest, "right") - 1]
        cuts.append(int(best if best > cuts[-1] else furthest))
        at = int(np.searchsorted(starts, cuts[-1]))
    return np.array(cuts)


def _parts_no_group(elements: np.ndarray, group_side: int) -> np.ndarray:
    """(E + 1,) bool: whether a cut before element e leaves every group whole."""
    groups = elements // group_side
    group = ranks(groups[:, 1].astype(np.int64) << 32 | groups[:, 0])[1]
    last = np.zeros(group.max() + 1, np.int64)
    np.maximum.at(last, group, np.arange(len(group)))
    open_until = np.maximum.accumulate(last[group])
    return np.append(True, open_until == np.arange(len(group)))


@dataclass(frozen=True)
class Chunk:
    """Consecutive frames of a tile.

    ``frames`` is (F, frame_bytes) uint8, valid until the next chunk is asked for; ``first`` is the
    number of its first frame within the tile.
    """

    frames: np.ndarray
    first: int


class FrameMemory:
    """Page-aligned host memory that the device writes frames into, without a copy on a CPU."""

    def __init__(self, device: Device, layout: FrameLayout, frames: int):
        self.device, self.layout = device, layout
        size = max(frames * layout.frame_bytes, PAGE)
        self.memory = page_aligned((-(-size // 64) * 64,), np.uint8)
        flags = cl.mem_flags.READ_WRITE | cl.mem_flags.USE_HOST_PTR
        self.buffer = cl.Buffer(device.context, flags, hostbuf=self.memory)
        if frames:
            self.blank(frames)

    def blank(self, count: int) -> None:
        """Make padding and empty slots of the first frames black, whatever memory held."""
        layout = self.layout
        with self.frames(count, write=True) as codes:
            channels = layout.format.views(codes[:1], layout.frame_width, layout.frame_height)
            for channel, code in zip(channels, layout.format.black, strict=True):
                channel[...] = code
            codes[1:] = codes[0]

    def frames(self, count: int, *, write: bool = False) -> AbstractContextManager[np.ndarray]:
        """(count, frame_bytes) uint8 within a ``with`` block, in which no kernel may run."""
        shape = count, self.layout.frame_bytes
        return self.device.mapped(self.buffer, shape, np.uint8, write=write)

    def held(self, count: int) -> np.ndarray:
        """The same, which is valid until kernels write again."""
        with self.frames(count):  # to map it is enough
            return self.memory[: count * self.layout.frame_bytes].reshape(count, -1)

    @property
    def arguments(self) -> np.ndarray:
        """Size and format of the frames, for kernels."""
        layout = self.layout
        return record(
            FRAME_ARGUMENTS, width=layout.frame_width, height=layout.frame_height,
            subsampling=layout.format.subsampling, rgb=layout.format.rgb,
        )  # fmt: skip
