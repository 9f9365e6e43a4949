"""Tables for forming sensor planes from macropixels, traced or stored, by strips of lens rows.

A summed-area table has STRIP rows of a macropixel and its whole width: a plane needs few look-ups,
and the table fits in the second-level cache.  A *run* is the lens samples of an axis that hit one
pixel.  Runs end at multiples of STRIP rows, where the next table begins, and of MOST_COLUMNS
columns, so that sums fit in 32 bits.
"""

from collections.abc import Sequence

import numpy as np

from lfcore.opencl.interface import INT, Interface, read
from lfcore.optics.plane_sums import offsets
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Ends, Slab
from lfcore.refocus import plane_tables
from lfcore.refocus.plane_tables import PlaneTables, distinct_masks, reached_region

STRIP = 32
"""The lens rows of a table."""
CHUNK = 16
"""The number of columns that share one kind: open, partly open or closed."""
MOST_COLUMNS = 112
"""The most columns of a run: STRIP * MOST_COLUMNS samples of at most 2^20 are less than 2^32."""
TABLE_LEAD = 3
"""Entries before the 0 of a table's row, so that its sums begin at a multiple of 64 bytes."""
TABLE_PADDING = 68
"""Entries of a table's row that are no sums: TABLE_LEAD before the sums, and others behind them, so
that rows do not share sets of the cache."""
PLANE = np.dtype([("mask", INT), ("columns", INT), ("rows", INT), ("per_pixel", INT)])
"""A plane: its mask, its first pointers of columns and of rows, and whether each pixel has its own
runs, as with magnification."""
RUN = np.dtype([("end", INT), ("target", INT)])
"""A run: its end, and the offset to its target pixel.  The end is the lens column after its last,
or the table's row of its last lens row."""
TABLE_ROWS = np.dtype([("count", INT), ("end", INT, STRIP)])
"""The rows of a strip's table; each sums the strip's lens rows before its end."""
KERNEL = plane_tables.KERNEL | read(
    planes="StripPlane", pointers="int", runs="StripRun", kinds="uchar", table_rows="TableRows"
)
"""The parameters of the kernel, with the tables of :func:`strip_tables`."""
INTERFACE = Interface(
    constants={
        "STRIP": STRIP, "CHUNK": CHUNK, "TABLE_LEAD": TABLE_LEAD, "TABLE_PADDING": TABLE_PADDING,
    },
    records={"StripPlane": PLANE, "StripRun": RUN, "TableRows": TABLE_ROWS},
    kernels={"form_strip_planes": KERNEL},
)  # fmt: skip
"""What ``slicing_macropixels.cl`` alone shares with the host."""


def table_words(views: int) -> int:
    """The 32-bit words of a summed-area table: four per entry.

    A multiple of 16, so that each worker's table begins at a cache line.
    """
    return 4 * (STRIP + 1) * (-(-views // CHUNK) * CHUNK + TABLE_PADDING)


def strip_tables(slab: Slab, planes: Sequence[SensorPlane], ends: Ends) -> PlaneTables:
    """Tables for the macropixels of a tile of pixels, by strips of lens rows.

    ``planes`` (P,) are PLANE, ``runs`` (R,) RUN, ``table_rows`` (masks, strips) TABLE_ROWS.
    ``kinds`` (masks, strips, chunks) uint8 are those of 16 columns of a strip: 0 closed, 1 partly
    open, 2 open.  ``pointers`` are int32 lists: per pixel, or once for all, the first of its runs
    of columns; per pixel and strip the first of its runs of rows.  A list ends with the run after
    its last.
    """
    masks, mask_of = distinct_masks(slab, list(planes))
    order = np.argsort(mask_of, kind="stable")
    records = np.zeros(len(planes), PLANE)
    moves_of = [offsets(slab, planes[plane]) for plane in order]
    columns = [runs_of(moves, MOST_COLUMNS, slab.views) for moves in moves_of]
    rows = [runs_of(moves, STRIP, STRIP) for moves in moves_of]
    numbered = table_rows(mask_of[order], [runs for _, runs in rows], slab.views, len(masks))
    pointers, runs = [np.zeros(0, np.int32)], [np.zeros(0, RUN)]
    pointed = used = 0
    records["mask"] = mask_of[order]
    records["per_pixel"] = [len(moves) > 1 for moves in moves_of]
    for row in range(len(planes)):
        for axis, (starts, axis_runs) in (("columns", columns[row]), ("rows", rows[row])):
            records[axis][row] = pointed
            pointers.append(starts + used)
            runs.append(axis_runs)
            pointed, used = pointed + len(starts), used + len(axis_runs)
    arrays = {
        "planes": records, "runs": np.concatenate(runs), "masks": masks,
        "kinds": chunk_kinds(masks), "table_rows": numbered,
        "pointers": np.concatenate(pointers).astype(np.int32),
    }  # fmt: skip
    region = reached_region(slab, planes, moves_of, ends)
    return PlaneTables(order, region, arrays, strips=numbered.shape[1])


def chunk_kinds(masks: np.ndarray) -> np.ndarray:
    """The kinds of chunks, (masks, strips, chunks) uint8: 0 closed, 1 partly open, 2 open.

    A chunk that reaches beyond the lens grid is at most partly open.
    """
    size = masks.shape[1]
    padded = np.pad(masks > 0, ((0, 0), (0, 0), (0, -size % CHUNK)))
    down, across = np.arange(0, size, STRIP), np.arange(0, padded.shape[2], CHUNK)
    some, every = (
        op.reduceat(op.reduceat(padded, down, axis=1), across, axis=2)
        for op in (np.logical_or, np.logical_and)
    )
    return np.asarray(some + every.astype(np.uint8))


def table_rows(mask_of: np.ndarray, runs_of_rows: list, size: int, masks: int) -> np.ndarray:
    """The rows that each strip's table needs: ``table_rows`` of :func:`strip_tables`.

    ``mask_of`` has the mask of each plane, ``runs_of_rows`` its runs (R,), which are changed: the
    end of a run, a lens row, becomes the number of the table's row that ends there, from 1.
    """
    strips = -(-size // STRIP)
    needed = np.zeros((masks, strips * STRIP), bool)
    for mask, runs in zip(mask_of, runs_of_rows, strict=True):
        needed[mask, runs["end"] - 1] = True
    numbers = np.cumsum(needed.reshape(masks, strips, STRIP), axis=2, dtype=np.int32)
    for mask, runs in zip(mask_of, runs_of_rows, strict=True):
        runs["end"] = numbers[mask].reshape(-1)[runs["end"] - 1]
    rows = np.zeros((masks, strips), TABLE_ROWS)
    rows["count"] = numbers[:, :, -1]
    mask, strip, row = np.nonzero(needed.reshape(masks, strips, STRIP))
    rows["end"][mask, strip, numbers[mask, strip, row] - 1] = row + 1
    return rows


def runs_of(moves: np.ndarray, step: int, each: int) -> tuple[np.ndarray, np.ndarray]:
    """The runs of equal offset in ``moves`` (positions, N), cut at multiples of ``step``.

    Returns the first run of every ``each`` samples of each position, and the number of runs,
    (positions * ceil(N / each) + 1,); and the runs (R,) RUN.
    """
    positions, size = moves.shape
    begins = np.ones(moves.shape, bool)
    begins[:, 1:] = moves[:, 1:] != moves[:, :-1]
    begins[:, ::step] = True
    row, column = np.nonzero(begins)
    ends = np.append(column[1:], 0)
    ends[ends == 0] = size
    lists = -(-size // each)
    starts = np.searchsorted(row * lists + column // each, np.arange(positions * lists + 1))
    runs = np.zeros(len(row), RUN)
    runs["end"], runs["target"] = ends, moves[row, column]
    return starts, runs
