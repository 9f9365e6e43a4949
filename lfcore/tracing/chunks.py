"""Where a tile is cut into chunks, which are traced and handed on one after the other."""

import math
from typing import Any

import numpy as np

from lfcore.tracing.packets import ranks

CHUNK_BYTES = 64 << 20
"""Of frames: those of a chunk and those that its encoder keeps, whatever their size."""
ENCODER_FRAMES, LEAST_FRAMES = 56, 16
"""What x264 keeps at the default settings, in frames handed over; the fewest for a chunk beside
it, since each costs a call of the device."""
GROUPED_SHARE = 2
"""Times CHUNK_BYTES that a chunk may take so as to part no group: of 32 x 32 views of 512 pixels a
row of groups takes 100 MiB, and to trace parted groups twice took twice as long."""
CHUNK_RAYS = 1 << 26


def chunk_cuts(
    layout: Any, elements: np.ndarray, frame_of: np.ndarray | None, group: int
) -> np.ndarray:
    """Where chunks of whole frames begin and end among ``elements`` (E, 2) of a tile.

    ``frame_of`` (E,) has the elements' frames, if any are wanted.  Elements that share a packet of
    ``group`` x ``group`` are not parted, where a chunk has room for all of them.
    """
    total = len(elements)
    starts = np.arange(total + 1)
    step = max(1, CHUNK_RAYS // math.prod(layout.inner))
    if frame_of is not None:
        starts = np.append(np.flatnonzero(np.diff(frame_of, prepend=-1)), total)
        step = CHUNK_BYTES // layout.frame_bytes
        if group == 1:  # else it would part groups, whose rays are then traced twice
            step = max(step - ENCODER_FRAMES, min(step, LEAST_FRAMES))
        step = max(1, step)
    if step >= len(starts) - 1:
        return np.array([0, total])
    whole = starts[_parts_no_group(elements, group)[starts]]
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


def _parts_no_group(elements: np.ndarray, group: int) -> np.ndarray:
    """(E + 1,) bool: whether a cut before element e leaves every group x group cell whole."""
    cells = elements // group
    cell = ranks(cells[:, 1].astype(np.int64) << 32 | cells[:, 0])[1]
    last = np.zeros(cell.max() + 1, np.int64)
    np.maximum.at(last, cell, np.arange(len(cell)))
    open_until = np.maximum.accumulate(last[cell])
    return np.append(True, open_until == np.arange(len(cell)))
