"""The index of a light field file: the frames of each tile, as one array of numbers.

A file may have a hundred thousand segments, so objects are created only on access.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np

from lfcore.errors import StorageError
from lfcore.optics.slab import Rectangle
from lfcore.storage.layout import FrameLayout, Tile

COLUMN, ROW, COLUMNS, ROWS, FIRST, FRAMES, BYTES, CRC32 = range(8)
"""The columns of an index."""


@dataclass(frozen=True)
class Segment:
    """The frames of one tile in the file.

    Attributes
    ----------
    index : int
        The segment's place in the index that it was taken from; a slice counts from 0 again.
    tile : Tile
        The tile.
    first, frames : int
        The first frame, counted over the whole file, and the number of frames.
    bytes, crc32 : int
        The size and check sum of the segment's packets, in file order.
    """

    index: int
    tile: Tile
    first: int
    frames: int
    bytes: int
    crc32: int

    @property
    def stop(self) -> int:
        return self.first + self.frames


class SegmentIndex(Sequence[Segment]):
    """All segments of a file, in its order, as (S, 8) int64: the tile's column, row, columns and
    rows; first frame, frames, bytes, and check sum."""

    def __init__(self, layout: FrameLayout, numbers: np.ndarray):
        self.layout = layout
        self.numbers = np.asarray(numbers, np.int64).reshape(-1, 8)

    @classmethod
    def from_json(cls, layout: FrameLayout, rows: list) -> SegmentIndex:
        """Create an index from lists of eight whole numbers from 0 to 2^63 - 1."""
        for index, row in enumerate(rows):
            whole = isinstance(row, list) and len(row) == 8
            if not (whole and all(type(n) is int and 0 <= n < 1 << 63 for n in row)):
                raise StorageError("must be eight whole numbers", key=f"segments[{index}]")
        return cls(layout, np.array(rows, np.int64))

    def __repr__(self) -> str:
        return f"<{len(self)} segments>"

    def to_json(self) -> list[list[int]]:
        return self.numbers.tolist()

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, place: int) -> Segment: ...
    @overload
    def __getitem__(self, place: slice) -> SegmentIndex: ...
    def __getitem__(self, place: int | slice) -> Segment | SegmentIndex:
        if isinstance(place, slice):
            return SegmentIndex(self.layout, self.numbers[place])
        column, row, columns, rows, *rest = self.numbers[place].tolist()
        index = range(len(self))[place]
        return Segment(index, self.layout.tile(column, row, columns, rows, index), *rest)

    def __eq__(self, other: object) -> bool:
        same = isinstance(other, SegmentIndex) and other.layout == self.layout
        return same and np.array_equal(self.numbers, other.numbers)  # type: ignore[attr-defined]

    __hash__ = None  # type: ignore[assignment]

    @property
    def frames(self) -> int:
        """The number of frames of all segments."""
        return int(self.numbers[:, FRAMES].sum())

    def meeting(self, column0: int, row0: int, column1: int, row1: int) -> list[int]:
        """Return the indices of tiles that meet a half-open rectangle of the outer grid."""
        column, row, columns, rows = self.numbers[:, :FIRST].T
        meets = (column < column1) & (column0 < column + columns)
        meets &= (row < row1) & (row0 < row + rows)
        return np.flatnonzero(meets).tolist()

    def check(self, extent: Rectangle | None) -> None:
        """Raise :class:`StorageError` unless each tile has the frames that it needs, in order, and
        each element of the outer grid, or of its ``extent``, is in exactly one tile."""
        tiles, pack = self.numbers[:, :FIRST], self.layout.pack
        low, size = tiles[:, :2], tiles[:, 2:]
        outer = np.array(self.layout.outer)
        bad = (size < 1) | (size > outer) | (low > outer) | (low + size > outer) | (low % pack != 0)
        for index in np.flatnonzero(bad.any(1))[:1].tolist():
            self[index]  # raises an error with the reason
        needed = np.prod(-(-size // pack), axis=1)
        first = np.cumsum(needed) - needed
        wrong = (self.numbers[:, FIRST] != first) | (self.numbers[:, FRAMES] != needed)
        for index in np.flatnonzero(wrong)[:1].tolist():
            begin, frames = self.numbers[index, [FIRST, FRAMES]].tolist()
            raise StorageError(
                f"segment {index} has frames {begin} to {begin + frames - 1}, its tile "
                f"needs {first[index]} to {first[index] + needed[index] - 1}",
                key="segments",
            )
        column, row, columns, rows = extent or (0, 0, *self.layout.outer)
        if not _covers(tiles, column, row, columns, rows):
            problem = f"the tiles do not cover the {columns} x {rows} elements exactly once"
            raise StorageError(problem, key="segments")


def _covers(tiles: np.ndarray, column: int, row: int, columns: int, rows: int) -> bool:
    """Return whether rectangles (S, 4) partition the given one.

    From the top down, each must begin where the rectangles before it end, in all its columns.
    """
    low, high = tiles[:, :2] - [column, row], tiles[:, :2] + tiles[:, 2:] - [column, row]
    if (low < 0).any() or (high > [columns, rows]).any():
        return False
    filled = np.zeros(columns, np.int64)
    for left, top, right, bottom in np.hstack([low, high])[np.lexsort(low.T)].tolist():
        below = filled[left:right]
        if (below != top).any():
            return False
        below[:] = bottom
    return bool((filled == rows).all())
