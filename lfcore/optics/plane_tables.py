"""Tables for the kernels that form sensor planes: the targets of rays, and the aperture masks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lfcore.optics.plane_sums import offsets, shown, targets
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Rectangle, Slab

BLOCK = 16
"""The rays per side of a block."""
PACKET_COLUMNS = 64
"""The most columns of a packet."""
RUN = np.dtype([("target", np.int32), ("start", np.uint16), ("end", np.uint16)])
"""Columns [start, end) of a packet with one target, which is relative to the packet's first
pixel."""
RUNS = np.dtype([("count", np.int32), ("run", RUN, PACKET_COLUMNS)])
"""The runs of a packet, sorted by target."""
RUN_WORDS = RUNS.itemsize // 4
"""The 32-bit words of RUNS."""
PLANE = np.dtype([("mask", np.int32), ("runs", np.int32), ("stride", np.int32)])
"""A plane: its mask, its offset into ``runs``, and RUNS per group of pixels (0: one for all)."""
PLANE_ARGUMENTS = np.dtype([
    ("left", np.int32),  # region of the sums in pixels of the planes
    ("top", np.int32),
    ("width", np.int32),
    ("height", np.int32),
    ("size", np.int32),  # side M of the square grid of pixels
    ("column", np.int32),  # the pixels of a view: first column and row, and their numbers
    ("row", np.int32),
    ("columns", np.int32),
    ("rows", np.int32),
    ("blocks", np.int32),  # blocks, or rows of stored macropixels, along a side of the lens
    ("views", np.int32),  # side N of the lens
    ("planes", np.int32),  # sorted by mask
    ("ring", np.int32),  # rows of a plane that a strip keeps, a power of two
])  # fmt: skip
"""The arguments of kernels that form planes."""

Corners = tuple[int, int, int, int]
"""First column and row, and the column and row after the last."""


@dataclass(frozen=True)
class PlaneTables:
    """Planes of a slab over a tile of pixels, for packets of lens samples.

    Attributes
    ----------
    order : ndarray
        The kernel's plane k is ``planes[order[k]]``.  Planes with the same mask are neighbours, so
        that they share a packet's prefix sums.
    info : ndarray
        A record PLANE per plane of the kernel.
    runs : ndarray
        int32 words of RUNS, or targets for views.
    masks : ndarray
        (masks, N, N) uint8, indexed [j, i]: 255 where open; padded with 0 to whole packets.
    kinds : ndarray
        (masks, blocks, blocks) uint8: 0 closed, 1 partly open, 2 open.
    left, top, width, height : int
        The region of the planes that the tile's rays can hit.
    """

    order: np.ndarray
    info: np.ndarray
    runs: np.ndarray
    masks: np.ndarray
    kinds: np.ndarray
    left: int
    top: int
    width: int
    height: int

    @property
    def blocks(self) -> int:
        """The rows of blocks, or of strips, of lens samples."""
        return self.kinds.shape[1]

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """The kernel's arguments, in its order."""
        return self.info, self.runs, self.masks, self.kinds


def lens_tables(
    slab: Slab, planes: Sequence[SensorPlane], corners: Corners, group_side: int, side: int
) -> PlaneTables:
    """Tables for a tile of macropixels with the pixels [u0, u1) x [v0, v1) of ``corners``.

    A packet has ``group_side``² pixels and ``side``² blocks of lens samples.
    """
    masks, mask_of = distinct_masks(slab, planes)
    order = np.argsort(mask_of, kind="stable")
    info = np.zeros(len(planes), PLANE)
    records, offset = [], 0
    moves_of = [offsets(slab, planes[plane]) for plane in order]
    for row, (plane, moves) in enumerate(zip(order, moves_of, strict=True)):
        table = run_records(moves, group_side, side * BLOCK)
        info[row] = mask_of[plane], offset, 0 if len(moves) == 1 else table.shape[1]
        records.append(table.reshape(-1).view(np.int32))
        offset += table.size * RUN_WORDS
    runs = np.concatenate(records) if records else np.zeros(0, np.int32)
    beside = -slab.views % (side * BLOCK)
    padded = np.pad(masks, ((0, 0), (0, beside), (0, beside)))
    region = reached_region(slab, planes, moves_of, corners)
    return PlaneTables(order, info, runs, padded, block_kinds(masks), *region)


def reached_region(
    slab: Slab, planes: Sequence[SensorPlane], moves_of: Sequence[np.ndarray], corners: Corners
) -> Rectangle:
    """The pixels that a tile's rays can hit; ``moves_of`` are each plane's :func:`offsets`."""
    u0, v0, u1, v1 = corners
    low, high = [slab.pixels, slab.pixels], [0, 0]
    for moves in moves_of:
        for axis, (first, last) in enumerate(((u0, u1), (v0, v1))):
            part = moves if len(moves) == 1 else moves[first:last]
            pixels = np.arange(first, last)
            low[axis] = min(low[axis], int((pixels + part.min(axis=1)).min()))
            high[axis] = max(high[axis], int((pixels + part.max(axis=1)).max()) + 1)
    picture = shown(slab, planes)
    corner, size = np.array(picture[:2]), np.array(picture[2:])
    (left, top), end = (np.clip(edge, corner, corner + size).tolist() for edge in (low, high))
    return left, top, max(end[0] - left, 0), max(end[1] - top, 0)


def view_tables(slab: Slab, planes: Sequence[SensorPlane]) -> PlaneTables:
    """Tables for views: ``runs`` has the target of every pixel, per plane and lens column."""
    masks, mask_of = distinct_masks(slab, planes)
    order = np.argsort(mask_of, kind="stable")
    info = np.zeros(len(planes), PLANE)
    info["mask"] = mask_of[order]
    info["runs"] = np.arange(len(planes)) * (slab.views * slab.pixels)
    runs = [np.ascontiguousarray(targets(slab, planes[k]).T).reshape(-1) for k in order]
    flat = np.concatenate(runs) if runs else np.zeros(0, np.int32)
    kinds = block_kinds(masks)
    return PlaneTables(order, info, flat, masks, kinds, *shown(slab, planes))


def distinct_masks(slab: Slab, planes: Sequence[SensorPlane]) -> tuple[np.ndarray, np.ndarray]:
    """The planes' different masks, (masks, N, N) uint8 0 or 255, and each plane's mask number."""
    openings = [plane.lens_aperture(slab) for plane in planes]
    plane_of = dict(zip(openings, planes, strict=True))
    bits = {opening: plane.mask(slab).tobytes() for opening, plane in plane_of.items()}
    number = {mask: k for k, mask in enumerate(dict.fromkeys(bits.values()))}
    masks = np.frombuffer(b"".join(number), np.uint8).reshape(-1, slab.views, slab.views) * 255
    return masks, np.array([number[bits[opening]] for opening in openings], np.int64)


def block_kinds(masks: np.ndarray, rows: int = BLOCK) -> np.ndarray:
    """The kinds of blocks of ``rows`` x 16 lens samples: 0 closed, 1 partly open, 2 open.

    Returns (masks, R, C) uint8.  A block that reaches beyond the lens grid is at most partly open.
    Strips have another number of rows, and rows below the grid do not count.
    """
    beside = -masks.shape[1] % BLOCK
    padded = np.pad(masks > 0, ((0, 0), (0, beside if rows == BLOCK else 0), (0, beside)))
    down, across = np.arange(0, padded.shape[1], rows), np.arange(0, padded.shape[2], BLOCK)
    some, every = (
        op.reduceat(op.reduceat(padded, down, axis=1), across, axis=2)
        for op in (np.logical_or, np.logical_and)
    )
    return np.asarray(some + every.astype(np.uint8))


def packet_targets(moves: np.ndarray, group_side: int, span: int) -> np.ndarray:
    """The targets of :func:`offsets`, relative to the first pixel of their group.

    Returns (groups, spans, group_side, span) int32.  Beyond the lens grid and the picture the last
    target is repeated.
    """
    positions, size = moves.shape
    row = np.minimum(np.arange(-(-positions // group_side) * group_side), positions - 1)
    column = np.minimum(np.arange(-(-size // span) * span), size - 1)
    padded = moves[row[:, None], column]
    cells = padded.reshape(-1, group_side, len(column) // span, span).transpose(0, 2, 1, 3)
    return cells + np.arange(group_side, dtype=np.int32)[:, None]


def run_records(moves: np.ndarray, group_side: int, span: int) -> np.ndarray:
    """The runs of equal target: (groups of pixels, spans of lens samples) RUNS.

    Column k * ``span`` + i of a packet is lens sample i of pixel k of its group.
    """
    cells = packet_targets(moves, group_side, span)
    shape, cells = cells.shape[:2], cells.reshape(-1, group_side * span)
    begins = np.ones(cells.shape, bool)
    begins[:, 1:] = cells[:, 1:] != cells[:, :-1]
    count = begins.sum(axis=1)
    row, start = np.nonzero(begins)
    last = np.append(row[1:] != row[:-1], True)
    end = np.where(last, group_side * span, np.roll(start, -1))
    target = cells[row, start]
    by_target = np.lexsort((start, target, row))
    slot = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    records = np.zeros(len(cells), RUNS)
    records["count"] = count
    for name, values in (("target", target), ("start", start), ("end", end)):
        records["run"][name][row, slot] = values[by_target]
    return records.reshape(shape)
